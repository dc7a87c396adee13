"""Gains: the command line before the campaign, and no gain that nobody gave."""

from __future__ import annotations

import math

import pytest

from compensation.controller import Gains
from compensation.sampled_loop import Sampling
from pipelines.exit_status import UsageError
from pipelines.settings.gains import GainOptions, chosen_gains, chosen_sampling, with_exact
from pipelines.settings.loop import LoopDefaults, resolution_of

BENCH = LoopDefaults(
    proportional=0.4, derivative=0.02, observer=73.5, sample_period=0.001, resolution=1e-4, delay=1
)


def test_the_command_line_goes_before_the_campaign() -> None:
    options = GainOptions(compensation=1.1, observer=40.0)
    assert chosen_gains(BENCH, options, source="robot.json") == Gains(0.4, 0.02, 40.0, 1.1)


def test_a_missing_gain_names_its_option() -> None:
    with pytest.raises(UsageError, match=r"robot\.json gives no single value for --compensation-gain \("):
        chosen_gains(BENCH, GainOptions(), source="robot.json")
    with pytest.raises(UsageError, match="--compensation-gain and --observer-gain and --proportional"):
        chosen_gains(LoopDefaults(), GainOptions(), source="robot.json")


def test_exact_compensation_is_assumed_only_where_nothing_is_said() -> None:
    assert with_exact(BENCH, GainOptions()).compensation == 1.0
    assert with_exact(BENCH, GainOptions(compensation=0.9)).compensation is None
    assert with_exact(LoopDefaults(compensation=0.8), GainOptions()).compensation == 0.8


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_value_that_no_gain_has(value: float) -> None:
    with pytest.raises(UsageError, match=f"--observer-gain is {value}"):
        chosen_gains(BENCH, GainOptions(compensation=1.0, observer=value), source="robot.json")
    with pytest.raises(UsageError, match=f"--sample-period is {value}"):
        chosen_sampling(BENCH, GainOptions(sample_period=value))


def test_no_proportional_gain_no_set_point() -> None:
    with pytest.raises(UsageError, match="n1 > 0"):
        chosen_gains(BENCH, GainOptions(compensation=1.0, proportional=0.0), source="robot.json")


def test_sampling_is_the_campaign_s_unless_said_otherwise() -> None:
    assert chosen_sampling(BENCH, GainOptions()) == Sampling(0.001, resolution=1e-4, delay=1)
    assert chosen_sampling(BENCH, GainOptions(sample_period=0.0)) is None
    assert chosen_sampling(LoopDefaults(), GainOptions()) is None
    finer = chosen_sampling(BENCH, GainOptions(sample_period=0.002), resolution=1e-5)
    assert finer == Sampling(0.002, resolution=1e-5, delay=1)


def test_an_encoder_needs_a_sampled_loop() -> None:
    with pytest.raises(UsageError, match="--sample-period"):
        chosen_sampling(LoopDefaults(), GainOptions(), resolution=1e-4)


def test_a_count_is_an_angle_or_a_length() -> None:
    assert resolution_of(360) == pytest.approx(math.radians(1))
    assert resolution_of(1000, "linear") == 0.001

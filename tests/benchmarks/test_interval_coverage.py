"""A small copy of the coverage benchmark: intervals hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.calibration.coverage import Claim, binomial_interval, drawn, identified, judge, judge_plain
from benchmarks.calibration.synthetic import DESIGNS, GOOD, Errors, gaussian, heavy_tailed, skewed

CAMPAIGNS = 12
BY_NAME = {design.name: design for design in DESIGNS}


def _claims(name: str) -> list[Claim]:
    design = BY_NAME[name]
    return [claim for seed in range(CAMPAIGNS) for claim in judge(design, drawn(design, seed))]


def test_intervals_of_every_design_hold_the_truth() -> None:
    told = [claim for name in BY_NAME for claim in _claims(name) if identified(claim)]
    # 95 %, give or take twice what 72 campaigns leave, two parameters' worth of independence in each.
    assert 0.91 <= np.mean([claim.held for claim in told]) <= 0.985
    assert np.mean([claim.withheld for claim in told]) < 0.02


def test_without_low_speeds_the_stribeck_velocity_is_withheld() -> None:
    found = [claim for claim in _claims("no-low-speeds") if claim.parameter == "stribeck_velocity"]
    assert np.mean([claim.withheld for claim in found]) >= 0.9


def test_plain_lmfit_promises_too_much_of_breakaways() -> None:
    design = BY_NAME["coarse-encoder"]
    found = [claim for seed in range(CAMPAIGNS) for claim in judge_plain(design, drawn(design, seed))]
    assert np.mean([claim.held for claim in found if claim.parameter == "static_torque"]) < 0.85


def test_a_campaign_is_the_same_wherever_it_is_drawn() -> None:
    first, second = drawn(GOOD, 7), drawn(GOOD, 7)
    assert first.robot == second.robot
    assert first.evidence.runs == second.evidence.runs
    assert drawn(GOOD, 8).robot != first.robot


@pytest.mark.parametrize("errors", [gaussian, heavy_tailed, skewed])
def test_errors_have_mean_zero_and_variance_one(errors: Errors) -> None:
    sample = errors(np.random.default_rng(1), 200_000)
    assert np.mean(sample) == pytest.approx(0.0, abs=0.01)
    assert np.var(sample) == pytest.approx(1.0, abs=0.05)


def test_the_binomial_interval_is_clopper_and_pearsons() -> None:
    assert binomial_interval(0, 10) == pytest.approx((0.0, 1 - 0.025**0.1))
    assert binomial_interval(10, 10) == pytest.approx((0.025**0.1, 1.0))
    low, high = binomial_interval(950, 1000)
    assert low < 0.95 < high
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(0.95 * 0.05 / 1000), rel=0.06)

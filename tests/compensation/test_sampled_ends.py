"""Where a sampled run ends: the same as a record as long says, with fewer samples, and bounded."""

from __future__ import annotations

import math

import pytest

from compensation.controller import Controller, Gains
from compensation.orbits.steady_state import classify
from compensation.sampled_ends import SampledEnd, sampled_end
from compensation.sampled_loop import Sampling, run_sampled
from ident.model.published import asymmetric_robot
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, each_refused

ROBOT = asymmetric_robot()
RIG = Sampling(1e-3, 2 * math.pi / 2**18)


def controller(r: float, *, n1: float = 0.4, observer: float = 73.5) -> Controller:
    return Controller(Gains(n1, 0.02, observer, r), ROBOT.mean())


def end(loop: Controller, *stretches: float, most: int = 300_000, sampling: Sampling = RIG) -> SampledEnd:
    return sampled_end(ROBOT, loop, sampling, start=0.6, stretches=stretches, most_samples=most)


@pytest.mark.parametrize("r", [0.8, 0.97, 1.02, 1.2])
def test_the_verdict_is_that_of_the_whole_record(r: float) -> None:
    found = end(controller(r), 30.0)
    record = run_sampled(ROBOT, controller(r), RIG, start=(0.6, 0.0), duration=30.0)
    seen = classify(record.time, record.measured, resolution=RIG.resolution)
    assert found.state.verdict == seen.verdict
    assert found.state.amplitude == seen.amplitude
    assert found.state.period == seen.period
    if seen.verdict == "equilibrium":
        assert found.x1_min == found.x1_max == pytest.approx(seen.position_error, abs=RIG.resolution)
        assert found.samples < record.time.size
    else:
        assert found.x1_min is not None
        assert found.x1_max is not None
        assert max(-found.x1_min, found.x1_max) == seen.amplitude


def test_a_longer_look_decides_what_a_short_one_leaves_open() -> None:
    assert end(controller(1.1), 5.0).state.verdict == "undecided"
    assert end(controller(1.1), 5.0, 30.0).state.verdict == "limit_cycle"


def test_samples_are_bounded_and_the_reason_is_said() -> None:
    found = end(controller(1.1, n1=0.004), 30.0, 120.0, 480.0, most=60_000)
    assert found.state.verdict == "undecided"
    assert found.samples <= 60_000
    assert "and no longer" in found.state.why
    assert (found.x1_min, found.x1_max) == (None, None)


def test_an_unstable_controller_is_undecided_with_its_reason() -> None:
    found = end(controller(0.9, observer=1000.0), 30.0, sampling=Sampling(1e-2))
    assert found.state.verdict == "undecided"
    assert "unstable" in found.state.why
    assert "L h = 10" in found.state.why
    assert found.samples < 100


def test_what_is_no_number_is_refused_by_name() -> None:
    given = {"robot": ROBOT, "controller": controller(1.0), "sampling": RIG, "start": 0.6, "stretches": [1.0]}
    bad = {
        "start": (*NO_NUMBERS, math.inf),
        "stretches": (*NO_ARRAYS, 1.0, [], [0.0], [2.0, 1.0], [math.nan], [math.inf]),
        "reference": NO_NUMBERS,
        "most_samples": (0, -1, 1.5, "1", None),
    }
    each_refused(sampled_end, given, bad)

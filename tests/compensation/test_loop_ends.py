"""Ends of branches of cycles: there is a cycle just inside, and none just outside."""

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.loop_ends import LOCATED, between, towards_the_end
from compensation.loop_section import LoopSection, with_gain
from compensation.orbits.periodic_orbits import Cycle, find_cycle
from ident.model.published import asymmetric_robot, symmetric_robot

GAINS = Gains(proportional=0.4, derivative=0.02, observer=73.5, compensation=1.0)


def cycle_at(loop: ClosedLoop, r: float) -> Cycle:
    cycle = find_cycle(LoopSection(with_gain(loop, "r", r)), np.array([0.6, 0.0]))
    assert isinstance(cycle, Cycle)
    return cycle


def paper() -> ClosedLoop:
    return ClosedLoop(symmetric_robot(), Controller(GAINS, symmetric_robot()))


@pytest.mark.parametrize("suspects", [[], [1.0], [0.995, 1.0]])
def test_cycles_shrink_to_nothing_where_the_set_point_loses_its_stability(suspects: list[float]) -> None:
    """Below 1 + 1.1e-5 the cycle is not symmetric any more, but there is one down to 1."""
    way = towards_the_end(paper(), "r", (1.01, 0.99), cycle_at(paper(), 1.01), suspects)
    assert way.passed[-1].cycle.amplitude < 1e-5
    assert way.shrinks
    if 1.0 in suspects:
        assert way.end == 1.0
    else:
        assert 1.0 < way.end <= 1.0 + LOCATED


@pytest.mark.parametrize("outside", [0.0, 1.0 - 1e-13])
@pytest.mark.parametrize("inside", [1.0 + 1e-12, 1.0 + 1e-6, 2.0, 1e6])
def test_a_birth_is_told_exactly_from_any_distance(inside: float, outside: float) -> None:
    loop = with_gain(paper(), "r", inside)
    start = (inside - 1.0) * loop.robot.friction.positive.static_torque / GAINS.proportional
    cycle = find_cycle(LoopSection(loop), np.array([start, 0.0]))
    assert isinstance(cycle, Cycle)
    way = towards_the_end(paper(), "r", (inside, outside), cycle, [1.0])
    assert way.end == 1.0
    assert way.shrinks


def test_beside_a_birth_logarithms_are_cut() -> None:
    assert between(1.0 + 1e-12, 1.0 + 1e-4, [3.0, 1.0]) == pytest.approx(1.0 + 1e-8, abs=1e-11)
    assert between(1.0 - 1e-4, 1.0 + 1e-8, [1.0]) == pytest.approx(1.0 - 5e-5, abs=1e-8)
    assert between(2.0, 1.0) == 1.5


def test_a_branch_that_ends_with_a_jump() -> None:
    loop = ClosedLoop(asymmetric_robot(), Controller(GAINS, symmetric_robot()))
    last = towards_the_end(loop, "r", (1.0, 0.99), cycle_at(loop, 1.0), []).passed[-1]
    assert last.cycle.amplitude > 0.1
    inside = find_cycle(LoopSection(with_gain(loop, "r", last.value)), last.cycle.point)
    assert isinstance(inside, Cycle)
    assert inside.amplitude == pytest.approx(last.cycle.amplitude, rel=1e-7)
    beyond = find_cycle(LoopSection(with_gain(loop, "r", last.value - LOCATED)), last.cycle.point)
    assert not isinstance(beyond, Cycle)


def test_a_suspect_that_is_none_does_no_harm() -> None:
    loop = ClosedLoop(asymmetric_robot(), Controller(GAINS, symmetric_robot()))
    cycle = cycle_at(loop, 1.0)
    plain = towards_the_end(loop, "r", (1.0, 0.99), cycle, []).passed[-1]
    for suspect in (0.9905, 0.9999, 1.2):
        other = towards_the_end(loop, "r", (1.0, 0.99), cycle, [suspect]).passed[-1]
        assert other.value == pytest.approx(plain.value, abs=LOCATED)


def test_between_neighbouring_numbers_there_is_nothing_to_find() -> None:
    outside = float(np.nextafter(1.01, 0.0))
    last = towards_the_end(paper(), "r", (1.01, outside), cycle_at(paper(), 1.01), [outside, 1.01]).passed[-1]
    assert last.value == 1.01

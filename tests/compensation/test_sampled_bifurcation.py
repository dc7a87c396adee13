"""Limit cycles of the sampled loop over a gain."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, TypeVar

import numpy as np
import pytest

from compensation.controller import Controller, Gains, with_gain
from compensation.sampled_bifurcation import sampled_cycles, settling_time
from compensation.sampled_loop import Sampling
from ident.model.published import asymmetric_robot, symmetric_robot
from tests.bad_values import NO_ARRAYS, each_refused, refused

T = TypeVar("T")
R = TypeVar("R")
GAINS = Gains(0.4, 0.02, observer=73.5, compensation=1.0)
RIG = Sampling(0.001, 2 * math.pi / 2**18)


def test_the_asymmetric_rig_cycles_from_just_below_one() -> None:
    """The inclusion does between 0.99 and 1.00, with max|x1| = 0.185 at r = 1 and 0.391 at 1.1."""
    robot = asymmetric_robot()
    done: list[int] = []
    found = sampled_cycles(
        robot,
        Controller(GAINS, robot.mean()),
        RIG,
        parameter="r",
        values=[0.9, 0.98, 1.01, 1.1],
        tick=done.append,
    )
    (branch,) = found.branches
    assert [point.value for point in branch.points] == [1.01, 1.1]
    assert branch.points[1].amplitude == pytest.approx(0.391, abs=0.02)
    (onset,) = found.onsets
    assert 0.985 < onset.value < 1.005
    assert sum(done) == 4
    for point in branch.points:
        assert point.amplitude == pytest.approx(max(-point.x1_min, point.x1_max), abs=2e-3)


def test_a_gap_parts_branches() -> None:
    """Over L at r = 1.1 the loop cycles everywhere; at r = 0.9 nowhere."""
    robot = symmetric_robot()
    for r, branches in ((1.1, 1), (0.9, 0)):
        controller = with_gain(Controller(GAINS, robot), "r", r)
        found = sampled_cycles(robot, controller, RIG, parameter="L", values=[80.0, 100.0])
        assert len(found.branches) == branches
        assert found.onsets == ()


def test_values_may_be_spread() -> None:
    robot = symmetric_robot()

    def backwards(function: Callable[[T], R], items: Iterable[T]) -> Iterable[R]:
        return reversed([function(item) for item in reversed(list(items))])

    plain, spread = (
        sampled_cycles(robot, Controller(GAINS, robot), RIG, parameter="r", values=[1.05, 1.1], map=how)
        for how in (map, backwards)
    )
    assert plain == spread


def test_runs_last_many_turns() -> None:
    robot = symmetric_robot()
    turn = 2 * math.pi * math.sqrt(robot.inertia / GAINS.proportional)
    assert settling_time(robot, Controller(GAINS, robot)) == pytest.approx(40 * turn)
    assert np.isfinite(settling_time(robot, Controller(Gains(1e-3, 0.0, 1.0, 1.0), robot)))


def test_what_is_no_sweep_is_refused_by_name() -> None:
    robot = symmetric_robot()
    given = {"robot": robot, "controller": Controller(GAINS, robot), "sampling": RIG}
    sweep: dict[str, Any] = {**given, "parameter": "r", "values": [1.0]}
    bad = {"parameter": ("z", None), "values": (*NO_ARRAYS, 1.0, [], [1.1, 1.0], [1.0, math.nan, 1.1])}
    each_refused(sampled_cycles, sweep, bad)
    for values in ([-1.0, 1.0], [1.0, math.inf], [math.nan]):
        refused(partial(sampled_cycles, **{**sweep, "values": values}), "compensation gain")

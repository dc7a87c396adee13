"""Equilibrium sets: the reference numbers, and the inclusion itself as the judge."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from compensation.controller import Controller, Gains
from compensation.equilibria import EquilibriumSet, equilibrium_set, equilibrium_sets, torque_balance
from ident.model.friction import StribeckFriction
from ident.model.published import DERIVATIVE_GAIN, PROPORTIONAL_GAIN, asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, NO_WORDS, each_refused, refused
from tests.strategies import controllers, robots


def gains(r: float, L: float) -> Gains:
    return Gains(PROPORTIONAL_GAIN, DERIVATIVE_GAIN, observer=L, compensation=r)


def of(r: float, L: float, robot: OneLinkRobot | None = None) -> EquilibriumSet:
    robot = robot or symmetric_robot()
    return equilibrium_set(robot, Controller(gains(r, L), robot))


def with_shape(beta: float) -> OneLinkRobot:
    robot = symmetric_robot()
    curve = replace(robot.friction.positive, stribeck_shape=beta)
    return OneLinkRobot(robot.inertia, StribeckFriction.symmetric(curve))


@pytest.mark.parametrize(
    ("r", "expected"), [(0.0, 1.38146715), (0.9, 0.434386359), (1.0, 0.272937911), (1.01, 0.249410046)]
)
def test_largest_error_at_low_observer_gain(r: float, expected: float) -> None:
    found = of(r, 40.0)
    assert found.largest_error == pytest.approx(expected, abs=5e-9)
    assert found.x1_min == -found.x1_max
    assert found.origin_isolated == (r > 1.0)


@pytest.mark.parametrize("r", [1.005, 1.01])
def test_only_positive_roots_count(r: float) -> None:
    assert of(r, 100.0).is_single_point


def test_several_segments_for_a_law_that_bends_twice() -> None:
    segments = [s for s in of(0.995, 40.0, with_shape(2.0)).segments if s.direction == "negative"]
    assert [s.touches_zero for s in segments] == [True, False]
    assert segments[0].x1_max == pytest.approx(0.00735, abs=5e-6)
    assert (segments[1].x1_min, segments[1].x1_max) == pytest.approx((0.1446, 0.3625), abs=5e-5)


@pytest.mark.parametrize(("beta", "limit"), [(1.0, 73.07), (1.5, 45.58), (2.0, 45.51)])
def test_observer_gain_at_which_the_last_equilibrium_goes(beta: float, limit: float) -> None:
    assert not of(1.0, limit - 0.02, with_shape(beta)).is_single_point
    assert of(1.0, limit + 0.02, with_shape(beta)).is_single_point


@pytest.mark.parametrize("L", [20.0, 73.5, 120.0])
def test_thresholds_of_the_mean_law_on_the_asymmetric_robot(L: float) -> None:
    robot = asymmetric_robot()

    def touching(r: float) -> set[str]:
        found = equilibrium_set(robot, Controller(gains(r, L), robot.mean()))
        return {segment.direction for segment in found.segments if segment.touches_zero}

    assert touching(0.9435) == {"positive", "negative"}
    assert touching(0.9437) == touching(1.0563) == {"positive"}
    assert touching(1.0565) == set()


def test_symmetric_set_is_the_papers_formula() -> None:
    """Eq (9) with eq (10), scanned on a grid for figure 4's range."""
    robot = symmetric_robot()
    curve, J = robot.friction.positive, robot.inertia
    for L in (5.0, 30.0, 60.0):
        x2 = np.linspace(1e-6, 1.0, 2_000_001)
        held = (curve.viscous_damping + L * J) * x2 + curve.dry(x2) <= curve.static_torque
        edge = x2[held].max() * (L * J + curve.viscous_damping + DERIVATIVE_GAIN) / PROPORTIONAL_GAIN
        assert of(1.0, L).largest_error == pytest.approx(edge, rel=1e-4)


@given(robots(), controllers())
def test_the_inclusion_judges_every_rest(robot: OneLinkRobot, controller: Controller) -> None:
    """With v = 0 and x2' = 0, a state is an equilibrium if and only if the robot holds the torque."""
    found = equilibrium_set(robot, controller)
    n1, n2, L = controller.gains.proportional, controller.gains.derivative, controller.gains.observer
    model, J = controller.model.friction, controller.model.inertia
    reach = 1.3 * max(found.largest_error, 0.1)
    for x1 in np.linspace(-reach, reach, 101):
        if abs(x1) < 1e-9:
            continue
        b = (model.positive if x1 < 0 else model.negative).viscous_damping
        x2 = -n1 * x1 / (L * J + b + n2)
        assert -n1 / J * x1 - (b + n2) / J * x2 - L * x2 == pytest.approx(
            0.0, abs=1e-9 * (1 + abs(n1 * x1 / J))
        )
        compensation, _ = model.torque_interval(x2)
        torque = -n1 * x1 - n2 * x2 + controller.gains.compensation * float(compensation)
        room = min(
            robot.friction.positive.static_torque - torque, torque + robot.friction.negative.static_torque
        )
        if abs(room) > 1e-9:
            assert found.contains(float(x1)) == (room > 0)
    assert found.contains(0.0)


@given(robots(), controllers())
def test_undercompensation_always_leaves_a_segment(robot: OneLinkRobot, controller: Controller) -> None:
    r, model = controller.gains.compensation, controller.model.friction
    touching = {s.direction for s in equilibrium_set(robot, controller).segments if s.touches_zero}
    if r * model.positive.static_torque < robot.friction.positive.static_torque:
        assert "positive" in touching
    if r * model.negative.static_torque < robot.friction.negative.static_torque:
        assert "negative" in touching


def test_a_sweep_is_its_single_sets() -> None:
    robot = symmetric_robot()
    controller = Controller(gains(1.0, 40.0), robot)
    assert equilibrium_sets(robot, controller, parameter="L", values=[40.0, 80.0]) == (
        of(1.0, 40.0),
        of(1.0, 80.0),
    )
    assert equilibrium_sets(robot, controller, parameter="r", values=[0.9]) == (of(0.9, 40.0),)


def test_what_is_no_sweep_is_refused_by_name() -> None:
    robot = symmetric_robot()
    given = {"robot": robot, "controller": Controller(gains(1.0, 40.0), robot)}
    each_refused(torque_balance, given, {"direction": ("up", *NO_WORDS)})
    sweep: dict[str, Any] = {**given, "parameter": "r", "values": [1.0]}
    bad = {"parameter": ("z", "l", None, 1), "values": (*NO_ARRAYS, 1.0)}
    each_refused(equilibrium_sets, sweep, bad)
    each_refused(equilibrium_sets, sweep, {"values": []})
    for value in (-1.0, np.nan, np.inf):
        refused(partial(equilibrium_sets, **{**sweep, "values": [0.5, value]}), "compensation gain")
    place = {"position": 0.1, "tolerance": 0.0}
    each_refused(of(1.0, 40.0).contains, place, {"position": NO_NUMBERS, "tolerance": (*NO_NUMBERS, -1.0)})

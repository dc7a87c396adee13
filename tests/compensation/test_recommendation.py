"""The advice: above the critical gain, below overcompensation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains
from compensation.equilibria import equilibrium_set
from compensation.recommendation import ThresholdEnds, overcompensation_thresholds, recommend, static_ratio
from ident.model.friction import StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_NUMBERS, each_refused
from tests.strategies import robots


def test_thresholds_of_table_1() -> None:
    robot = asymmetric_robot()
    mean = overcompensation_thresholds(robot, robot.mean().friction)
    assert mean["negative"] == pytest.approx(0.5123 / 0.5429, abs=1e-9)
    assert mean["positive"] <= 0.5735 / 0.5429
    assert overcompensation_thresholds(robot, robot.friction) == {"positive": 1.0, "negative": 1.0}


@given(robots(), robots())
def test_below_its_threshold_no_speed_is_overcompensated(robot: OneLinkRobot, model: OneLinkRobot) -> None:
    for direction, r in overcompensation_thresholds(robot, model.friction).items():
        true = getattr(robot.friction, direction)
        believed = getattr(model.friction, direction)
        speeds = np.linspace(0.0, 5.0, 2001) * true.stribeck_velocity
        assert np.all(r * believed.dry(speeds) <= true.dry(speeds) * (1 + 1e-3))


@given(robots(st.floats(1.0, 2.0)))
def test_advice_meets_the_criteria(robot: OneLinkRobot) -> None:
    advice = recommend(robot, proportional=0.4, derivative=0.02)
    worst = critical_observer_gains(robot).worst
    assume(robot.friction.positive != robot.friction.negative)
    assert [one.compensator for one in advice] == ["per-direction", "mean"]
    for one in advice:
        assert one.observer_gain is not None
        assert one.observer_gain > max(worst, 0.0)
        model = robot.mean() if one.compensator == "mean" else robot
        for direction in ("positive", "negative"):
            static = getattr(robot.friction, direction).static_torque
            assert one.compensation_gain * getattr(model.friction, direction).static_torque < static
        controller = Controller(Gains(0.4, 0.02, one.observer_gain, one.compensation_gain), model)
        assert one.largest_rest_error == equilibrium_set(robot, controller).largest_error


def test_uncertainty_lowers_r_and_raises_the_observer_gain() -> None:
    robot = asymmetric_robot()
    plain = recommend(robot, proportional=0.4, derivative=0.02)[0]
    doubtful = recommend(
        robot, proportional=0.4, derivative=0.02, worst_gain_high=110.0, thresholds=ThresholdEnds(0.95, 0.9)
    )
    assert plain.observer_gain is not None
    assert doubtful[0].observer_gain is not None
    assert doubtful[0].observer_gain > 110.0 > plain.observer_gain
    assert doubtful[0].compensation_gain == 0.95
    assert doubtful[1].compensation_gain == 0.9
    assert "overcompensates the negative direction from r = 0.9436" in doubtful[1].why
    assert "rests in the positive direction remain up to r = 1.056" in doubtful[1].why


def test_a_symmetric_robot_has_one_law() -> None:
    (only,) = recommend(symmetric_robot(), proportional=0.4, derivative=0.02)
    assert only.compensator == "mean"
    assert only.compensation_gain == 0.99


def test_an_infinitely_steep_law_has_no_observer_gain() -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=0.8)
    (only,) = recommend(
        OneLinkRobot(0.026, StribeckFriction.symmetric(curve)), proportional=0.4, derivative=0.02
    )
    assert only.observer_gain is None
    assert "beta < 1" in only.why


def test_what_is_no_number_is_refused_by_name() -> None:
    given = {"robot": symmetric_robot(), "proportional": 0.4, "derivative": 0.02}
    words = tuple(value for value in NO_NUMBERS if value is not None)
    bad = {"proportional": (*words, 0.0, -1.0), "derivative": (*words, -1.0), "worst_gain_high": words}
    each_refused(recommend, given, bad)
    ends = {"per_direction": 0.9, "mean": 0.9}
    each_refused(ThresholdEnds, ends, {"per_direction": (*NO_NUMBERS, -1.0), "mean": (*NO_NUMBERS, -1.0)})
    pair = {"robot": symmetric_robot(), "model": symmetric_robot()}
    each_refused(static_ratio, pair, {"direction": ("up", None)})

"""The response between samples, against independent integrators, conservation, and closed forms."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from data.recording import FloatArray
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.response import (
    TorqueRipple,
    advance,
    advance_with_ripple,
    breakaway_delay,
    law_array,
    plant_array,
    respond,
)
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, NO_WORDS, each_refused
from tests.strategies import robots

TABLE_1 = asymmetric_robot()


def with_shape(shape: float) -> OneLinkRobot:
    curve = StribeckCurve(0.57, 0.40, 0.07, 0.08, shape)
    return OneLinkRobot(0.026, StribeckFriction.symmetric(curve))


def by_dop853(
    robot: OneLinkRobot, position: float, velocity: float, torque: float, period: float
) -> tuple[float, float]:
    """The same motion by scipy, one direction of motion at a time."""
    time, friction = 0.0, robot.friction
    while time < period:
        low, high = -friction.negative.static_torque, friction.positive.static_torque
        if velocity == 0.0 and low <= torque <= high:
            return position, 0.0
        sign = math.copysign(1.0, velocity if velocity != 0.0 else torque)
        curve = friction.positive if sign > 0 else friction.negative

        def field(_: float, y: FloatArray, curve: StribeckCurve = curve, sign: float = sign) -> list[float]:
            drag = curve.coulomb_torque + curve.viscous_damping * y[1]
            ratio = max(y[1], 0.0) / curve.stribeck_velocity
            drag += curve.stribeck_torque * math.exp(-(ratio**curve.stribeck_shape))
            return [float(y[1]), (sign * torque - drag) / robot.inertia]

        def stops(_: float, y: FloatArray) -> float:
            return float(y[1])

        stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]  # how scipy is told
        first = min(1e-6, 0.1 * (period - time))
        found = solve_ivp(
            field,
            (time, period),
            [0.0, abs(velocity)],
            method="DOP853",
            rtol=1e-13,
            atol=1e-15,
            events=stops,
            first_step=first,
            max_step=period / 40,
        )
        if found.status != 1 or found.t_events is None or found.y_events is None:
            return position + sign * float(found.y[0, -1]), sign * float(found.y[1, -1])
        time, velocity = float(found.t_events[0][0]), 0.0
        position += sign * float(found.y_events[0][0][0])
    return position, velocity


@pytest.mark.parametrize("shape", [0.5, 0.8, 1.0, 1.3, 2.0, 2.7])
def test_agrees_with_dop853_for_any_law_torque_and_period(shape: float) -> None:
    generator = np.random.default_rng(round(10 * shape))
    for _ in range(12):
        static = generator.uniform(0.2, 1.0, 2)
        curves = [
            StribeckCurve(
                f,
                f * generator.uniform(0.3, 1.0),
                10 ** generator.uniform(-1.7, 0),
                generator.uniform(0, 0.3),
                shape,
            )
            for f in static
        ]
        robot = OneLinkRobot(10 ** generator.uniform(-2.5, -0.5), StribeckFriction(*curves))
        velocity = float(generator.choice([0.0, 1.0]) * generator.normal())
        torque, period = float(generator.normal()), float(10 ** generator.uniform(-5, math.log10(0.05)))
        got = advance(0.0, velocity, torque, period, law_array(robot))
        assert got == pytest.approx(by_dop853(robot, 0.0, velocity, torque, period), rel=2e-12, abs=1e-12)


@settings(max_examples=150, deadline=None)
@given(robots(), st.floats(-2, 2), st.floats(-2, 2), st.floats(1e-5, 0.05))
def test_a_period_in_one_step_is_the_same_as_in_many(
    robot: OneLinkRobot, velocity: float, torque: float, period: float
) -> None:
    law, state = law_array(robot), (0.0, velocity)
    whole = advance(0.0, velocity, torque, period, law)
    for _ in range(16):
        state = advance(*state, torque, period / 16, law)
    # near |u| = F_s of beta < 1 a rounding error of the torque is itself amplified without bound
    margin = min(
        abs(abs(torque) - c.static_torque) for c in (robot.friction.positive, robot.friction.negative)
    )
    assert whole == pytest.approx(state, rel=1e-11, abs=1e-12 / min(1.0, max(margin, 1e-6)))


@settings(max_examples=60, deadline=None)
@given(robots(), st.floats(-3, 3), st.floats(-2, 2))
def test_a_mirrored_robot_moves_in_the_mirror(robot: OneLinkRobot, velocity: float, torque: float) -> None:
    mirrored = OneLinkRobot(
        robot.inertia, StribeckFriction(positive=robot.friction.negative, negative=robot.friction.positive)
    )
    got = advance(0.3, velocity, torque, 0.004, law_array(robot))
    image = advance(-0.3, -velocity, -torque, 0.004, law_array(mirrored))
    assert image == (-got[0], -got[1])


def test_sticks_exactly_within_the_interval_of_either_direction() -> None:
    friction = TABLE_1.friction
    for torque in (friction.positive.static_torque, -friction.negative.static_torque, 0.0):
        assert advance(0.1, 0.0, torque, 1.0, law_array(TABLE_1)) == (0.1, 0.0)
    for torque in (
        math.nextafter(friction.positive.static_torque, 1),
        math.nextafter(-friction.negative.static_torque, -1),
    ):
        position, velocity = advance(0.0, 0.0, torque, 1.0, law_array(TABLE_1))
        assert math.copysign(1, velocity) == math.copysign(1, position) == math.copysign(1, torque)


def test_comes_to_rest_and_goes_on_backwards() -> None:
    law = law_array(TABLE_1)
    position, velocity = advance(0.0, 0.01, -0.9, 0.05, law)
    assert velocity < 0 > position
    assert advance(0.0, 0.01, -0.4, 0.05, law)[1] == 0.0


@pytest.mark.parametrize("shape", [0.7, 1.0, 2.0])
def test_work_of_the_motor_is_kinetic_energy_and_friction_loss(shape: float) -> None:
    robot, h = with_shape(shape), 2e-4
    curve = robot.friction.positive
    torque = 0.9 * np.sin(np.arange(5000) * h * 5.0)
    position, velocity = respond(robot, start=(0.0, 0.2), torque=torque, period=h)
    supplied = float(np.sum(torque * np.diff(position)))
    gained = 0.5 * robot.inertia * (velocity[-1] ** 2 - velocity[0] ** 2)
    speed = np.abs(velocity)
    power = speed * curve.total(speed)
    lost = float(np.sum(0.5 * (power[1:] + power[:-1])) * h)  # trapezia: second order in h
    assert supplied - gained == pytest.approx(lost, rel=2e-5)


def test_without_a_stribeck_effect_the_speed_is_an_exponential() -> None:
    robot = OneLinkRobot(0.02, StribeckFriction.symmetric(StribeckCurve(0.3, 0.3, 0.05, 0.1)))
    final = (1.0 - 0.3) / 0.1
    position, velocity = respond(robot, start=(0.0, 0.0), torque=np.full(100, 1.0), period=0.01)
    time = 0.01 * np.arange(101)
    fading = -np.expm1(-time * 0.1 / 0.02)
    np.testing.assert_allclose(velocity, final * fading, rtol=1e-13)
    np.testing.assert_allclose(position, final * (time - 0.2 * fading), rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize(
    ("robot", "velocity", "torque", "period"),
    [
        # breaks away with an excess of a rounding error, where the slope at rest is infinite
        (with_shape(0.3), 0.0, 0.57 * (1 + 1e-12), 0.05),
        # fades to rest without reaching it, thousands of time constants in one period
        (
            OneLinkRobot(1e-5, StribeckFriction.symmetric(StribeckCurve(0.04, 0.01, 0.01, 20.0, 2.7))),
            50.0,
            0.04,
            0.003,
        ),
        # falls from a million v_s
        (
            OneLinkRobot(1e-2, StribeckFriction.symmetric(StribeckCurve(0.5, 0.1, 1e-5, 0.0, 1.0))),
            10.0,
            -2.0,
            0.05,
        ),
        # moves so steadily that its distance from rest says nothing of a period's
        (
            OneLinkRobot(40.0, StribeckFriction.symmetric(StribeckCurve(0.25, 0.24, 2e-5, 0.0, 4.0))),
            0.5,
            -0.25,
            6e-6,
        ),
    ],
)
def test_extremes_are_as_exact(robot: OneLinkRobot, velocity: float, torque: float, period: float) -> None:
    law, state = law_array(robot), (0.0, velocity)
    for _ in range(32):
        state = advance(*state, torque, period / 32, law)
    assert advance(0.0, velocity, torque, period, law) == pytest.approx(state, rel=1e-10, abs=1e-30)


def test_the_ripple_is_a_torque_at_the_sample_s_position() -> None:
    plant = plant_array(TABLE_1, TorqueRipple(amplitude=0.2, harmonic=7.0, phase=0.3))
    added = 0.2 * math.sin(7.0 * 0.4 + 0.3)
    assert advance_with_ripple(0.4, 0.1, 0.5, 1e-3, plant) == advance(0.4, 0.1, 0.5 + added, 1e-3, plant)


@pytest.mark.parametrize(("rate", "travel"), [(0.1, 1e-9), (1.0, 1e-8), (0.02, 1e-9)])
def test_a_small_delay_after_breakaway_has_a_closed_form(rate: float, travel: float) -> None:
    robot = symmetric_robot()
    curve = robot.friction.positive
    tau = robot.inertia / (curve.stribeck_torque / curve.stribeck_velocity - curve.viscous_damping)

    def moved(t: float) -> float:
        return rate * tau**2 / robot.inertia * (tau * math.expm1(t / tau) - t - t**2 / (2 * tau)) - travel

    delay = breakaway_delay(robot, direction="positive", ramp_rate=rate, travel=travel)
    assert delay == pytest.approx(brentq(moved, 0.0, 1.0, xtol=1e-15), rel=1e-6)


@pytest.mark.parametrize("shape", [0.6, 0.8, 1.0, 1.5, 2.0])
def test_a_ramp_is_the_limit_of_ever_shorter_samples(shape: float) -> None:
    robot, rate = with_shape(shape), 0.2
    delay = breakaway_delay(robot, direction="negative", ramp_rate=rate, travel=0.01)
    errors = []
    for n in (4000, 8000):
        held = 0.57 + rate * delay * (np.arange(n) + 0.5) / n
        position, _ = respond(robot, start=(0.0, 0.0), torque=-held, period=delay / n)
        errors.append(abs(-position[-1] / 0.01 - 1))
    assert errors[1] < 0.75 * errors[0] < 5e-5


@pytest.mark.parametrize("direction", ["positive", "negative"])
def test_each_direction_has_its_own_delay(direction: Literal["positive", "negative"]) -> None:
    one_sided = OneLinkRobot(
        TABLE_1.inertia, StribeckFriction.symmetric(getattr(TABLE_1.friction, direction))
    )
    delays = [
        breakaway_delay(r, direction=direction, ramp_rate=0.1, travel=1e-3) for r in (TABLE_1, one_sided)
    ]
    assert delays[0] == delays[1]


def test_refuses_what_no_rig_can_have() -> None:
    held = {"robot": TABLE_1, "start": (0.0, 0.0), "torque": np.zeros(3), "period": 1e-3}
    bad = {
        "start": (*NO_ARRAYS, 0.6, (math.nan, 0.0), (0.6, 0.0, 0.0)),
        "torque": (*NO_ARRAYS, 0.6, [0.0, math.nan]),
        "period": (*NO_NUMBERS, 0.0, math.inf),
    }
    each_refused(respond, held, bad)
    ramp = {"robot": TABLE_1, "direction": "positive", "ramp_rate": 0.1, "travel": 1e-3}
    magnitudes = (*NO_NUMBERS, 0.0, -0.1, math.inf)
    each_refused(
        breakaway_delay, ramp, {"direction": ("up", *NO_WORDS), "ramp_rate": magnitudes, "travel": magnitudes}
    )


@pytest.mark.parametrize("name", ["amplitude", "harmonic", "phase"])
def test_a_ripple_is_made_of_numbers(name: str) -> None:
    each_refused(TorqueRipple, {}, {name: (*NO_NUMBERS, math.inf)})

"""Critical gains, decay rates and the sector bound."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from compensation.controller import Controller, Gains
from compensation.design_criteria import (
    critical_observer_gain,
    critical_observer_gains,
    loop_decay,
    observer_error_decay,
    sector_constant,
    sector_slack,
)
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, each_refused, refused
from tests.strategies import robots, stribeck_curves

PAPER = Gains(0.4, 0.02, observer=73.5, compensation=1.0)


@pytest.mark.parametrize(("beta", "expected"), [(1.0, 73.07), (1.5, 53.66), (2.0, 62.23)])
def test_critical_gain_of_other_shapes(beta: float, expected: float) -> None:
    mean = symmetric_robot().friction.positive
    curve = StribeckCurve(
        mean.static_torque, mean.coulomb_torque, mean.stribeck_velocity, mean.viscous_damping, beta
    )
    assert critical_observer_gain(curve, inertia=0.026) == pytest.approx(expected, abs=0.005)


def test_no_finite_gain_for_a_law_that_is_infinitely_steep() -> None:
    steep = StribeckCurve(0.6, 0.4, 0.07, 0.08, stribeck_shape=0.9)
    flat = StribeckCurve(0.5, 0.4, 0.07, 0.08)
    found = critical_observer_gains(OneLinkRobot(0.026, StribeckFriction(steep, flat)))
    assert found.positive == found.worst == math.inf
    assert math.isfinite(found.negative)


def test_without_a_stribeck_effect_damping_is_enough() -> None:
    assert critical_observer_gain(StribeckCurve(0.4, 0.4, 0.07, 0.08), inertia=0.02) == pytest.approx(-4.0)


@given(stribeck_curves(st.floats(1.0, 3.0)))
def test_steepest_fall_against_a_scan(curve: StribeckCurve) -> None:
    speeds = np.geomspace(1e-4, 1e2, 20_001) * curve.stribeck_velocity
    falls = -np.diff(curve.dry(speeds)) / np.diff(speeds)
    rounding = 4 * np.finfo(float).eps * curve.static_torque / np.diff(speeds).min()
    assert falls.max() <= curve.steepest_fall * (1 + 1e-6) + rounding
    assert falls.max() == pytest.approx(curve.steepest_fall, rel=0.01, abs=rounding)


@given(robots(st.floats(1.0, 2.5)), st.integers(0, 2**31))
def test_incremental_sector_bound(robot: OneLinkRobot, seed: int) -> None:
    generator = np.random.default_rng(seed)
    scale = robot.friction.positive.stribeck_velocity
    x2 = generator.normal(size=400) * scale * 10.0 ** generator.uniform(-4, 2, 400)
    x3 = generator.normal(size=400) * scale * 10.0 ** generator.uniform(-4, 2, 400)
    x2[:20], x3[20:40] = 0.0, -x2[20:40]  # stuck estimates, and a stuck link
    slack = sector_slack(robot.friction, x2, x3)
    assert np.all(slack >= -1e-12)
    assert sector_constant(robot.friction) <= 0.0


def test_the_sector_bound_is_reached() -> None:
    friction = symmetric_robot().friction
    x3 = 1e-7
    assert sector_slack(friction, 1e-9, x3) / x3**2 == pytest.approx(0.0, abs=1e-5)


def test_observer_error_decays_by_the_distance_from_the_worst_gain() -> None:
    assert observer_error_decay(symmetric_robot(), 73.5) == pytest.approx(73.5 - 73.0704, abs=1e-4)
    assert observer_error_decay(asymmetric_robot(), 73.5) == pytest.approx(73.5 - 94.3668, abs=1e-3)


def test_loop_eigenvalues_are_the_oscillator_of_the_exact_solution() -> None:
    found = loop_decay(Controller(PAPER, symmetric_robot()))
    assert found.rate == pytest.approx(1.940384615, abs=1e-9)
    assert found.positive[0] == pytest.approx(complex(-1.940384615, 3.408742133), abs=1e-9)
    assert found.positive == found.negative


@given(robots(), st.floats(0.05, 2.0), st.floats(0.0, 0.6))
def test_loop_decay_is_what_a_simulated_turn_loses(robot: OneLinkRobot, n1: float, n2: float) -> None:
    """A full turn of x1' = x2, x2' = -(n1/J) x1 - ((b(x2) + n2)/J) x2, by an independent integrator."""
    found = loop_decay(Controller(Gains(n1, n2, 0.0, 0.0), robot))
    assume(found.positive[0].imag > 0.1 and found.negative[0].imag > 0.1)
    turn = math.pi / found.positive[0].imag + math.pi / found.negative[0].imag
    damping = {True: robot.friction.positive.viscous_damping, False: robot.friction.negative.viscous_damping}
    assume(found.rate * turn < 15.0)

    def motion(_: float, x: NDArray[np.float64]) -> list[float]:
        return [x[1], -(n1 * x[0] + (damping[x[1] > 0] + n2) * x[1]) / robot.inertia]

    half = math.pi / found.positive[0].imag
    first = solve_ivp(motion, (0.0, half), [-1.0, 0.0], rtol=1e-9, atol=1e-12)
    second = solve_ivp(motion, (half, turn), first.y[:, -1], rtol=1e-9, atol=1e-12)
    assert -second.y[0, -1] == pytest.approx(math.exp(-found.rate * turn), rel=1e-4, abs=1e-9)


def test_a_damped_direction_is_never_left() -> None:
    curve, heavy = StribeckCurve(0.5, 0.4, 0.07, 0.08), StribeckCurve(0.5, 0.4, 0.07, 0.9)
    robot = OneLinkRobot(0.026, StribeckFriction(heavy, curve))
    found = loop_decay(Controller(PAPER, robot))
    assert found.positive[0].imag == 0.0 < found.negative[0].imag
    assert found.rate == -found.positive[0].real < -found.positive[1].real
    product = found.positive[0] * found.positive[1]
    assert product == pytest.approx(PAPER.proportional / robot.inertia)


def test_what_is_no_number_is_refused_by_name() -> None:
    robot = symmetric_robot()
    curve = robot.friction.positive
    each_refused(critical_observer_gain, {"curve": curve}, {"inertia": (*NO_NUMBERS, -1.0, 0.0, math.inf)})
    each_refused(
        observer_error_decay, {"robot": robot}, {"observer_gain": (*NO_NUMBERS, -5.0, 0.0, math.inf)}
    )
    given = {"friction": robot.friction, "x2": 0.1, "x3": 0.1}
    bad = (*NO_ARRAYS, math.nan, [math.inf])
    each_refused(sector_slack, given, {"x2": bad, "x3": bad})
    refused(lambda: sector_slack(robot.friction, [0.1, 0.2], [0.1, 0.2, 0.3]), "x2", "x3", "shape")

"""Certificates on trajectories: the sector bound (16) over random laws, and the decay that errors obey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from compensation.certificates import certificates
from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.design_criteria import (
    critical_observer_gains,
    loop_decay,
    observer_error_decay,
    sector_constant,
    sector_slack,
)
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray
from tests.strategies import stribeck_curves

STEEP = st.just(1.0) | st.floats(1.0, 2.0)  # of a smaller beta no finite gain is enough
SPEEDS = st.lists(st.floats(-5.0, 5.0), max_size=20)
STARTS = st.tuples(
    st.integers(-1000, 1000).map(lambda x1: 1e-3 * x1),  # [rad]
    st.integers(-4000, 4000).map(lambda x2: 1e-3 * x2),  # [rad/s]
    st.integers(-4000, 4000).map(lambda x3: 1e-3 * x3),
)
DURATION = 3.0
TOLERANCE = 1e-13
ROUNDING = 1e-11  # relative to the start
ROUNDING_BETWEEN_STEPS = 1e-7  # of a Dormand-Prince step that spans many times 1/L


def certified(robot: OneLinkRobot, above: float) -> ClosedLoop:
    """The loop that knows its robot, r = 1, with an observer gain `above` [1/s] critical."""
    observer = max(critical_observer_gains(robot).worst, 0.0) + above
    return ClosedLoop(robot, Controller(Gains(0.8, 0.05, observer=observer, compensation=1.0), robot))


def rounding(loop: ClosedLoop, start: tuple[float, float, float]) -> float:
    """Error [rad/s] of a state asked for: shapes other than 1 are interpolated over stiff steps."""
    friction = loop.robot.friction
    analytic = friction.positive.stribeck_shape == friction.negative.stribeck_shape == 1.0
    return (ROUNDING if analytic else ROUNDING_BETWEEN_STEPS) * max(1.0, *map(abs, start))


def errors(loop: ClosedLoop, start: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    """Times [s] and observer errors |x3| [rad/s], events included."""
    run = simulate(loop, start, duration=DURATION, tolerance=TOLERANCE)
    return run.time, np.abs(run.state[:, 2])


@given(stribeck_curves(STEEP), stribeck_curves(STEEP), SPEEDS, SPEEDS)
@settings(max_examples=200, deadline=None)
def test_incremental_sector_bound(
    positive: StribeckCurve, negative: StribeckCurve, x2: list[float], x3: list[float]
) -> None:
    """Eq (16) for every pair of speeds, across zero and within a rounding of it."""
    friction = StribeckFriction(positive, negative)
    estimate, error = np.meshgrid([*x2, 0.0, 1e-9, -1e-9], [*x3, 1e-12, -1e-12])
    assert np.all(sector_slack(friction, estimate, error) >= -1e-14 * (1.0 + np.abs(error)))


@given(stribeck_curves(STEEP))
def test_the_sector_constant_is_the_best_one(curve: StribeckCurve) -> None:
    """Where the law falls most steeply a slightly smaller constant would be too small."""
    friction = StribeckFriction.symmetric(curve)
    beta = curve.stribeck_shape
    speed = curve.stribeck_velocity * ((beta - 1.0) / beta) ** (1.0 / beta)
    step = 1e-4 * curve.stribeck_velocity
    slack = float(sector_slack(friction, max(speed - 0.5 * step, 1e-12), step))
    assert slack <= 1e-3 * abs(sector_constant(friction)) * step**2 + 1e-15


@given(stribeck_curves(STEEP), st.floats(0.5, 150.0), STARTS)
@settings(max_examples=60, deadline=None)
def test_errors_decay_at_the_guaranteed_rate(
    curve: StribeckCurve, above: float, start: tuple[float, float, float]
) -> None:
    """Between any two instants: |e(t)| <= |e(s)| exp(-(L - L_c)(t - s)), eq (17) with V = J e^2/2."""
    loop = certified(OneLinkRobot(0.026, StribeckFriction.symmetric(curve)), above)
    time, error = errors(loop, start)
    rate = observer_error_decay(loop.robot, loop.controller.gains.observer)
    slack = rounding(loop, start)
    assert np.all(error <= error[0] * np.exp(-rate * time) + slack)
    assert np.all(error[1:] <= error[:-1] * np.exp(-rate * np.diff(time)) + slack)


@given(stribeck_curves(STEEP), stribeck_curves(STEEP), st.floats(0.5, 100.0), STARTS)
@settings(max_examples=40, deadline=None)
def test_each_directions_own_law_obeys_the_worst_directions_rate(
    positive: StribeckCurve, negative: StribeckCurve, above: float, start: tuple[float, float, float]
) -> None:
    loop = certified(OneLinkRobot(0.026, StribeckFriction(positive, negative)), above)
    time, error = errors(loop, start)
    rate = observer_error_decay(loop.robot, loop.controller.gains.observer)
    assert np.all(error <= error[0] * np.exp(-rate * time) + rounding(loop, start))


def test_the_rate_is_nearly_reached_while_the_link_creeps() -> None:
    """At small |x2|, beta = 1, the error falls by hardly more than guaranteed: the bound is no slack one."""
    loop = certified(symmetric_robot(), 5.0)
    run = simulate(loop, (-1e-6, 1e-4, 1e-5), duration=0.01, times=[0.0, 0.01], tolerance=1e-13)
    rate = -np.log(run.state[1, 2] / run.state[0, 2]) / 0.01
    assert rate == pytest.approx(5.0, rel=0.05)
    assert rate >= 5.0


def test_below_the_critical_gain_errors_grow_while_the_link_creeps() -> None:
    loop = certified(symmetric_robot(), 5.0)
    gains = replace(loop.controller.gains, observer=60.0)
    loop = replace(loop, controller=replace(loop.controller, gains=gains))
    run = simulate(loop, (-1e-6, 1e-4, 1e-7), duration=0.02, times=[0.0, 0.02], tolerance=1e-13)
    assert run.state[1, 2] > run.state[0, 2] * np.exp(0.8 * (73.07 - 60.0) * 0.02)


@given(stribeck_curves(STEEP), st.floats(5.0, 100.0), STARTS)
@settings(max_examples=30, deadline=None)
def test_what_is_certified_goes_to_the_set_point(
    curve: StribeckCurve, above: float, start: tuple[float, float, float]
) -> None:
    """The theorem's conclusion, for a law with its hypotheses (a) to (c)."""
    loop = certified(OneLinkRobot(0.026, StribeckFriction.symmetric(curve)), above)
    found = certificates(loop.robot, loop.controller, law="exact")
    (theorem,) = [statement for statement in found if statement.hypothesis.startswith("theorem")]
    assert theorem.holds
    duration = 40.0 / min(loop_decay(loop.controller).rate, above)
    run = simulate(loop, start, duration=duration, times=[duration])
    assert float(np.max(np.abs(run.state[-1]))) <= 1e-6


def test_the_mean_law_on_the_real_rig_leaves_an_error() -> None:
    """Contraction alone (L > worst) brings two motions under one x2(t) together, but not to zero."""
    robot = asymmetric_robot()
    gains = Gains(0.4, 0.02, observer=100.0, compensation=1.0)
    run = simulate(ClosedLoop(robot, Controller(gains, robot.mean())), (0.6, 0.0, 0.0), duration=20.0)
    assert float(np.max(np.abs(run.state[run.time > 15.0, 2]))) > 1e-3


@given(stribeck_curves(STEEP), stribeck_curves(STEEP), st.floats(1.0, 40.0), st.floats(0.0, 2.0))
@settings(max_examples=20, deadline=None)
def test_two_errors_under_one_estimate_approach_at_the_rate(
    positive: StribeckCurve, negative: StribeckCurve, above: float, r: float
) -> None:
    """Whatever compensates: by implicit Euler of the inclusion for v, a prescribed x2(t) = sin 5t, any r.

    A step of it shrinks the distance of two solutions by 1/(1 + h rate) at least, if errors contract so.
    """
    robot = OneLinkRobot(0.026, StribeckFriction(positive, negative))
    observer = max(critical_observer_gains(robot).worst, 0.0) + above
    rate, step = observer_error_decay(robot, observer), 0.02 / observer
    errors = [0.3, -0.2]
    for time in step * np.arange(1, 40):
        x2 = float(np.sin(5.0 * time))
        told = (positive if x2 > 0.0 else negative).total(abs(x2)) * np.sign(x2) * r
        after = [_implicit(robot, observer, step, x2, error, float(told)) for error in errors]
        apart, before = abs(after[0] - after[1]), abs(errors[0] - errors[1])
        assert apart <= before / (1.0 + step * rate) + 1e-12
        errors = after


def _implicit(
    robot: OneLinkRobot, observer: float, step: float, x2: float, error: float, told: float
) -> float:
    """e after a step of e' = -L e + (told - b v - F(v))/J, v = x2 + e."""

    def missing(v: float, curve: StribeckCurve, side: float) -> float:
        friction = side * float(curve.total(abs(v)))
        return (v - x2) * (1.0 + step * observer) - error - step * (told - friction) / robot.inertia

    positive, negative = robot.friction.positive, robot.friction.negative
    if missing(0.0, positive, 1.0) < 0.0:
        v = brentq(missing, 0.0, 1e3, args=(positive, 1.0), xtol=1e-15)
    elif missing(0.0, negative, -1.0) > 0.0:
        v = brentq(missing, -1e3, 0.0, args=(negative, -1.0), xtol=1e-15)
    else:
        v = 0.0
    return float(v) - x2

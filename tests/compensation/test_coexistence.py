"""r_max: the closed form, the search and the equilibrium sets themselves agree."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from compensation.coexistence import largest_compensation, largest_compensation_with_rest
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.strategies import controllers, robots

MEAN = Controller(Gains(0.4, 0.02, observer=40.0, compensation=1.0), symmetric_robot())


def with_r(controller: Controller, r: float) -> Controller:
    return replace(controller, gains=replace(controller.gains, compensation=r))


@pytest.mark.parametrize(
    ("observer", "r_max"), [(20.0, 1.1142679983), (40.0, 1.0349869921), (60.0, 1.0045085924)]
)
def test_symmetric_robot_below_the_critical_gain(observer: float, r_max: float) -> None:
    assert largest_compensation(symmetric_robot(), MEAN, observer_gain=observer) == pytest.approx(
        r_max, abs=1e-9
    )


@pytest.mark.parametrize("observer", [73.08, 73.5, 100.0, 1e4])
def test_above_the_critical_gain_nothing_coexists(observer: float) -> None:
    assert largest_compensation(symmetric_robot(), MEAN, observer_gain=observer) == 1.0


def test_r_max_falls_to_1_at_the_critical_gain_as_its_square() -> None:
    """R(s) has its maximum at s ~ (L_c - L), of height ~ (L_c - L)^2, for beta = 1."""
    critical = 73.070414
    near, nearer = (
        largest_compensation(symmetric_robot(), MEAN, observer_gain=critical - gap) - 1.0
        for gap in (0.4, 0.2)
    )
    assert near / nearer == pytest.approx(4.0, rel=0.02)


def test_the_real_rig_under_the_mean_law() -> None:
    """The positive segment ends at 1.0564 and the negative at 0.9436 once L is large."""
    found = largest_compensation_with_rest(
        asymmetric_robot(), replace(MEAN, gains=replace(MEAN.gains, observer=100.0))
    )
    assert (found.positive.r, found.negative.r) == pytest.approx((1.0564, 0.9436), abs=5e-5)
    assert (found.positive.x1, found.negative.x1) == (0.0, 0.0)


@given(robots(), controllers())
def test_sets_are_there_up_to_r_max_and_gone_beyond(robot: OneLinkRobot, controller: Controller) -> None:
    found = largest_compensation_with_rest(robot, controller)
    for direction, limit in (("positive", found.positive), ("negative", found.negative)):
        if math.isinf(limit.r):
            continue
        below = equilibrium_set(robot, with_r(controller, limit.r * (1.0 - 1e-6))).segments
        above = equilibrium_set(robot, with_r(controller, limit.r * (1.0 + 1e-6))).segments
        here = [segment for segment in below if segment.direction == direction]
        assert here or limit.r == 0.0
        assert not [segment for segment in above if segment.direction == direction]
        if limit.estimate > 0.0:
            assert any(s.x1_min - 1e-9 <= limit.x1 <= s.x1_max + 1e-9 for s in here)


@given(
    st.floats(0.5, 2.0),
    st.floats(0.01, 0.6),
    st.floats(0.01, 0.3),
    st.floats(0.02, 0.3),
    st.floats(1.0, 150.0),
)
def test_no_speed_holds_more(beta: float, coulomb: float, rise: float, width: float, observer: float) -> None:
    curve = StribeckCurve(coulomb + rise, coulomb, width, 0.05, beta)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    controller = Controller(replace(MEAN.gains, observer=observer), robot)
    slope = curve.viscous_damping + observer * robot.inertia

    def ratio(speed: float) -> float:
        return float((curve.static_torque - slope * speed) / curve.dry(speed))

    r_max = largest_compensation_with_rest(robot, controller).r_max
    end = curve.static_torque / slope
    grid = np.concatenate([np.geomspace(1e-9, 1.0, 400), np.linspace(0.0, 1.0, 400)]) * end
    best = max(grid, key=ratio)
    assert r_max >= ratio(best) * (1.0 - 1e-12)
    local = minimize_scalar(lambda s: -ratio(s), bounds=(0.9 * best, 1.1 * best + 1e-12), method="bounded")
    assert r_max == pytest.approx(max(1.0, ratio(best), -float(local.fun)), rel=1e-3)


@pytest.mark.parametrize("beta", [1.0 - 1e-9, 1.0 + 1e-9])
def test_closed_form_and_search_meet_at_beta_1(beta: float) -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=beta)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    found = largest_compensation(robot, replace(MEAN, model=robot), observer_gain=40.0)
    assert found == pytest.approx(1.0349869921, abs=1e-8)


def test_without_coulomb_friction() -> None:
    curve = StribeckCurve(0.3, 0.0, 0.1, 0.05)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    found = largest_compensation_with_rest(robot, replace(MEAN, model=robot)).positive
    torque = (0.05 + 40.0 * 0.026) * 0.1
    assert found.r == pytest.approx(torque / 0.3 * math.exp(0.3 / torque - 1.0), rel=1e-12)
    assert found.estimate == pytest.approx(0.1 * (0.3 / torque - 1.0), rel=1e-12)


def far_apart(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between two powers of ten, every decade as likely."""
    return st.floats(low, high).map(lambda power: float(10.0**power))


@st.composite
def extreme_loops(draw: st.DrawFn) -> tuple[OneLinkRobot, Controller]:
    """Robots that hold, and controllers that believe in, anything valid at all."""
    coulomb = draw(st.one_of(st.just(0.0), far_apart(-12.0, 3.0)))
    rise = draw(st.one_of(st.just(0.0), far_apart(-12.0, 3.0)))
    damping = draw(st.one_of(st.just(0.0), far_apart(-6.0, 3.0)))
    shape = draw(st.one_of(st.sampled_from([0.3, 1.0, 2.0, 4.0, 100.0]), st.floats(0.3, 4.0)))
    believed = StribeckCurve(coulomb + rise, coulomb, draw(far_apart(-30.0, 30.0)), damping, shape)
    held = draw(st.one_of(st.just(0.0), st.just(believed.static_torque), far_apart(-6.0, 3.0)))
    true = StribeckCurve(held, 0.5 * held, 0.1, 0.05)
    observer = draw(st.one_of(st.just(0.0), far_apart(-30.0, 30.0)))
    model = OneLinkRobot(0.026, StribeckFriction.symmetric(believed))
    return OneLinkRobot(0.03, StribeckFriction.symmetric(true)), Controller(
        Gains(0.4, 0.02, observer, 1.0), model
    )


@given(extreme_loops())
@settings(max_examples=400)
def test_any_valid_loop_is_answered_and_a_dense_search_agrees(case: tuple[OneLinkRobot, Controller]) -> None:
    """ln R on speeds dense at both ends of what the static friction holds."""
    robot, controller = case
    found = largest_compensation_with_rest(robot, controller).positive
    assert found.r >= 0.0
    assert found.estimate >= 0.0
    curve, held = controller.model.friction.positive, robot.friction.positive.static_torque
    slope = curve.viscous_damping + controller.gains.observer * controller.model.inertia
    if held == 0.0 or curve.static_torque == 0.0 or slope == 0.0:
        return
    end = math.log(held) - math.log(slope)  # ln of the largest speed
    away = np.concatenate([np.geomspace(1e-300, 1e-3, 4000), np.geomspace(1e-3, 600.0, 60_000)])  # ln(end/s)
    log_y = np.minimum(curve.stribeck_shape * (end - away - math.log(curve.stribeck_velocity)), 600.0)
    with np.errstate(divide="ignore"):
        log_dry = np.logaddexp(np.log(curve.coulomb_torque), np.log(curve.stribeck_torque) - np.exp(log_y))
    log_ratio = math.log(held) + np.log(-np.expm1(-away)) - log_dry
    best = max(float(np.max(log_ratio)), math.log(held) - math.log(curve.static_torque))
    if math.isinf(found.r):
        assert best > 700.0
    else:
        assert math.log(found.r) == pytest.approx(best, abs=1e-4)
        assert math.log(found.r) >= best - 1e-12 * (1.0 + abs(best))


@pytest.mark.parametrize(("coulomb", "beta"), [(0.0, 1.5), (0.0, 4.0), (1e-9, 2.0), (0.0, 0.5)])
def test_hardly_any_coulomb_friction_far_below_the_critical_gain(coulomb: float, beta: float) -> None:
    """e^-y fades below every number before the touch: r_max is what it is, or infinite."""
    curve = StribeckCurve(coulomb + 0.3, coulomb, 0.01, 0.05, beta)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    found = largest_compensation(robot, replace(MEAN, model=robot), observer_gain=0.01)
    if coulomb > 0.0:
        assert 0.9 * 0.3 / coulomb < found < (0.3 + coulomb) / coulomb
    elif beta == 0.5:
        assert 1.0 < found < math.inf
    else:
        assert found == math.inf


def test_an_observer_without_gain_or_damping_rests_anywhere() -> None:
    curve = replace(symmetric_robot().friction.positive, viscous_damping=0.0)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    found = largest_compensation(robot, replace(MEAN, model=robot), observer_gain=0.0)
    assert found == pytest.approx(0.5429 / 0.39385, rel=1e-12)

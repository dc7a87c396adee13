"""Inclusion (8): published reference numbers, closed forms, symmetries and independent solvers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensation.closed_loop import ClosedLoop, simulate, torque
from compensation.controller import Controller, Gains
from compensation.loop_runs import follow
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, each_refused, refused
from tests.compensation.independent_solvers import piecewise, time_stepping
from tests.strategies import controllers, robots

START = (1.0, 0.0, 0.0)


def loop(r: float, observer: float = 73.5, robot: OneLinkRobot | None = None) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot()))


def test_reference_state_and_crossing_times() -> None:
    run = simulate(loop(1.1), START, duration=20.0, times=[20.0], tolerance=1e-13)
    np.testing.assert_allclose(run.state[0], [-0.2789541574, -0.0151153949, -0.0589475742], atol=1e-9, rtol=0)
    times = [event.time for event in run.events[:4]]
    np.testing.assert_allclose(
        times, [1.8652042302, 1.8667688890, 5.0568730815, 5.0584377403], atol=1e-9, rtol=0
    )
    kinds = [event.kind for event in run.events[:4]]
    assert kinds == ["estimate reversal", "velocity reversal"] * 2
    assert run.end_reason == "time reached"


def test_reference_rest() -> None:
    run = simulate(loop(0.95), START, duration=20.0, tolerance=1e-13)
    assert run.end_reason == "equilibrium"
    assert run.end_time == pytest.approx(0.93987614, abs=5e-9)
    assert run.end_state[0] == pytest.approx(-0.108499373, abs=1e-9)
    assert run.state[-1] == pytest.approx(run.end_state, abs=1e-12)


def test_the_graze_regression_rests() -> None:
    start = (-0.07271005559331459, 0.3843279159023869, -0.47829760675166744)
    run = simulate(loop(0.9999), start, duration=20.0, tolerance=1e-13)
    assert run.end_reason == "equilibrium"
    assert run.end_state[0] == pytest.approx(-0.00110347505, abs=1e-9)


@pytest.mark.parametrize("observer", [20.0, 40.0, 73.5, 120.0])
def test_without_observer_error_r_1_is_the_linear_oscillator_bit_for_bit(observer: float) -> None:
    time = np.linspace(0.0, 20.0, 401)
    run = simulate(loop(1.0, observer), START, duration=20.0, times=time, tolerance=1e-13)
    robot = symmetric_robot()
    b = robot.friction.positive.viscous_damping
    s = -(b + 0.02) / (2 * robot.inertia)
    w = math.sqrt(0.4 / robot.inertia - s * s)
    assert (s, w) == pytest.approx((-1.940384615, 3.408742133), abs=1e-8)
    np.testing.assert_allclose(
        run.state[:, 0], np.exp(s * time) * (np.cos(w * time) - s / w * np.sin(w * time)), atol=1e-12
    )
    assert np.all(run.state[:, 2] == 0.0)


@pytest.mark.parametrize("shape", [0.7, 1.0, 1.5, 2.0])
def test_observer_error_zero_is_invariant_for_any_shape_and_asymmetric_law_known_exactly(
    shape: float,
) -> None:
    friction = asymmetric_robot().friction
    known = OneLinkRobot(
        0.026,
        StribeckFriction(
            replace(friction.positive, stribeck_shape=shape), replace(friction.negative, stribeck_shape=shape)
        ),
    )
    gains = Gains(proportional=0.4, derivative=0.02, observer=40.0, compensation=1.0)
    run = simulate(ClosedLoop(known, Controller(gains, known)), (0.7, -0.3, 0.0), duration=5.0)
    assert np.all(run.state[:, 2] == 0.0)


@given(robots(), controllers(), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
@settings(max_examples=25, deadline=None)
def test_mirrored_laws_mirror_the_motion_bit_for_bit(
    robot: OneLinkRobot, controller: Controller, start: tuple[float, float, float]
) -> None:
    def mirrored(robot: OneLinkRobot) -> OneLinkRobot:
        return replace(robot, friction=StribeckFriction(robot.friction.negative, robot.friction.positive))

    here = simulate(ClosedLoop(robot, controller), start, duration=2.0, times=[1.0, 2.0])
    there = simulate(
        ClosedLoop(mirrored(robot), replace(controller, model=mirrored(controller.model))),
        [-x for x in start],
        duration=2.0,
        times=[1.0, 2.0],
    )
    np.testing.assert_array_equal(there.state, -here.state)
    assert [event.kind for event in there.events] == [event.kind for event in here.events]


def shaped(shape: float, width: float = 0.0) -> OneLinkRobot:
    """The published robot with another Stribeck curve."""
    law = symmetric_robot().friction.positive
    law = replace(law, stribeck_shape=shape, stribeck_velocity=width or law.stribeck_velocity)
    return replace(symmetric_robot(), friction=StribeckFriction(law, law))


@pytest.mark.parametrize("observer", [20.0, 73.5, 200.0])
@pytest.mark.parametrize(
    ("shape", "r"),
    [(0.5, 0.9), (0.7, 0.9), (1.3, 0.9), (1.3, 1.1), (1.5, 0.9), (1.5, 1.1), (1.9, 0.9), (1.9, 1.1)],
)
def test_a_state_between_two_steps_is_as_true_as_the_steps(shape: float, r: float, observer: float) -> None:
    """Also where the observer's stability bounds the step. (For shapes below 1, r > 1 is ill-conditioned.)"""
    robot = shaped(shape)
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    case = ClosedLoop(robot, Controller(gains, robot))
    grid = np.linspace(0.0, 5.0, 5001)
    tolerance = 1e-10
    run = simulate(case, (1.0, 0.0, 0.1), duration=5.0, times=grid, tolerance=tolerance)
    truth = simulate(case, (1.0, 0.0, 0.1), duration=5.0, times=grid, tolerance=1e-13)
    size = float(np.max(np.abs(truth.state)))
    np.testing.assert_allclose(run.state, truth.state, rtol=0, atol=30 * tolerance * size)
    assert [event.kind for event in run.events] == [event.kind for event in truth.events]
    for event, true in zip(run.events, truth.events, strict=True):
        np.testing.assert_allclose(event.state, true.state, rtol=0, atol=10 * tolerance * size)


@pytest.mark.parametrize("tolerance", [1e-8, 1e-9, 1e-10])
@pytest.mark.parametrize("shape", [1.99, 2.0])  # by Dormand-Prince, and by series
def test_a_fast_halt_does_not_leap_across_narrow_friction_peaks(shape: float, tolerance: float) -> None:
    """Each law peaks within v_s of v = 0 or x2 = 0, where this loop spends a millisecond."""

    def law(static: float, coulomb: float, width: float, damping: float) -> StribeckCurve:
        return StribeckCurve(static, coulomb, width, damping, shape)

    believed = law(0.652, 0.453, 0.0408, 0.0766)
    robot = OneLinkRobot(
        0.0497, StribeckFriction(law(0.617, 0.34, 0.0712, 0.108), law(0.688, 0.566, 0.0104, 0.0451))
    )
    gains = Gains(proportional=1.49, derivative=0.00351, observer=148.0, compensation=1.19)
    case = ClosedLoop(robot, Controller(gains, OneLinkRobot(0.0497, StribeckFriction(believed, believed))))
    start = (3.49, -9.7, 0.893)
    run = simulate(case, start, duration=3.0, times=[3.0], tolerance=tolerance)
    truth = simulate(case, start, duration=3.0, times=[3.0], tolerance=1e-13)
    assert [event.kind for event in run.events] == [event.kind for event in truth.events]
    np.testing.assert_allclose(run.state[0], truth.state[0], rtol=0, atol=1e3 * tolerance)


def test_the_last_output_of_a_run_that_rests_is_given() -> None:
    """0.9649 s + (7.45 s - 0.9649 s) rounds below 7.45 s."""
    gains = Gains(proportional=0.4, derivative=0.02, observer=73.5, compensation=0.95)
    case = ClosedLoop(symmetric_robot(), Controller(gains, symmetric_robot()))
    for duration in (7.45, *np.random.default_rng(1).uniform(2.0, 9.0, 200).tolist()):
        run = simulate(case, (1.156, 0.0, 0.0), duration=duration, times=[duration])
        assert run.end_reason == "equilibrium"
        assert np.all(np.isfinite(run.state))


def random_loop(
    seed: int, shapes: tuple[float, ...] = (1.0, 1.0, 1.3, 2.0)
) -> tuple[ClosedLoop, tuple[float, float, float]]:
    random = np.random.default_rng(seed)

    def robot() -> OneLinkRobot:
        curves = [
            StribeckCurve(
                static_torque=float(coulomb + random.uniform(0.0, 0.3)),
                coulomb_torque=float(coulomb),
                stribeck_velocity=float(random.uniform(0.03, 0.2)),
                viscous_damping=float(random.uniform(0.0, 0.2)),
                stribeck_shape=float(random.choice(shapes)),
            )
            for coulomb in random.uniform(0.2, 0.6, 2)
        ]
        return OneLinkRobot(float(random.uniform(0.01, 0.05)), StribeckFriction(*curves))

    gains = Gains(
        proportional=float(random.uniform(0.2, 2.0)),
        derivative=float(random.uniform(0.0, 0.1)),
        observer=float(random.uniform(20.0, 120.0)),
        compensation=float(random.uniform(0.5, 1.4)),
    )
    x1, x2, x3 = map(float, random.normal(size=3))
    return ClosedLoop(robot(), Controller(gains, robot())), (x1, x2, x3)


@pytest.mark.parametrize("seed", range(8))
def test_agrees_with_scipy_from_event_to_event(seed: int) -> None:
    case, start = random_loop(seed)
    run = simulate(case, start, duration=3.0, times=[3.0], tolerance=1e-12)
    np.testing.assert_allclose(run.state[0], piecewise(case, start, 3.0), atol=1e-7)


@pytest.mark.parametrize("seed", range(8, 20))
def test_series_of_exponentials_and_bells_agree_with_scipy(seed: int) -> None:
    case, start = random_loop(seed, shapes=(1.0, 2.0, 2.0))
    run = simulate(case, start, duration=3.0, times=[3.0], tolerance=1e-12)
    np.testing.assert_allclose(run.state[0], piecewise(case, start, 3.0), atol=1e-7)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shape", [1.0, 1.3, 2.0])
def test_friction_that_returns_from_below_rounding_is_not_missed(seed: int, shape: float) -> None:
    case, start = random_loop(seed)
    law = StribeckCurve(
        static_torque=1.5,
        coulomb_torque=1.0,
        stribeck_velocity=0.1,
        viscous_damping=0.0,
        stribeck_shape=shape,
    )
    case = replace(case, robot=replace(case.robot, friction=StribeckFriction(law, law)))
    fast = (5.0 * start[0], 20.0 * start[1], 20.0 * start[2])
    run = simulate(case, fast, duration=2.0, times=[2.0], tolerance=1e-12)
    np.testing.assert_allclose(run.state[0], piecewise(case, fast, 2.0), atol=1e-6)


@pytest.mark.parametrize("seed", [2, 5])
def test_implicit_time_stepping_converges_to_it_at_first_order(seed: int) -> None:
    case, start = random_loop(seed)
    exact = simulate(case, start, duration=1.0, times=[1.0], tolerance=1e-12).state[0]
    errors = [float(np.max(np.abs(time_stepping(case, start, 1.0, f) - exact))) for f in (0.02, 0.005)]
    assert errors[1] < 5e-3
    assert errors[1] < 0.5 * errors[0]


@given(robots(), controllers(), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
@settings(max_examples=100, deadline=None)
def test_every_end_reason_is_true(
    robot: OneLinkRobot, controller: Controller, start: tuple[float, float, float]
) -> None:
    case = ClosedLoop(robot, controller)
    run = simulate(case, start, duration=5.0, times=np.linspace(0.0, 5.0, 11))
    assert run.end_reason in ("time reached", "equilibrium")
    assert np.all(np.isfinite(run.state))
    if run.end_reason == "equilibrium":
        again = simulate(case, run.end_state, duration=5.0)
        assert again.end_reason == "equilibrium"
        assert again.end_time <= 1e-6 or again.end_state[0] == pytest.approx(run.end_state[0], rel=1e-9)
        assert float(torque(case, run.end_state)[0]) <= robot.friction.positive.static_torque * (1 + 1e-9)
        assert float(torque(case, run.end_state)[0]) >= -robot.friction.negative.static_torque * (1 + 1e-9)
    else:
        halfway = simulate(case, start, duration=2.5)
        if halfway.end_reason == "time reached":
            rest = simulate(case, halfway.end_state, duration=2.5)
            tight = simulate(case, start, duration=5.0, tolerance=1e-13)
            # where L is below critical, deviations grow: their growth is measured, not guessed
            spread = float(np.max(np.abs(tight.end_state - run.end_state)))
            np.testing.assert_allclose(rest.end_state, run.end_state, atol=1e-6 + 100 * spread)


@pytest.mark.parametrize("tolerance", [1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13])
def test_a_law_steep_at_rest_gives_one_answer_at_any_tolerance(tolerance: float) -> None:
    """At t = 3.664 s the estimate passes zero at a distance of 6e-16: which side it goes on to is a rule."""
    robot = OneLinkRobot(
        0.125,
        StribeckFriction(StribeckCurve(0.5, 0.5, 0.5, 0.125), StribeckCurve(0.3125, 0.3125, 0.5, 0.125)),
    )
    model = OneLinkRobot(
        0.0625,
        StribeckFriction(StribeckCurve(0.25, 0.25, 0.5, 0.0), StribeckCurve(0.625, 0.125, 0.5, 0.0, 0.5)),
    )
    case = ClosedLoop(robot, Controller(Gains(1.5, 0.0, 69.0, 1.375), model))
    run = simulate(case, START, duration=5.0, tolerance=tolerance)
    expected = [-0.08309438, -0.40701476, -0.02292276]  # 7e-4 from where the other side leads
    np.testing.assert_allclose(run.end_state, expected, atol=1e-8 + tolerance**0.5, rtol=0)
    touches = [event for event in run.events if event.kind == "estimate touch"]
    assert all(event.state[1] == 0.0 and abs(event.time - 3.663975) < 1e-5 for event in touches)


def steep_at_rest() -> ClosedLoop:
    curves = (
        StribeckCurve(0.5286936891539086, 0.23763953395726653, 0.9387431402033812, 0.07256747300213409, 0.5),
        StribeckCurve(0.41053773608123, 0.1701705097060093, 0.07335445580999159, 0.05763675068894312, 0.7),
    )
    robot = OneLinkRobot(0.13171421188476312, StribeckFriction(*curves))
    gains = Gains(0.31411756522579815, 0.1639009763066145, 195.05679993268467, 1.5)
    return ClosedLoop(robot, Controller(gains, robot))


def test_outputs_beside_a_touch_are_given() -> None:
    start = (0.0031822651477523265, -0.001439143192609839, 0.0013835486555378589)
    run = simulate(steep_at_rest(), start, duration=40.0)
    assert run.end_reason == "time reached"
    assert np.isfinite(run.state).all()


@pytest.mark.parametrize(
    "start",
    [
        (-0.5342351163849932, 1.1958303618851656, -0.20346067749153213),
        (-0.0164117683799156, 0.0197338150416545, 0.0175433249184597),
    ],
)
def test_a_touch_is_met_once_and_then_crossed(start: tuple[float, float, float]) -> None:
    """The rate at the surface is rounding there, and may point back as often as the surface is met."""
    truth = simulate(steep_at_rest(), start, duration=40.0, times=(), tolerance=1e-13)
    for tolerance in (1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        run = simulate(steep_at_rest(), start, duration=40.0, times=(), tolerance=tolerance)
        assert run.end_reason == "time reached", tolerance
        kinds = [event.kind for event in run.events if event.kind != "estimate touch"]
        assert kinds == ["estimate reversal", "velocity reversal"] * 2, tolerance
        assert len(run.events) - len(kinds) <= 2, tolerance  # one for each crossing
        np.testing.assert_allclose(run.end_state, truth.end_state, atol=10.0 * tolerance**0.5, rtol=0)


@pytest.mark.parametrize("shape", [0.7, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("damping", [0.02, 0.5])  # swings, creeps
def test_a_motion_that_decays_below_all_numbers_is_over(shape: float, damping: float) -> None:
    """At r = 1 without an observer error: a linear oscillator, which tends to the set point for ever."""
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=shape)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    case = ClosedLoop(robot, Controller(Gains(0.4, damping, 73.5, 1.0), robot))
    rates = np.roots([0.026, curve.viscous_damping + damping, 0.4]).real
    over = 290.0 * math.log(10.0) / -rates.max()
    run = simulate(case, START, duration=2.0 * over, times=[0.9 * over, 1.1 * over, 2.0 * over])
    assert run.end_reason == "equilibrium"
    assert run.end_time == pytest.approx(over, rel=0.01)
    assert 0.0 < np.max(np.abs(run.state[0])) < 1e-250
    assert not run.state[1:].any()
    assert not run.end_state.any()


@pytest.mark.parametrize("shape", [0.5, 0.7, 0.9])
def test_laws_steep_at_rest_converge_with_the_power_beta_of_the_tolerance(shape: float) -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=shape)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    case = ClosedLoop(robot, Controller(Gains(0.4, 0.02, 120.0, 1.05), robot))
    ends = {
        tolerance: simulate(case, START, duration=10.0, times=(), tolerance=tolerance).end_state
        for tolerance in (1e-6, 1e-8, 1e-10, 1e-13)
    }
    for tolerance in (1e-6, 1e-8, 1e-10):
        np.testing.assert_allclose(ends[tolerance], ends[1e-13], atol=3.0 * tolerance**shape, rtol=0)


def test_torque_is_the_control_law() -> None:
    case = loop(1.1, robot=asymmetric_robot())
    law = symmetric_robot().friction.positive
    u = torque(case, [[0.2, 0.1, 0.0], [0.2, -0.1, 0.3], [0.2, 0.0, 0.0]])
    compensation = 1.1 * float(law.dry(0.1))
    np.testing.assert_allclose(u, [-0.082 + compensation, -0.078 - compensation, -0.08])


def test_the_set_point_is_an_equilibrium_for_any_gain() -> None:
    run = simulate(loop(1.3), (0.0, 0.0, 0.0), duration=1.0)
    assert run.end_reason == "equilibrium"
    assert np.all(run.state == 0.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"start": (1.0, math.nan, 0.0)}, "start"),
        ({"start": (1.0, 0.0)}, "start"),
        ({"duration": -1.0}, "duration"),
        ({"times": [2.0, 1.0]}, "ascend"),
        ({"times": [0.0, 9.0]}, "ascend"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
)
def test_bad_input_is_named(arguments: dict[str, object], said: str) -> None:
    given: dict[str, object] = {"start": START, "duration": 3.0, **arguments}
    with pytest.raises(ModelError, match=said):
        simulate(loop(1.0), **given)  # type: ignore[arg-type]  # wrong on purpose


def test_whole_seconds_compile_nothing_anew() -> None:
    run = simulate(loop(1.1), START, duration=2.0, tolerance=1e-6)
    compiled = len(follow.signatures)  # type: ignore[attr-defined]  # numba's own
    again = simulate(loop(1.1), START, duration=2, tolerance=np.float64(1e-6))
    assert simulate(loop(0.5), START, duration=2**70).end_reason == "equilibrium"
    assert len(follow.signatures) == compiled  # type: ignore[attr-defined]  # as above
    np.testing.assert_array_equal(again.state, run.state)


def test_what_is_no_number_is_refused_by_name() -> None:
    case = loop(1.0)
    given = {"loop": case, "start": START, "duration": 3.0, "times": None, "tolerance": 1e-9}
    bad = {
        "start": (*NO_ARRAYS, 1.0, []),
        "duration": (*NO_NUMBERS, math.inf, 0.0),
        "times": (*(value for value in NO_ARRAYS if value is not None), 1.0, [[1.0]], [math.nan], [-1.0]),
        "tolerance": (*NO_NUMBERS, 1.0, -1e-9),
    }
    each_refused(simulate, given, bad)
    refused(lambda: simulate(case, START, duration=3.0, times=[0.0, 2.0, 1.0]), "times[2] is 1 s", "ascend")
    each_refused(torque, {"loop": case}, {"states": (*NO_ARRAYS, [math.nan] * 3, [[1.0, 0.0]])})
    parts = {"robot": case.robot, "controller": case.controller}
    each_refused(ClosedLoop, parts, {"robot": (None, case.controller), "controller": (None, case.robot)})

"""1,000 random loops and starts: no NaN, no exception, no step limit, and every end reason is true."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop, simulate, torque
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from ident.simulation.trajectory import Trajectory
from tests.compensation.independent_solvers import time_stepping

CASES = 1000
DURATION = 10.0
SEED = 20040401
ANALYTIC = (1.0, 1.0)  # half of the laws have the shape that Taylor series serve

Start = tuple[float, float, float]


def random_curve(random: np.random.Generator, shape: float) -> StribeckCurve:
    coulomb = float(random.uniform(0.05, 0.8))
    return StribeckCurve(
        static_torque=coulomb + float(random.choice([0.0, random.uniform(0.0, 0.4)], p=[0.1, 0.9])),
        coulomb_torque=coulomb,
        stribeck_velocity=float(random.uniform(0.02, 0.3)),
        viscous_damping=float(random.choice([0.0, random.uniform(0.0, 0.3)], p=[0.1, 0.9])),
        stribeck_shape=shape,
    )


def random_robot(random: np.random.Generator, analytic: bool) -> OneLinkRobot:
    shapes = ANALYTIC if analytic else tuple(map(float, random.uniform(0.5, 2.0, 2)))
    curves = [random_curve(random, shape) for shape in shapes]
    return OneLinkRobot(float(random.uniform(0.01, 0.1)), StribeckFriction(*curves))


def random_case(index: int) -> tuple[ClosedLoop, Start]:
    """Robot and model of their own or alike, r in [0, 2], starts at rest, small, large or on a surface."""
    random = np.random.default_rng([SEED, index])
    analytic = bool(random.random() < 0.5)
    robot = random_robot(random, analytic)
    kind = random.integers(3)
    model = robot if kind == 0 else robot.mean() if kind == 1 else random_robot(random, analytic)
    gains = Gains(
        proportional=float(random.uniform(0.1, 2.0)),
        derivative=float(random.choice([0.0, random.uniform(0.0, 0.2)])),
        observer=float(random.uniform(5.0, 200.0)),
        compensation=float(random.choice([0.0, 1.0, random.uniform(0.0, 2.0)], p=[0.05, 0.15, 0.8])),
    )
    x1, x2, x3 = map(float, random.normal(size=3) * 10.0 ** random.uniform(-6.0, 0.5))
    place = random.integers(4)
    start = [(x1, x2, x3), (x1, 0.0, 0.0), (x1, x2, -x2), (x1, 0.0, x3)][place]
    return ClosedLoop(robot, Controller(gains, model)), start


@cache
def ran(index: int) -> Trajectory:
    case, start = random_case(index)
    return simulate(case, start, duration=DURATION, times=np.linspace(0.0, DURATION, 11))


def test_no_case_fails() -> None:
    for index in range(CASES):
        run = ran(index)
        assert run.end_reason in ("time reached", "equilibrium"), index
        assert np.all(np.isfinite(run.state)), index
        assert np.all(np.isfinite(run.end_state)), index
        assert all(np.all(np.isfinite(event.state)) for event in run.events), index
        times = [event.time for event in run.events]
        assert times == sorted(times), index


def test_an_equilibrium_is_one_when_started_from_and_in_its_set() -> None:
    resting = [index for index in range(CASES) if ran(index).end_reason == "equilibrium"]
    assert len(resting) > CASES // 5
    for index in resting:
        case, _ = random_case(index)
        run = ran(index)
        again = simulate(case, run.end_state, duration=DURATION, times=[DURATION])
        assert again.end_reason == "equilibrium", index
        assert again.end_time == 0.0 or abs(again.end_state[0] - run.end_state[0]) <= 1e-9, index
        held = case.robot.friction
        applied = float(torque(case, run.end_state)[0])
        slack = 1e-9 * (held.positive.static_torque + held.negative.static_torque)
        assert -held.negative.static_torque - slack <= applied <= held.positive.static_torque + slack, index
        rests = equilibrium_set(case.robot, case.controller)
        assert rests.contains(float(run.end_state[0]), tolerance=1e-8 * (1.0 + abs(run.end_state[0]))), index
        assert run.end_state[1] + run.end_state[2] == 0.0, index


def test_a_motion_that_is_not_over_goes_on_where_it_stopped() -> None:
    """Started again from half way it ends the same, but for what the loop itself makes of a rounding."""
    moving = [index for index in range(CASES) if ran(index).end_reason == "time reached"]
    assert len(moving) > CASES // 5
    for index in moving:
        case, start = random_case(index)
        run = ran(index)
        halfway = simulate(case, start, duration=0.5 * DURATION, times=())
        assert halfway.end_reason == "time reached", index
        rest = simulate(case, halfway.end_state, duration=0.5 * DURATION, times=())
        assert rest.end_reason == "time reached", index
        tight = simulate(case, start, duration=DURATION, times=(), tolerance=1e-13)
        spread = float(np.max(np.abs(tight.end_state - run.end_state)))
        apart = float(np.max(np.abs(rest.end_state - run.end_state)))
        size = float(np.max(np.abs(run.state)))
        assert apart <= 1e-6 * size + 100.0 * spread, index


@pytest.mark.parametrize("index", range(0, CASES, 20))
def test_an_implicit_time_stepper_agrees(index: int) -> None:
    """First order, without events: its error must fall with its step towards the solver's state."""
    case, start = random_case(index)
    duration = 0.5
    exact = simulate(case, start, duration=duration, times=[duration], tolerance=1e-12).state[0]
    size = max(float(np.max(np.abs(exact))), *map(abs, start))
    errors = [
        float(np.max(np.abs(time_stepping(case, start, duration, fineness) - exact))) / size
        for fineness in (0.02, 0.0025)
    ]
    assert errors[1] <= 1e-3 or errors[1] <= 0.5 * errors[0]
    assert errors[1] <= 0.05

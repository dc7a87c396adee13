"""Limit cycles of the closed loop and their multipliers: published numbers and finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from compensation.loop_returns import carry_for, derivative
from compensation.loop_runs import run_for
from compensation.loop_section import PATIENCE, TOLERANCE, LoopSection, with_gain
from compensation.loop_tables import mode_parameters
from compensation.orbits.periodic_orbits import Cycle, NoCycle, find_cycle
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray
from tests.bad_values import NO_WORDS, each_refused, refused


def section(r: float, observer: float = 73.5, robot: OneLinkRobot | None = None) -> LoopSection:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return LoopSection(ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot())))


def cycle_of(where: LoopSection, x1: float = 0.6) -> Cycle:
    cycle = find_cycle(where, np.array([x1, 0.0]))
    assert isinstance(cycle, Cycle)
    return cycle


def differences(where: LoopSection, point: FloatArray, step: float) -> FloatArray:
    columns = []
    for axis in np.eye(2):
        ahead = where.follow(point + step * axis, 1).points[0]
        behind = where.follow(point - step * axis, 1).points[0]
        columns.append((ahead - behind) / (2 * step))
    return np.array(columns).T


@pytest.mark.parametrize(
    ("r", "amplitude", "period"), [(1.01, 0.09852434192, 7.551833164), (1.1, 0.35368017536, 6.383337703)]
)
def test_published_cycles(r: float, amplitude: float, period: float) -> None:
    cycle = cycle_of(section(r))
    assert cycle.amplitude == pytest.approx(amplitude, abs=1e-10)
    assert cycle.period == pytest.approx(period, abs=1e-8)
    assert cycle.stable
    assert abs(cycle.multipliers[0]) < 1e-10


@pytest.mark.parametrize(
    ("r", "observer", "multiplier"),
    [(1.0001, 73.5, 3.65e-4), (1.000015, 73.5, 4.3e-3), (1.001, 120.0, 0.0923)],
)
def test_half_map_multipliers_where_they_are_not_zero(r: float, observer: float, multiplier: float) -> None:
    where = section(r, observer)
    cycle = cycle_of(where)
    slope = where.derivative(cycle.point)
    assert slope is not None
    largest = max(abs(np.linalg.eigvals(slope)))
    assert largest == pytest.approx(multiplier, rel=0.01)
    assert abs(cycle.multipliers[0]) == pytest.approx(largest**2, rel=1e-9)
    by_differences = differences(where, cycle.point, 1e-6 * cycle.amplitude)
    np.testing.assert_allclose(slope, by_differences, rtol=1e-4, atol=2e-9)


@pytest.mark.parametrize(("observer", "point"), [(73.5, (0.35, -0.004)), (40.0, (0.25, -0.02))])
def test_derivative_of_the_duration(observer: float, point: tuple[float, float]) -> None:
    where = section(1.05, observer)
    parameters = mode_parameters(where.loop.robot, where.loop.controller)
    out = np.empty((3, 2))
    derivative(
        run_for(parameters), carry_for(parameters), parameters, TOLERANCE, TOLERANCE, PATIENCE,
        np.array([*point, -point[1]]), out,
    )  # fmt: skip
    for i, axis in enumerate(1e-5 * np.eye(2)):
        later, sooner = (where.follow(np.array(point) + side * axis, 1).durations[0] for side in (1, -1))
        assert out[2, i] == pytest.approx((later - sooner) / 2e-5, rel=1e-6)


def test_derivative_of_a_turn_with_sticking_and_asymmetry() -> None:
    where = section(1.02, 60.0, asymmetric_robot())
    point = np.array([0.25, -0.01])
    slope = where.derivative(point)
    assert slope is not None
    np.testing.assert_allclose(slope, differences(where, point, 1e-7), rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("shape", [0.3, 0.5, 0.8])
def test_a_cycle_of_a_law_steep_at_rest_repeats_to_the_accuracy_of_its_map(shape: float) -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=shape)
    robot = replace(symmetric_robot(), friction=StribeckFriction.symmetric(curve))
    where = section(1.1, robot=robot)
    where = replace(where, loop=replace(where.loop, controller=replace(where.loop.controller, model=robot)))
    cycle = cycle_of(where)
    assert cycle.stable
    run = simulate(where.loop, (0.5, 0.0, 0.0), duration=40.0, times=(), tolerance=1e-13)
    halts = [abs(event.state[0]) for event in run.events if event.kind in ("stick", "velocity reversal")]
    assert halts[-1] == pytest.approx(cycle.amplitude, rel=30 * where.accuracy)


@pytest.mark.parametrize("shape", [0.8, 1.5])
def test_other_shapes_have_cycles_too(shape: float) -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=shape)
    robot = replace(symmetric_robot(), friction=StribeckFriction.symmetric(curve))
    gains = Gains(proportional=0.4, derivative=0.02, observer=100.0, compensation=1.1)
    loop = ClosedLoop(robot, Controller(gains, robot))
    cycle = cycle_of(LoopSection(loop))
    state = (float(cycle.point[0]), float(cycle.point[1]), -float(cycle.point[1]))
    run = simulate(loop, state, duration=cycle.period, times=[cycle.period], tolerance=1e-11)
    np.testing.assert_allclose(run.state[0], state, atol=1e-6)


@pytest.mark.parametrize("shapes", [(2.0, 2.0), (1.0, 2.0), (2.0, 1.0)])
def test_derivative_of_bells_is_that_of_differences(shapes: tuple[float, float]) -> None:
    """Robot and model of the same or of other shapes: series of products, and their deviations."""
    robot, model = (
        replace(
            symmetric_robot(),
            friction=StribeckFriction.symmetric(
                replace(symmetric_robot().friction.positive, stribeck_shape=shape, stribeck_velocity=0.2)
            ),
        )
        for shape in shapes
    )
    gains = Gains(proportional=0.4, derivative=0.02, observer=10.0, compensation=1.1)
    where = LoopSection(ClosedLoop(robot, Controller(gains, model)))
    assert where.by_series
    point = np.array([0.8, 0.05])
    slope = where.derivative(point)
    assert slope is not None
    assert np.max(np.abs(slope)) > 1e-3
    np.testing.assert_allclose(slope, differences(where, point, 1e-6), rtol=1e-5, atol=1e-8)


def test_published_asymmetric_cycles_and_bistability() -> None:
    robot = asymmetric_robot()
    assert cycle_of(section(1.0, robot=robot)).amplitude == pytest.approx(0.185, abs=1e-3)
    assert cycle_of(section(1.1, robot=robot)).amplitude == pytest.approx(0.391, abs=1e-3)
    for start in (0.6, -0.6, 0.1):
        assert isinstance(find_cycle(section(0.99, robot=robot), np.array([start, 0.0])), NoCycle)
        assert isinstance(find_cycle(section(1.0, robot=robot), np.array([start, 0.0])), Cycle)
    assert isinstance(find_cycle(section(1.02, robot=robot), np.array([-0.1, 0.0])), NoCycle)


def test_the_asymmetric_map_finds_the_symmetric_cycle() -> None:
    where = section(1.05)
    slightly = symmetric_robot().friction.positive
    other = replace(slightly, viscous_damping=slightly.viscous_damping * (1 + 1e-9))
    robot = replace(symmetric_robot(), friction=StribeckFriction(slightly, other))
    full = cycle_of(section(1.05, robot=robot))
    half = cycle_of(where)
    assert full.period == pytest.approx(half.period, rel=1e-7)
    assert full.x1_min == pytest.approx(half.x1_min, rel=1e-7)


def test_bursts_of_figure_6_are_the_limit_of_the_cycle() -> None:
    cycle = cycle_of(section(1.01, 40.0))
    for excess in (3e-3, 1e-3, 3e-4, 1e-4, 3e-5):
        found = find_cycle(section(1.0 + excess, 40.0), cycle.point)
        assert isinstance(found, Cycle)
        cycle = found
    assert cycle.amplitude == pytest.approx(0.2456, abs=2e-4)


def test_with_gain_changes_one_gain() -> None:
    loop = section(1.0).loop
    assert with_gain(loop, "L", 50.0).controller.gains == replace(loop.controller.gains, observer=50.0)
    assert with_gain(loop, "r", 0.9).controller.gains == replace(loop.controller.gains, compensation=0.9)


def test_a_link_that_rests_at_the_edge_of_its_set_makes_no_cycle() -> None:
    """Its halts are apart by rounding alone, or it creeps up to the edge and halts no more."""
    curve = StribeckCurve(
        0.8609818745843592, 0.5541278616511862, 0.06013112907925833, 0.1269195760520449, 2.0
    )
    robot = OneLinkRobot(0.025017337646208872, StribeckFriction.symmetric(curve))
    gains = Gains(0.34048701102624923, 0.007095031074440761, 151.5068879522968, 0.987121)
    loop = ClosedLoop(robot, Controller(gains, robot))
    rest = equilibrium_set(robot, loop.controller).x1_max
    for x1 in (0.1, -0.1, 0.6, rest, rest * (1.0 + 1e-15), rest * (1.0 + 1e-12)):
        found = find_cycle(LoopSection(loop), np.array([x1, 0.0]))
        assert found in (NoCycle("equilibrium"), NoCycle("time reached"))
        end = simulate(loop, (x1, 0.0, 0.0), duration=200.0, times=()).end_state
        assert abs(end[0]) <= rest * (1.0 + 1e-9)
        assert end[1] + end[2] == pytest.approx(0.0, abs=1e-12)


def test_a_motion_that_comes_to_rest_has_no_derivative() -> None:
    """It halts at the edge of its equilibrium set and slips on by a rounding, at no speed."""
    friction = StribeckFriction(
        StribeckCurve(0.7972744495790702, 0.5795829855197003, 0.09519846686614639, 0.08628530552394095, 2.0),
        StribeckCurve(0.9057313263566219, 0.4803894928964654, 0.0852634198728053, 0.10271982326557003, 2.0),
    )
    robot = OneLinkRobot(0.051464631691412126, friction)
    gains = Gains(0.7092780471566971, 0.07338949444526471, 70.41595121939415, 1.0122289859219886)
    where = LoopSection(ClosedLoop(robot, Controller(gains, robot.mean())))
    start = np.array([0.13472966548222248, -0.0006825877034719243])
    assert where.derivative(start) is None
    assert where.follow(start, 1).end_reason == "equilibrium"


def test_only_gains_are_changed() -> None:
    loop = section(1.0).loop
    each_refused(with_gain, {"loop": loop, "parameter": "r", "value": 1.0}, {"parameter": NO_WORDS})
    refused(lambda: with_gain(loop, "n1", 0.0), "proportional gain")

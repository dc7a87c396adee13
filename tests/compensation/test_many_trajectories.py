"""Many trajectories at once are the single ones, in any number of parts and on any map."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.loop_section import with_gain
from compensation.many_trajectories import simulate_many
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.published import symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, each_refused, refused

GAINS = Gains(proportional=0.4, derivative=0.02, observer=73.5, compensation=1.1)
LOOP = ClosedLoop(symmetric_robot(), Controller(GAINS, symmetric_robot()))
R = np.linspace(0.8, 1.2, 7)
ROWS = np.column_stack([np.full(7, 0.4), np.full(7, 0.02), np.full(7, 73.5), R])
STARTS = np.column_stack([np.linspace(1.0, -0.5, 7), np.linspace(0.0, 0.3, 7), np.zeros(7)])
TIMES = np.linspace(0.0, 5.0, 11)


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_parts_do_not_matter(parts: int) -> None:
    with ThreadPoolExecutor(2) as threads:
        many = simulate_many(
            LOOP, STARTS, duration=5.0, times=TIMES, gains=ROWS, map_parts=threads.map, parts=parts
        )
    for i, r in enumerate(R):
        alone = simulate(with_gain(LOOP, "r", float(r)), STARTS[i], duration=5.0, times=TIMES)
        np.testing.assert_array_equal(many.state[i], alone.state)
        np.testing.assert_array_equal(many.end_state[i], alone.end_state)
        assert many.end_reasons[i] == alone.end_reason
        assert many.end_time[i] == alone.end_time


@pytest.mark.parametrize("seed", range(4))
def test_side_by_side_they_are_what_they_are_alone(seed: int) -> None:
    """Lanes take other steps than a trajectory alone: the same to what a tolerance of 1e-12 leaves."""
    random = np.random.default_rng(seed)
    curves = [
        StribeckCurve(
            static_torque=coulomb + float(random.uniform(0.0, 0.3)),
            coulomb_torque=coulomb,
            stribeck_velocity=float(random.uniform(0.02, 0.2)),
            stribeck_shape=1.0,
            viscous_damping=float(random.uniform(0.0, 0.2)),
        )
        for coulomb in random.uniform(0.1, 0.6, 4).tolist()
    ]
    robot = OneLinkRobot(0.03, StribeckFriction(*curves[:2]))
    model = robot if seed == 0 else OneLinkRobot(0.05, StribeckFriction(*curves[2:]))
    loop = ClosedLoop(robot, Controller(GAINS, model))
    count = 41
    gains = np.tile(ROWS[:1], (count, 1))
    gains[:, 2], gains[:, 3] = random.uniform(20.0, 150.0, count), np.linspace(0.0, 1.2, count)
    starts = random.normal(size=(count, 3)) * [0.7, 1.0, 0.3]
    starts[:3] = [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.001, 0.2, -0.2]]
    many = simulate_many(loop, starts, duration=3.0, times=TIMES[:7], gains=gains, tolerance=1e-12, parts=2)
    for i, row in enumerate(gains.tolist()):
        itself = ClosedLoop(robot, Controller(Gains(*row), model))
        alone = simulate(itself, starts[i], duration=3.0, times=TIMES[:7], tolerance=1e-12)
        assert many.end_reasons[i] == alone.end_reason
        np.testing.assert_allclose(many.state[i], alone.state, rtol=0.0, atol=2e-9)
        np.testing.assert_allclose(many.end_state[i], alone.end_state, rtol=0.0, atol=2e-9)
        assert many.end_time[i] == pytest.approx(alone.end_time, abs=1e-8)


def test_side_by_side_no_observer_error_appears_where_there_is_none() -> None:
    starts = np.column_stack([np.linspace(-1.0, 1.0, 16), np.zeros(16), np.zeros(16)])
    gains = np.tile([0.4, 0.02, 40.0, 1.0], (16, 1))
    many = simulate_many(LOOP, starts, duration=5.0, times=TIMES, gains=gains)
    assert np.all(many.state[:, :, 2] == 0.0)


def test_side_by_side_what_decays_below_all_numbers_is_over() -> None:
    starts = np.column_stack([np.linspace(-1.0, 1.0, 16), np.zeros(16), np.zeros(16)])
    gains = np.tile([0.4, 0.5, 40.0, 1.0], (16, 1))
    many = simulate_many(LOOP, starts, duration=2000.0, times=[2000.0], gains=gains)
    assert set(many.end_reasons) == {"equilibrium"}
    assert not many.state.any()


def test_one_controller_and_another_shape() -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=1.5)
    robot = replace(symmetric_robot(), friction=StribeckFriction.symmetric(curve))
    loop = ClosedLoop(robot, Controller(GAINS, robot))
    many = simulate_many(loop, STARTS, duration=2.0)
    assert many.state.shape == (7, 0, 3)
    alone = simulate(loop, STARTS[3], duration=2.0, times=())
    np.testing.assert_array_equal(many.end_state[3], alone.end_state)


def test_bad_input_is_named() -> None:
    with pytest.raises(ModelError, match=r"\(n, 3\)"):
        simulate_many(LOOP, [1.0, 0.0, 0.0], duration=1.0)
    with pytest.raises(ModelError, match="each of 7 starts"):
        simulate_many(LOOP, STARTS, duration=1.0, gains=ROWS[:3])
    with pytest.raises(ModelError, match="n1 > 0"):
        simulate_many(LOOP, STARTS, duration=1.0, gains=0.0 * ROWS)
    with pytest.raises(ModelError, match="tolerance"):
        simulate_many(LOOP, STARTS, duration=1.0, tolerance=0.0)


def test_what_is_no_number_is_refused_by_name() -> None:
    given = {"loop": LOOP, "starts": STARTS, "duration": 1.0, "times": (), "gains": ROWS}
    bad = {
        "starts": NO_ARRAYS,
        "duration": (*NO_NUMBERS, np.inf, 0.0),
        "times": (*NO_ARRAYS, [np.nan], [1.0, 0.5], [2.0]),
        "gains": (*(value for value in NO_ARRAYS if value is not None), ROWS[:, :3]),
        "tolerance": (*NO_NUMBERS, 1.0),
        "parts": (0, -1, 1.5, "1", None, np.nan),
    }
    each_refused(simulate_many, given, bad)


def test_more_parts_than_trajectories_are_as_many() -> None:
    alone = simulate_many(LOOP, STARTS, duration=1, gains=ROWS)
    cut = simulate_many(LOOP, STARTS, duration=1.0, gains=ROWS, parts=2**70)
    np.testing.assert_allclose(cut.end_state, alone.end_state, atol=1e-9)


@pytest.mark.parametrize(
    ("column", "value", "name"),
    [(0, 0.0, "proportional"), (1, -1.0, "derivative"), (2, np.nan, "observer"), (3, np.inf, "compensation")],
)
def test_the_trajectory_and_its_gain_are_named(column: int, value: float, name: str) -> None:
    rows, starts = ROWS.copy(), STARTS.copy()
    rows[4, column] = value
    refused(lambda: simulate_many(LOOP, STARTS, duration=1.0, gains=rows), "gains[4]", f"{name} gain is")
    starts[5, 1] = np.nan
    refused(lambda: simulate_many(LOOP, starts, duration=1.0), "starts[5]")

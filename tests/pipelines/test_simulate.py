"""One closed-loop run, continuous and sampled, and its file."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from compensation.controller import Controller, Gains
from compensation.sampled_loop import Sampling, run_sampled
from ident.model.friction import StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from pipelines.exit_status import RefusalError, UsageError
from pipelines.results.folder import Owner, ResultFolder
from pipelines.simulate import (
    HEADER,
    SimulatedRun,
    parse_format,
    parse_start,
    simulate_loop,
    write_trajectory,
)


def controller(r: float = 1.1, L: float = 73.5) -> Controller:
    return Controller(Gains(0.4, 0.02, observer=L, compensation=r), symmetric_robot())


def continuous(r: float, duration: float) -> SimulatedRun:
    return simulate_loop(symmetric_robot(), controller(r), start=(1.0, 0.0, 0.0), duration=duration)


def read(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8", newline="") as text:
        rows = list(csv.reader(text))
    return rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])


def test_the_reference_state_after_twenty_seconds(tmp_path: Path) -> None:
    run = continuous(1.1, 20.0)
    path = write_trajectory(run, ResultFolder(tmp_path, Owner("paper")))
    header, table = read(path)
    assert tuple(header) == HEADER == ("t", "x1", "x2", "x3", "v", "u")
    assert table[-1, 0] == 20.0
    assert table[-1, 1:4] == pytest.approx([-0.2789541574, -0.0151153949, -0.0589475742], abs=1e-8)
    assert np.array_equal(table[:, 4], table[:, 2] + table[:, 3])
    assert np.array_equal(table[:, 1:4], run.state)


def test_rest_is_rest() -> None:
    run = continuous(0.95, 3.0)
    resting = run.time > 0.94
    assert np.all(run.velocity[resting] == 0.0)
    assert run.state[-1, 0] == pytest.approx(-0.108499373, abs=1e-8)
    assert np.all(np.abs(run.torque[resting]) <= symmetric_robot().friction.positive.static_torque)


def test_exact_compensation_is_the_linear_oscillator() -> None:
    run = continuous(1.0, 3.0)
    s, w = -1.940384615384615, 3.408742133
    expected = np.exp(s * run.time) * (np.cos(w * run.time) - s / w * np.sin(w * run.time))
    assert run.state[:, 0] == pytest.approx(expected, abs=1e-8)
    assert np.all(run.state[:, 2] == 0.0)


def test_the_torque_drives_the_robot() -> None:
    """J v' = u - b v - F(v) where the link slips, by central differences."""
    run = continuous(1.1, 2.0)
    robot = symmetric_robot()
    curve = robot.friction.positive
    v = run.velocity
    acceleration = np.gradient(v, run.time)
    friction = np.sign(v) * curve.total(np.abs(v))
    left = robot.inertia * acceleration + friction
    smooth = (np.abs(v) > 0.05) & (np.abs(run.state[:, 1]) > 0.05)
    assert smooth.sum() > 500
    assert left[smooth][5:-5] == pytest.approx(run.torque[smooth][5:-5], abs=2e-3)


def test_a_sampled_run_ends_at_its_duration() -> None:
    sampling = Sampling(0.001, 2 * math.pi / 2**18)
    robot = asymmetric_robot()
    whole = simulate_loop(robot, controller(), start=(0.6, 0.0, 0.0), duration=2.0, sampling=sampling)
    between = simulate_loop(robot, controller(), start=(0.6, 0.0, 0.0), duration=2.0004, sampling=sampling)
    assert (whole.time[-1], between.time[-1]) == (2.0, 2.0004)
    assert np.array_equal(between.state[:-1], whole.state)
    plain = run_sampled(robot, controller(), sampling, start=(0.6, 0.0), duration=2.0)
    assert np.array_equal(whole.state[:, 0], plain.position)
    assert np.array_equal(whole.torque, plain.torque)
    assert whole.velocity == pytest.approx(plain.velocity, abs=1e-15)
    drift = between.state[-1, 0] - between.state[-2, 0]
    assert drift == pytest.approx(0.0004 * between.velocity[-2], rel=0.05)


def test_a_fast_loop_without_counts_comes_near_the_inclusion() -> None:
    start, duration = (1.0, 0.0, 0.0), 1.5
    sampled = simulate_loop(
        symmetric_robot(), controller(), start=start, duration=duration, sampling=Sampling(2e-5)
    )
    assert sampled.state[-1, 0] == pytest.approx(continuous(1.1, duration).state[-1, 0], abs=2e-3)


def test_joint_states_can_be_read_back(tmp_path: Path) -> None:
    run = continuous(1.1, 0.5)
    path = write_trajectory(run, ResultFolder(tmp_path, Owner("paper")), form="mcap")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = [message for *_, message in reader.iter_decoded_messages(topics=["/joint_states"])]
    assert [message.position[0] for message in messages] == run.state[:, 0].tolist()
    assert [message.effort[0] for message in messages] == run.torque.tolist()


def test_a_parquet_table_reads_back_bit_for_bit(tmp_path: Path) -> None:
    run = continuous(1.1, 2.0)
    path = write_trajectory(run, ResultFolder(tmp_path, Owner("paper")), form="parquet")
    frame = pd.read_parquet(path)
    assert list(frame.columns) == list(HEADER)
    assert frame["x3"].to_numpy().tolist() == run.state[:, 2].tolist()
    schema = pq.read_schema(path)
    assert schema.metadata[b"simulated"] == b"true"
    assert [schema.field(name).metadata[b"unit"] for name in ("t", "x1", "v", "u")] == [
        b"s",
        b"rad",
        b"rad/s",
        b"N m",
    ]


@pytest.mark.parametrize("text", ["1,0", "1,0,0,0", "a,b,c", "1,0,nan", "", "1;0;0"])
def test_a_start_is_three_numbers(text: str) -> None:
    with pytest.raises(UsageError, match="three finite numbers"):
        parse_start(text)


def test_words_of_the_command_line() -> None:
    assert parse_start("1,-2.5e-1, 0") == (1.0, -0.25, 0.0)
    assert parse_format("csv") == "csv"
    assert parse_format("mcap") == "mcap"
    assert parse_format("parquet") == "parquet"
    with pytest.raises(UsageError, match="'xlsx' is no format"):
        parse_format("xlsx")


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan, math.inf])
def test_a_duration_is_positive(duration: float) -> None:
    with pytest.raises(UsageError, match="--duration"):
        continuous(1.0, duration)


def test_what_a_sampled_loop_cannot_do() -> None:
    with pytest.raises(UsageError, match="x2 = 0"):
        simulate_loop(
            symmetric_robot(), controller(), start=(1.0, 0.1, 0.0), duration=1.0, sampling=Sampling(0.001)
        )
    with pytest.raises(UsageError, match="samples"):
        simulate_loop(
            symmetric_robot(), controller(), start=(1.0, 0.0, 0.0), duration=1e9, sampling=Sampling(0.001)
        )


def test_a_controller_that_runs_away_is_refused_with_its_reason() -> None:
    robot = symmetric_robot()
    fast = Controller(Gains(0.004, 0.02, observer=1000.0, compensation=0.9), robot)
    with pytest.raises(RefusalError, match=r"runs away .*L h = 10;.*Sample faster"):
        simulate_loop(robot, fast, start=(0.6, 0, 0), duration=30.0, sampling=Sampling(1e-2))


def test_gains_that_no_rig_has_are_not_blamed_on_the_duration() -> None:
    robot = symmetric_robot()
    stiff = Controller(Gains(1e100, 0.02, observer=73.5, compensation=1.0), robot)
    with pytest.raises(RefusalError, match="Give gains that a rig can have"):
        simulate_loop(robot, stiff, start=(1.0, 0, 0), duration=20.0)


@pytest.mark.parametrize("shape", [1.0, 1.5])
def test_a_motion_that_decays_below_all_numbers_ends_at_the_set_point(shape: float) -> None:
    law = replace(symmetric_robot().friction.positive, viscous_damping=0.3, stribeck_shape=shape)
    robot = replace(symmetric_robot(), friction=StribeckFriction.symmetric(law))
    exact = Controller(Gains(1.0, 0.05, observer=73.5, compensation=1.0), robot)
    run = simulate_loop(robot, exact, start=(1.0, 0.0, 0.0), duration=250.0)
    assert run.time[-1] == 250.0
    np.testing.assert_array_equal(run.state[-1], 0.0)
    assert np.all(np.isfinite(run.state))
    assert run.end == "equilibrium"

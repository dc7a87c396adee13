"""simulate: one run of the closed loop, as numbers over time.

`trajectory.csv` has the columns `t,x1,x2,x3,v,u` in SI: x1 = q, x2 the velocity estimate, x3 the observer
error, v = x2 + x3 the velocity, u the torque on the link. Every number reads back bit for bit, and the last
row stands at t = T.

Without a sample period the run is a solution of inclusion (8), event by event. With one it is the loop as a
rig runs it: rows at the sampling instants, the estimate and the torque held in between, and a last row at T.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, get_args

import numpy as np

from compensation.closed_loop import ClosedLoop, simulate, torque
from compensation.controller import Controller
from compensation.sampled_loop import Sampling, run_sampled
from data.mcap.writer import write_mcap
from data.parquet.writer import write_parquet
from data.recording import Axis, FloatArray
from data.units import Quantity, si_word
from ident.model.numbers import LARGEST, is_quantity
from ident.model.robot import OneLinkRobot
from ident.response import respond
from pipelines.exit_status import RefusalError, UsageError
from pipelines.results.folder import ResultFolder

Format = Literal["csv", "mcap", "parquet"]
FORMATS: Final[tuple[Format, ...]] = get_args(Format)
HEADER: Final = ("t", "x1", "x2", "x3", "v", "u")
_MEANS: Final[tuple[Quantity, ...]] = ("time", "position", "velocity", "velocity", "velocity", "torque")
OUTPUT_STEP: Final = 1e-3  # [s] between the rows of a continuous run
MOST_ROWS: Final = 200_000  # of a continuous run
MOST_TURNS: Final = 1e4  # that a continuous run may take before its gains are to blame
MOST_SAMPLES: Final = 5_000_000  # of a sampled run
_START_WORDS: Final = 3


@dataclass(frozen=True)
class SimulatedRun:
    """One run; every array has a row a moment."""

    time: FloatArray  # (n,) [s], from 0 to the duration
    state: FloatArray  # (n, 3): x1 [rad], x2 and x3 [rad/s]
    torque: FloatArray  # (n,) [N m]
    loop: str  # which loop it is, in words
    end: str  # how it ended, in words

    @property
    def velocity(self) -> FloatArray:
        """v = x2 + x3 (n,) [rad/s]."""
        return np.asarray(self.state[:, 1] + self.state[:, 2])


def parse_start(text: str) -> tuple[float, float, float]:
    """`x1,x2,x3` as the command line gives it [rad, rad/s, rad/s]; raises `UsageError`."""
    words = text.split(",")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != _START_WORDS or not all(map(is_quantity, values)):
        raise UsageError(
            f"--x0 is {text!r}: give three finite numbers up to {LARGEST:g}, x1,x2,x3 [rad, rad/s, rad/s]"
        )
    return values[0], values[1], values[2]


def parse_format(word: str) -> Format:
    """The format of the trajectory; raises `UsageError`."""
    for form in FORMATS:
        if word == form:
            return form
    raise UsageError(f"--format: {word!r} is no format; give {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")


def simulate_loop(
    robot: OneLinkRobot,
    controller: Controller,
    *,
    start: tuple[float, float, float],
    duration: float,
    sampling: Sampling | None = None,
    axis: Axis = "rotary",
) -> SimulatedRun:
    """One run from `start` (x1, x2, x3) for `duration` [s]; raises `UsageError` for what cannot be run."""
    if not (math.isfinite(duration) and duration > 0):
        raise UsageError(f"--duration is {duration:g}: give a finite number of seconds > 0")
    if sampling is None:
        return _continuous(robot, controller, start, duration)
    return _sampled(robot, controller, sampling, start=start, duration=duration, axis=axis)


def write_trajectory(
    run: SimulatedRun, folder: ResultFolder, *, form: Format = "csv", axis: Axis = "rotary"
) -> Path:
    """The trajectory, simulated as it is: a table as CSV or Parquet, or joint states and x2 as MCAP."""
    table = np.column_stack((run.time, run.state, run.velocity, run.torque))
    if form == "csv":
        return folder.write_csv("trajectory.csv", HEADER, table.tolist())
    labels = {"simulated": "true", "loop": run.loop}
    if form == "parquet":
        columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(HEADER)}
        units = {name: si_word(means, axis) for name, means in zip(HEADER, _MEANS, strict=True)}
        return folder.write_by(
            "trajectory.parquet",
            lambda path: write_parquet(path, columns=columns, units=units, metadata=labels),
        )
    return folder.write_by(
        "trajectory.mcap",
        lambda path: write_mcap(
            path,
            time=run.time,
            position=np.ascontiguousarray(run.state[:, 0]),
            velocity=run.velocity,
            effort=run.torque,
            metadata=labels,
            extra={"/velocity_estimate": np.ascontiguousarray(run.state[:, 1])},
        ),
    )


def _continuous(
    robot: OneLinkRobot, controller: Controller, start: tuple[float, float, float], duration: float
) -> SimulatedRun:
    rows = min(math.ceil(duration / OUTPUT_STEP), MOST_ROWS) + 1
    loop = ClosedLoop(robot, controller)
    found = simulate(loop, start, times=np.linspace(0.0, duration, rows), duration=duration)
    missing = ~np.isfinite(found.state).all(axis=1)
    if missing.any():
        raise RefusalError(
            f"the run stopped at t = {found.end_time:.6g} s of {duration:g} s ({found.end_reason}): nothing "
            f"is written. {_remedy(robot, controller, found.end_time)}"
        )
    return SimulatedRun(
        time=found.time,
        state=found.state,
        torque=torque(loop, found.state),
        loop="continuous: inclusion (8)",
        end=found.end_reason,
    )


def _remedy(robot: OneLinkRobot, controller: Controller, reached: float) -> str:
    """What to change: the time, if the loop turned many times in what was reached, else the gains."""
    turns = reached * math.sqrt(controller.gains.proportional / robot.inertia) / (2.0 * math.pi)
    if reached > 0.0 and turns < MOST_TURNS:
        return f"Ask for a --duration below {reached:.3g} s"
    return (
        "The loop is too fast to be followed: its turns last "
        f"{2.0 * math.pi * math.sqrt(robot.inertia / controller.gains.proportional):.3g} s. Give gains that "
        "a rig can have"
    )


def _sampled(
    robot: OneLinkRobot,
    controller: Controller,
    sampling: Sampling,
    *,
    start: tuple[float, float, float],
    duration: float,
    axis: Axis,
) -> SimulatedRun:
    if start[1] != 0.0:
        raise UsageError(
            f"--x0 has x2 = {start[1]:g}: a sampled controller starts with the estimate x2 = 0 (the velocity "
            "is then x3). Give 0, or --sample-period 0 for the continuous loop"
        )
    if duration / sampling.period > MOST_SAMPLES:
        raise UsageError(
            f"--duration {duration:g} at a sample period of {sampling.period:g} s is more than "
            f"{MOST_SAMPLES:,} samples: ask for less"
        )
    run = run_sampled(robot, controller, sampling, start=(start[0], start[2]), duration=duration)
    if run.end == "runs away":
        until, product = run.time.size * sampling.period, controller.gains.observer * sampling.period
        raise RefusalError(
            f"the sampled controller is unstable: its estimate runs away at t = {until:.4g} s "
            f"(L h = {product:.3g}; Euler's rule diverges from 2 on): "
            "nothing is written. Sample faster, or lower the observer or proportional gain"
        )
    time, position, velocity = run.time, run.position, run.velocity
    estimate, held = run.estimate, run.torque
    rest = duration - float(time[-1])
    if rest <= 1e-9 * sampling.period:
        time = np.append(time[:-1], duration)
    else:
        q, v = respond(robot, start=(float(position[-1]), float(velocity[-1])), torque=held[-1:], period=rest)
        time = np.append(time, duration)
        position, velocity = np.append(position, q[-1]), np.append(velocity, v[-1])
        estimate, held = np.append(estimate, estimate[-1]), np.append(held, held[-1])
    unit = "rad" if axis == "rotary" else "m"
    counts = (
        f"encoder counts of {sampling.resolution:.6g} {unit}" if sampling.resolution else "exact positions"
    )
    return SimulatedRun(
        time=time,
        state=np.column_stack((position, estimate, velocity - estimate)),
        torque=held,
        loop=f"sampled every {sampling.period:g} s, {counts}, torque held",
        end="the duration was reached",
    )

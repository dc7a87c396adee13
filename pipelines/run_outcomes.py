"""What becomes of a set-point run: as it was recorded, and as three predictions have it from the same start.

The run starts at rest at its first position, x1(0) = q(0) - q_r, with the observer at v_hat = 0.

- *predicted*: the robot in the loop as it ran: sampled, rounded to encoder counts, held, delayed;
- *ideal*: the same robot in the continuous loop, inclusion (8);
- *symmetric*: the robot with the means of its two directions in that continuous loop, as the paper has it.

A prediction is watched for as long as the run was recorded, at least for ten times the slowest time constant
of the loop without observer error (but no more than ten records), and longer where that leaves the verdict
open: near the onset a cycle takes its time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.design_criteria import loop_decay
from compensation.orbits.steady_state import SteadyState, classify
from compensation.sampled_loop import Map, Sampling, run_many
from data.recording import FloatArray
from ident.model.robot import OneLinkRobot
from pipelines.recordings import SetPointRun

TIME_CONSTANTS = 10.0  # of the slowest motion that a prediction waits for
LONGEST = 10.0  # times the record, at most
WATCHED_AGAIN = (1.0, 4.0, 16.0)  # times the first duration, while the verdict is open
MOST_ROWS = 10_001  # of a continuous run: its cycles last for seconds, and nothing in it is sampled


@dataclass(frozen=True)
class Outcome:
    """Where a run ends up; x1 is the position less the reference."""

    verdict: str | None  # "equilibrium", "limit_cycle" or "undecided"; None: nothing could be predicted
    x1_min: float | None  # [rad] at rest, or over a period
    x1_max: float | None  # [rad]
    amplitude: float | None  # max|x1| over a period [rad]; None at rest
    period: float | None  # [s]
    why: str | None = None  # what is missing, and why

    @property
    def cycles(self) -> bool:
        """Whether this is a limit cycle."""
        return self.verdict == "limit_cycle"


@dataclass(frozen=True)
class LoopAsRun:
    """A robot under a controller as a run had them, and from where."""

    robot: OneLinkRobot
    controller: Controller
    sampling: Sampling
    position: float  # q(0) [rad], at rest
    reference: float  # q_r [rad]
    duration: float  # of the record [s]

    def at(self, compensation_gain: float) -> LoopAsRun:
        """The same with another r."""
        gains = replace(self.controller.gains, compensation=compensation_gain)
        return replace(self, controller=replace(self.controller, gains=gains))

    def moved_by(self, robot: OneLinkRobot) -> LoopAsRun:
        """The same controller on another robot."""
        return replace(self, robot=robot)

    @property
    def start(self) -> float:
        """x1(0) [rad]."""
        return self.position - self.reference

    @property
    def watched(self) -> float:
        """How long a prediction runs [s]."""
        rate = loop_decay(self.controller).rate
        needed = TIME_CONSTANTS / rate if rate > 0 else 0.0
        return min(max(self.duration, needed), LONGEST * self.duration)


class Verdicts(Protocol):
    """A way to predict: outcomes of many loops, in order."""

    def __call__(self, loops: Sequence[LoopAsRun], /) -> tuple[Outcome, ...]:
        """The outcome of each."""


def unpredicted(why: str) -> Outcome:
    """No prediction, and why."""
    return Outcome(None, None, None, None, None, why)


def as_run(run: SetPointRun, robot: OneLinkRobot, model: OneLinkRobot) -> LoopAsRun:
    """The loop of a recorded run, with `robot` in it and `model` in its controller."""
    recording, setting = run.recording, run.set_point
    gains = Gains(
        proportional=setting.proportional_gain,
        derivative=setting.derivative_gain,
        observer=setting.observer_gain,
        compensation=setting.compensation_gain,
    )
    sampling = Sampling(
        period=setting.sample_period or recording.sample_period,
        resolution=recording.resolution or 0.0,
        observer_update=setting.observer_update,
        delay=setting.delay,
        torque_limit=math.inf if recording.torque_limit is None else recording.torque_limit,
    )
    position = float(recording.position[0])
    reference = position - float(position_error(run)[0])
    return LoopAsRun(robot, Controller(gains, model), sampling, position, reference, recording.duration)


def position_error(run: SetPointRun) -> FloatArray:
    """x1 = q - q_r along the record, (n,) [rad]."""
    recording = run.recording
    if recording.reference is None:
        return recording.position
    return recording.position - recording.reference


def recorded_outcome(run: SetPointRun) -> Outcome:
    """What the record shows."""
    x1 = position_error(run)
    time = run.recording.time
    return _outcome(classify(time, x1, resolution=run.recording.resolution or 0.0), time, x1)


def sampled_outcomes(loops: Sequence[LoopAsRun], *, map: Map = map) -> tuple[Outcome, ...]:
    """Outcomes in the loop as it ran; loops that share their sampling are run together.

    What the time of the record leaves undecided is watched for longer.
    """
    found: dict[int, Outcome] = {}
    open_ones = list(range(len(loops)))
    for factor in WATCHED_AGAIN:
        batches: dict[tuple[Sampling, float, float], list[int]] = {}
        for number in open_ones:
            loop = loops[number]
            batches.setdefault((loop.sampling, factor * loop.watched, loop.reference), []).append(number)
        for (sampling, duration, reference), members in batches.items():
            positions = run_many(
                [loops[i].robot for i in members],
                [loops[i].controller for i in members],
                sampling,
                starts=[(loops[i].position, 0.0) for i in members],
                duration=duration,
                reference=reference,
                map=map,
            )
            time = np.arange(positions.shape[1], dtype=np.float64) * sampling.period
            for i, position in zip(members, positions, strict=True):
                x1 = position - reference
                found[i] = _outcome(classify(time, x1, resolution=sampling.resolution), time, x1)
        open_ones = [number for number in open_ones if found[number].verdict == "undecided"]
    return tuple(found[i] for i in range(len(loops)))


def ideal_outcomes(loops: Sequence[LoopAsRun]) -> tuple[Outcome, ...]:
    """Outcomes in the continuous loop, inclusion (8); watched for longer where that decides."""
    return tuple(_ideal(loop) for loop in loops)


def _ideal(loop: LoopAsRun) -> Outcome:
    for factor in WATCHED_AGAIN:
        duration = factor * loop.watched
        rows = min(math.floor(duration / loop.sampling.period) + 1, MOST_ROWS)
        trajectory = simulate(
            ClosedLoop(loop.robot, loop.controller),
            (loop.start, 0.0, 0.0),
            times=np.linspace(0.0, duration, rows),
            duration=duration,
        )
        x1 = trajectory.state[:, 0]
        found = _outcome(classify(trajectory.time, x1), trajectory.time, x1)
        if found.verdict != "undecided":
            break
    return found


def _outcome(steady: SteadyState, time: FloatArray, x1: FloatArray) -> Outcome:
    if steady.verdict == "equilibrium":
        rest = steady.position_error
        return Outcome("equilibrium", rest, rest, None, None, steady.why)
    if steady.verdict != "limit_cycle" or steady.period is None:
        return Outcome(steady.verdict, None, None, steady.amplitude, steady.period, steady.why)
    last = x1[time >= time[-1] - steady.period]
    return Outcome(
        "limit_cycle", float(last.min()), float(last.max()), steady.amplitude, steady.period, steady.why
    )

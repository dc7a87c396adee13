"""What becomes of a set-point run: as it was recorded, and as three predictions have it from the same start.

The run starts at rest at its first position, x1(0) = q(0) - q_r, with the observer at v_hat = 0.

- *predicted*: the robot in the loop as it ran: sampled, rounded to encoder counts, held, delayed;
- *ideal*: the same robot in the continuous loop, inclusion (8);
- *symmetric*: the robot with the means of its two directions in that continuous loop, as the paper has it.

A prediction is watched for as long as the run was recorded, at least for ten times the slowest time constant
of the loop without observer error (but no more than ten records), and longer where that leaves the verdict
open: near the onset a cycle takes its time. It is not watched for ever: a sampled run has a number of samples
(`compensation.sampled_ends`), a continuous one a number of turns of the loop, and a search for an onset has a
budget of samples for all its runs. What these leave open is undecided, and says so.
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
from compensation.sampled_ends import SampledEnd, sampled_end
from compensation.sampled_loop import Map, Sampling
from data.recording import FloatArray
from ident.model.robot import OneLinkRobot
from pipelines.recordings import SetPointRun

TIME_CONSTANTS = 10.0  # of the slowest motion that a prediction waits for
LONGEST = 10.0  # times the record, at most
WATCHED_AGAIN = (1.0, 4.0, 16.0)  # times the first duration, while the verdict is open
MOST_TURNS = 250.0  # of a continuous run, 2 pi sqrt(J/n1) each
ROWS = 10_001  # of a continuous run: at least 40 a turn


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


SPENT = "the samples that this search may take are spent: the loop is slow to decide, or sampled fast"


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


@dataclass
class Budget:
    """Samples that the runs of a search may still take. It counts samples and no seconds: results repeat."""

    left: int

    def take(self, samples: int) -> None:
        """Pay for runs that were made."""
        self.left -= samples


def sampled_outcomes(
    loops: Sequence[LoopAsRun], *, map: Map = map, budget: Budget | None = None
) -> tuple[Outcome, ...]:
    """Outcomes in the loop as it ran; once a `budget` is spent, all that is asked after is undecided."""
    if budget is not None and budget.left <= 0:
        return tuple(Outcome("undecided", None, None, None, None, SPENT) for _ in loops)
    ends = tuple(map(_sampled, loops))
    if budget is not None:
        budget.take(sum(end.samples for end in ends))
    return tuple(
        Outcome(
            end.state.verdict, end.x1_min, end.x1_max, end.state.amplitude, end.state.period, end.state.why
        )
        for end in ends
    )


def _sampled(loop: LoopAsRun) -> SampledEnd:
    return sampled_end(
        loop.robot,
        loop.controller,
        loop.sampling,
        start=loop.position,
        reference=loop.reference,
        stretches=[factor * loop.watched for factor in WATCHED_AGAIN],
    )


def ideal_outcomes(loops: Sequence[LoopAsRun]) -> tuple[Outcome, ...]:
    """Outcomes in the continuous loop, inclusion (8); watched for longer where that decides."""
    return tuple(_ideal(loop) for loop in loops)


def _ideal(loop: LoopAsRun) -> Outcome:
    turn = 2.0 * math.pi * math.sqrt(loop.robot.inertia / loop.controller.gains.proportional)
    durations = [min(factor * loop.watched, MOST_TURNS * turn) for factor in WATCHED_AGAIN]
    for duration in dict.fromkeys(durations):
        trajectory = simulate(
            ClosedLoop(loop.robot, loop.controller),
            (loop.start, 0.0, 0.0),
            times=np.linspace(0.0, duration, ROWS),
            duration=duration,
        )
        if trajectory.end_reason == "equilibrium":
            rest = float(trajectory.end_state[0])
            why = f"rests for good after {trajectory.end_time:.3g} s"
            return Outcome("equilibrium", rest, rest, None, None, why)
        x1 = trajectory.state[:, 0]
        if not np.all(np.isfinite(x1)):
            why = f"the exact solution stopped after {trajectory.end_time:.4g} s: {trajectory.end_reason}"
            return Outcome("undecided", None, None, None, None, why)
        found = _outcome(classify(trajectory.time, x1), trajectory.time, x1)
        if found.verdict != "undecided":
            return found
    return replace(found, why=f"{found.why}; watched for {durations[-1]:.4g} s and no longer")


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

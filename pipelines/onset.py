"""The onset of limit cycling: the smallest r from which a loop cycles, for a start and a set of gains.

An asymmetric rig is bistable, so an onset belongs to a start. Runs are grouped by how their controller was
set and by their start (starts closer to each other than a twentieth of the largest are one start, at their
median). Recorded, an onset is a bracket: the largest resting r below the smallest cycling r, and that r;
undecided runs between widen it, and rests above it are listed as reversals. Predicted, it is the smallest r
whose loop cycles from the group's start, by a scan of r upwards and bisection of the step on which it first
does. The interval of the prediction holds 95 % of the onsets of robots that are drawn from the fit's joint
distribution, each found by bisection around the fitted robot's own.

Whether a loop cycles may stay undecided (`pipelines.run_outcomes` bounds how long it is watched). The scan
then goes on: right at the onset a loop takes its time. Where nothing cycles, or several steps below the
first cycle are undecided, there is no onset, and the reason says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.model.robot import OneLinkRobot
from pipelines.recordings import SetPointRun
from pipelines.run_outcomes import LoopAsRun, Outcome, Verdicts

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

DECIDED: Final = ("equilibrium", "limit_cycle")
SAME_START: Final = 0.05  # of the largest |x1(0)|
SCAN_STEP: Final = 0.01  # of r
BEYOND: Final = 0.2  # of r: how far past the recorded runs a scan goes
TOLERANCE: Final = 2e-4  # of r
FEWEST_UNKNOWN: Final = 3  # steps below the first cycle that leave an onset open; fewer are its own slowness
BLOCK: Final = 4  # values of a scan that are predicted at a time
DRAWN_STEP: Final = 0.004  # of r: first bracket around the fitted robot's onset
DRAWN_TOLERANCE: Final = 0.002  # of r


@dataclass(frozen=True)
class JudgedRun:
    """A recorded run: what was seen, how its controller was set, and its loop with the fitted robot in it."""

    run: SetPointRun
    seen: Outcome
    start: float  # x1(0) [rad]
    loop: LoopAsRun | None  # None: a parameter of the robot is withheld

    @property
    def gain(self) -> float:
        """Its r."""
        return self.run.set_point.compensation_gain

    @property
    def alike(self) -> tuple[object, ...]:
        """What runs of one onset share, their start aside."""
        setting = self.run.set_point
        return replace(setting, compensation_gain=0.0, sample_period=None), self.run.compensator


@dataclass(frozen=True)
class Bracket:
    """Where the recorded runs put the onset."""

    resting: float | None  # largest r at rest below the smallest that cycles
    cycling: float | None  # smallest r that cycles
    reversals: tuple[float, ...]  # rests above it
    why: str | None  # why an end is missing


@dataclass(frozen=True)
class Found:
    """A predicted onset, or why there is none."""

    r: float | None
    why: str | None = None


def groups(runs: Sequence[JudgedRun]) -> tuple[tuple[JudgedRun, ...], ...]:
    """Runs that share gains, compensator, observer, delay and start; in order of the start."""
    alike: dict[object, list[JudgedRun]] = {}
    for run in runs:
        alike.setdefault(run.alike, []).append(run)
    found = []
    for members in alike.values():
        reach = SAME_START * max(abs(run.start) for run in members)
        reach = max(reach, 4.0 * max(run.run.recording.resolution or 0.0 for run in members))
        members.sort(key=lambda run: run.start)
        cluster = [members[0]]
        for run in members[1:]:
            if run.start - cluster[-1].start > reach:
                found.append(tuple(cluster))
                cluster = []
            cluster.append(run)
        found.append(tuple(cluster))
    return tuple(found)


def middle(group: Sequence[JudgedRun]) -> JudgedRun:
    """The run whose start is the group's median."""
    ordered = sorted(group, key=lambda run: run.start)
    return ordered[(len(ordered) - 1) // 2]


def recorded_bracket(group: Sequence[JudgedRun]) -> Bracket:
    """Where the group's runs put the onset."""
    rests = sorted(run.gain for run in group if run.seen.verdict == "equilibrium")
    cycles = sorted(run.gain for run in group if run.seen.cycles)
    if not cycles:
        return Bracket(rests[-1] if rests else None, None, (), "no recorded run cycles")
    below = [r for r in rests if r < cycles[0]]
    reversals = tuple(r for r in rests if r >= cycles[0])
    if not below:
        return Bracket(None, cycles[0], reversals, "no recorded run rests below the smallest r that cycles")
    return Bracket(below[-1], cycles[0], reversals, None)


def scanned_gains(group: Sequence[JudgedRun]) -> FloatArray:
    """The r to scan, (n,): from below the recorded runs to above them, and the recorded ones themselves."""
    recorded = [run.gain for run in group]
    low, high = max(0.0, min(recorded) - BEYOND), max(recorded) + BEYOND
    steps = np.arange(np.floor(low / SCAN_STEP), np.ceil(high / SCAN_STEP) + 1) * SCAN_STEP
    return np.unique(np.concatenate((steps[steps >= 0], recorded)))


def smallest_cycling(loop: LoopAsRun, gains: FloatArray, predict: Verdicts) -> Found:
    """The smallest r of the scan that cycles, made precise between it and the one before."""
    before: list[Outcome] = []
    while len(before) < gains.size:
        block = gains[len(before) : len(before) + BLOCK]
        outcomes = predict([loop.at(float(r)) for r in block])
        cycling = [outcome.cycles for outcome in outcomes]
        if any(cycling):
            before += outcomes[: cycling.index(True)]
            break
        before += outcomes
    first, unknown = len(before), [outcome for outcome in before if outcome.verdict not in DECIDED]
    if first == gains.size:
        why = f"no r from {gains[0]:g} to {gains[-1]:g} cycles from this start"
        return Found(None, why + (f" ({_undecided(unknown)})" if unknown else ""))
    if first == 0:
        return Found(None, f"every r down to {gains[0]:g} cycles from this start")
    if all(outcome.verdict not in DECIDED for outcome in before[-FEWEST_UNKNOWN:]):
        return Found(None, f"cycles at r = {gains[first]:g}; below, {_undecided(unknown)}")
    low, high = float(gains[first - 1]), float(gains[first])
    while high - low > TOLERANCE:
        centre = 0.5 * (low + high)
        (outcome,) = predict([loop.at(centre)])
        low, high = (low, centre) if outcome.cycles else (centre, high)
    return Found(0.5 * (low + high))


def _undecided(unknown: Sequence[Outcome]) -> str:
    return f"{len(unknown)} of the r are undecided: {unknown[-1].why}"


def drawn_onsets(
    loop: LoopAsRun,
    robots: Sequence[OneLinkRobot],
    predict: Verdicts,
    *,
    around: float,
    limits: tuple[float, float],
) -> FloatArray:
    """The onset of each robot under the same controller, (n,), by bisection from a bracket `around` a value.

    Infinite where a robot cycles at no r within the limits, minus infinite where it does at every one.
    """

    def cycling(who: IntArray, gains: FloatArray) -> BoolArray:
        loops = [loop.moved_by(robots[i]).at(float(r)) for i, r in zip(who, gains, strict=True)]
        return np.array([outcome.cycles for outcome in predict(loops)], dtype=bool)

    everyone = np.arange(len(robots))
    low = np.full(len(robots), max(around - DRAWN_STEP, limits[0]))
    high = np.full(len(robots), min(around + DRAWN_STEP, limits[1]))
    low_cycles, high_cycles = cycling(everyone, low), cycling(everyone, high)
    step = DRAWN_STEP
    while True:
        down = np.flatnonzero(low_cycles & (low > limits[0]))
        up = np.flatnonzero(~high_cycles & (high < limits[1]))
        if down.size + up.size == 0:
            break
        step *= 2.0
        high[down], high_cycles[down] = low[down], True
        low[down] = np.maximum(low[down] - step, limits[0])
        low[up], low_cycles[up] = high[up], False
        high[up] = np.minimum(high[up] + step, limits[1])
        if down.size:
            low_cycles[down] = cycling(down, low[down])
        if up.size:
            high_cycles[up] = cycling(up, high[up])
    inside = np.flatnonzero(~low_cycles & high_cycles)
    while inside.size and float(np.max(high[inside] - low[inside])) > DRAWN_TOLERANCE:
        centre = 0.5 * (low[inside] + high[inside])
        moves = cycling(inside, centre)
        high[inside], low[inside] = (
            np.where(moves, centre, high[inside]),
            np.where(moves, low[inside], centre),
        )
    onsets = np.where(low_cycles, -np.inf, np.inf)
    onsets[inside] = 0.5 * (low[inside] + high[inside])
    return onsets


def interval95(onsets: FloatArray) -> tuple[float | None, float | None]:
    """The 2.5 and 97.5 % quantiles of drawn onsets; None where that end is beyond what was searched."""
    ordered = np.sort(onsets)
    if not ordered.size:
        return None, None
    ends = (ordered[int(0.025 * (ordered.size - 1))], ordered[int(np.ceil(0.975 * (ordered.size - 1)))])
    low, high = (float(end) if np.isfinite(end) else None for end in ends)
    return low, high

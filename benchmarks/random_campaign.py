"""Random starts, gains and laws: nothing may loop for ever, break off or end for a wrong reason.

Laws differ by direction, robot and model differ, beta is 0.5 to 2 (all 1 or all 2 for most, where series may
serve; each law its own for the others), r is 0 to 2. Every end reason is checked:

- An equilibrium that is started from must not move.
- Every trajectory is restarted from half way, and must end as the whole one did. How far it may be off is
  what a tighter tolerance, or a nudge half way, makes of it: that is the loop's own sensitivity.
- Every `SHARE`-th is run by an implicit time stepper that shares no code with the solver (`time_stepping`).
  As its step falls its state must come to ours at first order, and its link must rest, or move, as ours does.

Some loops are too sensitive for a first-order method over the whole duration: with exact compensation (the
model is the robot, r = 1) x3 falls below rounding and grows again wherever friction falls with speed. There
the stepper is started from our state in each of `WINDOWS` windows (`PIECEWISE`). Where it disagrees even
there, our own solutions from nudged states under nudged gains must disagree with ours by half as much at
least, and rest or move as the stepper's does, unless they differ by more than the whole motion (`UNSTABLE`):
neither proves the other wrong. Both are counted; anything else is `CONTRADICTED`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.time_stepping import march_every
from compensation.loop_parameters import COLUMNS, ROWS, mode_table
from compensation.loop_runs import run_for
from compensation.many_trajectories import run_every
from ident.simulation.integrate import EQUILIBRIUM, TIME_REACHED

DURATION: Final = 5.0  # [s]
AFTERWARDS: Final = 1.0  # [s] of the restart
TOLERANCE: Final = 1e-9
TIGHTER: Final = (1e-11, 1e-13)
MOVED: Final = 1e-7  # [rad] that a link at rest may not move
CONTINUED: Final = 1e-6  # of the state that a restart from half way may change
SENSITIVITY: Final = 100.0  # times what a tighter tolerance or a nudge changes, that it may change too
NUDGE: Final = 1e-12  # of the state half way
SHARE: Final = 8  # every such trajectory is run by the time stepper
FINENESS: Final = (0.16, 0.04, 0.01, 0.0025)  # steps, in shortest time constants, taken until both agree
FINER: Final = (0.01, 0.0025, 0.000625)  # of the windows
WINDOWS: Final = 100
CLOSE: Final = 1e-3  # of the state: so close, the order of convergence no longer matters
NEAR: Final = 2e-2  # of the state: farther, it does not help
STEPPER_NUDGE: Final = 1e-4  # of the state, and of the gains: about the stepper's error in a window
NUDGES: Final = 24
WHOLE, PIECEWISE, UNSTABLE, CONTRADICTED = range(4)

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Loops:
    """n loops, as plain numbers for the stepper and as tables for the solver."""

    laws: FloatArray  # (n, 4, 5) F_s, F_c, v_s, b, beta of robot positive, negative, model positive, negative
    inertia: FloatArray  # (n, 2) [kg m^2] robot, model
    gains: FloatArray  # (n, 4) n1, n2, L, r
    tables: FloatArray  # (n, 6, 16)

    def __getitem__(self, chosen: NDArray[np.int64] | Flags | slice) -> Loops:
        """Some of them."""
        return Loops(self.laws[chosen], self.inertia[chosen], self.gains[chosen], self.tables[chosen])


@dataclass(frozen=True)
class Runs:
    """What the solver says of n trajectories."""

    start: FloatArray  # (n, 3) x1 [rad], x2 [rad/s], x3 [rad/s]
    times: FloatArray  # (k,) [s]
    states: FloatArray  # (n, k, 3) at the times
    end: FloatArray  # (n, 3); of an equilibrium: where the state tends to
    end_time: FloatArray  # (n,) [s]; of an equilibrium: since when the link rests
    reason: NDArray[np.int64]  # (n,)

    def __getitem__(self, chosen: NDArray[np.int64] | Flags | slice) -> Runs:
        """Some of them."""
        return Runs(
            self.start[chosen], self.times, self.states[chosen], self.end[chosen], self.end_time[chosen],
            self.reason[chosen],
        )  # fmt: skip

    @property
    def moving(self) -> Flags:
        """Whether the link moves, or is going to, at the times: (n, k)."""
        resting = (self.reason == EQUILIBRIUM)[:, np.newaxis]
        moving: Flags = ~(resting & (self.times >= self.end_time[:, np.newaxis]))
        return moving


@dataclass(frozen=True)
class Failures:
    """How many of the trajectories failed, and how."""

    unfinished: int  # neither time reached nor equilibrium
    not_finite: int
    not_at_rest: int  # an equilibrium that moves on a restart
    not_continued: int  # started again half way it ends elsewhere, or for another reason
    contradicted: int  # by the time stepper


@dataclass(frozen=True)
class Findings:
    """What a campaign found."""

    failures: Failures
    imprecise: int  # continued, but off by what neither a tighter tolerance nor a nudge explains
    stepped: int  # how many the time stepper has run
    piecewise: int  # of them: agree in every window, not over the whole duration
    unstable: int  # of them: do not agree in some window, where a nudge does as much


def run_campaign(count: int, generator: np.random.Generator) -> Findings:
    """`count` random trajectories."""
    loops = random_loops(count, generator)
    starts = generator.normal(size=(count, 3))
    starts[:, 0] *= 0.5
    return check(loops, solve(loops, starts, DURATION))


def check(loops: Loops, runs: Runs) -> Findings:
    """Whether what the solver says of n trajectories is true."""
    share = slice(None, None, SHARE)
    verdicts = step_along(loops[share], runs[share])
    continued, precise = continues(loops, runs)
    failures = Failures(
        unfinished=int(np.sum((runs.reason != TIME_REACHED) & (runs.reason != EQUILIBRIUM))),
        not_finite=int(np.sum(~np.isfinite(runs.end).all(axis=1))),
        not_at_rest=int(np.sum(~stays(loops, runs))),
        not_continued=int(np.sum(~continued)),
        contradicted=int(np.sum(verdicts == CONTRADICTED)),
    )
    return Findings(
        failures,
        imprecise=int(np.sum(continued & ~precise)),
        stepped=verdicts.size,
        piecewise=int(np.sum(verdicts == PIECEWISE)),
        unstable=int(np.sum(verdicts == UNSTABLE)),
    )


def stays(loops: Loops, runs: Runs) -> Flags:
    """Whether the link stays where it is when started at its equilibrium: (n,), true of all others."""
    resting = runs.reason == EQUILIBRIUM
    later = solve(loops[resting], runs.end[resting], AFTERWARDS)
    well = np.full(resting.size, True)
    well[resting] = np.abs(later.end[:, 0] - runs.end[resting, 0]) <= MOVED
    return well


def continues(loops: Loops, runs: Runs) -> tuple[Flags, Flags]:
    """Whether trajectories end the same when started again from half way: (n,), (n,).

    First, but for their sensitivity and for what a tighter tolerance makes of the second half; then, but for
    their sensitivity alone.
    """
    duration, size = float(runs.times[-1]), _size(runs)
    half = solve(loops, runs.start, 0.5 * duration).end
    again = solve(loops, half, 0.5 * duration)
    apart = _apart(again, runs, size)
    continued: Flags = apart <= CONTINUED * size
    precise = continued.copy()
    doubtful = np.flatnonzero(~continued)
    some, given, again, size = loops[doubtful], runs[doubtful], again[doubtful], size[doubtful]
    half, apart = half[doubtful], apart[doubtful]
    honest = solve(some, given.start, duration)
    spread, error = np.zeros(doubtful.size), np.zeros(doubtful.size)
    for nudged in _nudges(half, NUDGE * size[:, np.newaxis]):
        spread = np.maximum(spread, _apart(solve(some, nudged, 0.5 * duration), honest, size))
    for tolerance in TIGHTER:
        whole = solve(some, given.start, duration, tolerance=tolerance)
        second = solve(some, half, 0.5 * duration, tolerance=tolerance)
        spread = np.maximum(spread, _apart(whole, honest, size))
        error = np.maximum(error, _apart(second, again, size))
    genuine = _same(honest, given)
    precise[doubtful] = genuine & (apart <= SENSITIVITY * spread)
    continued[doubtful] = genuine & (apart <= SENSITIVITY * np.maximum(spread, error))
    return continued, precise


def step_along(loops: Loops, runs: Runs) -> NDArray[np.int64]:
    """What the stepper makes of n trajectories: `WHOLE`, `PIECEWISE`, `UNSTABLE` or `CONTRADICTED`, (n,)."""
    duration, size = np.full(runs.reason.size, runs.times[-1]), _size(runs)
    over_all = _compare(loops, runs.start, runs.states[:, -1], runs.moving[:, -1], duration, size, FINENESS)
    verdicts = np.where(over_all.agrees, WHOLE, CONTRADICTED)
    left = np.flatnonzero(~over_all.agrees)
    again = solve(loops[left], runs.start[left], float(runs.times[-1]), times=_edges(runs))
    left, again = left[_same(again, runs[left])], again[_same(again, runs[left])]
    verdicts[left] = _by_windows(loops[left], again, size[left])
    return verdicts


def _by_windows(loops: Loops, runs: Runs, size: FloatArray) -> NDArray[np.int64]:
    """`PIECEWISE`, `UNSTABLE` or `CONTRADICTED` (n,) of trajectories given at the edges of windows."""
    start, end = runs.states[:, :-1].reshape(-1, 3), runs.states[:, 1:].reshape(-1, 3)
    moving, duration = runs.moving[:, 1:].ravel(), float(runs.times[1])
    pieces, sizes = loops[np.repeat(np.arange(size.size), WINDOWS)], np.repeat(size, WINDOWS)
    found = _compare(pieces, start, end, moving, np.full(sizes.size, duration), sizes, FINER)
    open_ = np.flatnonzero(~found.agrees)
    spread, alike = np.zeros(open_.size), found.moving[open_] == moving[open_]
    nudged_gains = _nudges(pieces.gains[open_], STEPPER_NUDGE * pieces.gains[open_])
    for nudge, gains in zip(
        _nudges(start[open_], STEPPER_NUDGE * sizes[open_, np.newaxis]), nudged_gains, strict=True
    ):
        other = solve(_loops(pieces.laws[open_], pieces.inertia[open_], np.abs(gains)), nudge, duration)
        spread = np.maximum(spread, np.max(np.abs(other.states[:, -1] - end[open_]), axis=1) / sizes[open_])
        alike |= other.moving[:, -1] == found.moving[open_]
    alike |= np.max(np.abs(end[open_]), axis=1) / sizes[open_] <= spread
    verdicts = np.where(found.agrees, PIECEWISE, CONTRADICTED)
    verdicts[open_[alike & (found.error[open_] <= np.maximum(2.0 * spread, CLOSE))]] = UNSTABLE
    worst: NDArray[np.int64] = np.max(verdicts.reshape(-1, WINDOWS), axis=1, initial=PIECEWISE)
    return worst


@dataclass(frozen=True)
class Comparison:
    """The time stepper beside n stretches of trajectories."""

    agrees: Flags  # (n,)
    error: FloatArray  # (n,) of the state, at the finest steps taken
    moving: Flags  # (n,) what the stepper says


def _compare(
    loops: Loops,
    start: FloatArray,
    end: FloatArray,
    moving: Flags,
    duration: FloatArray,
    size: FloatArray,
    ladder: tuple[float, ...],
) -> Comparison:
    """Whether the stepper comes from `start` to `end` as its steps fall, and rests or moves there."""
    found = Comparison(np.full(size.size, False), np.full(size.size, np.nan), moving.copy())
    for fineness in ladder:
        left = np.flatnonzero(~found.agrees)
        there, found.moving[left] = _stepped(loops[left], start[left], duration[left], fineness)
        before, error = found.error[left], np.max(np.abs(there - end[left]), axis=1) / size[left]
        converges = (error <= CLOSE) | ((error <= NEAR) & (error <= 0.5 * before))
        found.agrees[left] = ~np.isnan(before) & converges & (found.moving[left] == moving[left])
        found.error[left] = error
    return found


def random_loops(count: int, generator: np.random.Generator) -> Loops:
    """Random robots under random controllers."""
    laws = np.empty((count, 4, 5))
    laws[..., 1] = generator.uniform(0.05, 0.6, (count, 4))
    laws[..., 0] = laws[..., 1] * generator.uniform(1.0, 1.8, (count, 4))
    laws[..., 2] = np.exp(generator.uniform(np.log(0.01), np.log(0.5), (count, 4)))
    laws[..., 3] = generator.uniform(0.0, 0.2, (count, 4))
    laws[..., 4] = _random_shapes(count, generator)
    same = generator.random(count) < 0.3  # the model is the robot
    laws[same, 2:] = laws[same, :2]
    inertia = generator.uniform(0.01, 0.1, (count, 2))
    inertia[same, 1] = inertia[same, 0]
    gains = np.column_stack(
        [
            generator.uniform(0.05, 2.0, count),
            generator.uniform(0.0, 0.1, count),
            generator.uniform(1.0, 150.0, count),
            np.where(generator.random(count) < 0.1, 1.0, generator.uniform(0.0, 2.0, count)),
        ]
    )
    return _loops(laws, inertia, gains)


def _loops(laws: FloatArray, inertia: FloatArray, gains: FloatArray) -> Loops:
    tables = np.zeros((gains.shape[0], ROWS, COLUMNS))
    for i in range(gains.shape[0]):
        mode_table(laws[i], inertia[i], gains[i], tables[i])
    return Loops(laws, inertia, gains, tables)


def random_tables(count: int, generator: np.random.Generator) -> FloatArray:
    """Mode parameters (count, 6, 16) of random robots under random controllers."""
    return random_loops(count, generator).tables


def _random_shapes(count: int, generator: np.random.Generator) -> FloatArray:
    """Beta (count, 4): 1 for half of all laws, 2 for a quarter, free for the others.

    Of 20 loops 9 have 1 alone, 4 have 2 alone, 2 have either by law and 5 have a free one by law.
    """
    kind = generator.random((count, 1))
    either = generator.choice([1.0, 2.0], (count, 4))
    free = generator.uniform(0.5, 2.0, (count, 4))
    return np.where(kind < 0.45, 1.0, np.where(kind < 0.65, 2.0, np.where(kind < 0.75, either, free)))


def solve(
    loops: Loops,
    starts: FloatArray,
    duration: float,
    *,
    tolerance: float = TOLERANCE,
    times: FloatArray | None = None,
) -> Runs:
    """Trajectories of the solver from `starts` (n, 3), with states at the end if not at `times` (k,) [s]."""
    count, wanted = starts.shape[0], np.array([duration]) if times is None else times
    ends, states = starts.copy(), np.full((count, wanted.size, 3), np.nan)
    end_times, reasons = np.empty(count), np.empty(count, np.int64)
    addresses = np.array([run_for(table) for table in loops.tables], dtype=np.int64)

    def run_part(part: int, parts: int) -> None:
        run_every(
            addresses,
            loops.tables,
            part,
            parts,
            tolerance,
            duration,
            ends,
            wanted,
            states,
            end_times,
            reasons,
        )

    _on_all_cores(run_part)
    return Runs(starts, wanted, states, ends, end_times, reasons)


def _stepped(
    loops: Loops, starts: FloatArray, duration: FloatArray, fineness: float
) -> tuple[FloatArray, Flags]:
    """Where the time stepper comes to (n, 3), and whether the link moves there or is going to (n,)."""
    ends, moving = starts.copy(), np.full(starts.shape[0], False)

    def run_part(part: int, parts: int) -> None:
        march_every(loops.laws, loops.inertia, loops.gains, fineness, duration, part, parts, ends, moving)

    _on_all_cores(run_part)
    return ends, moving


def _on_all_cores(run_part: Callable[[int, int], None]) -> None:
    parts = os.cpu_count() or 1
    with ThreadPoolExecutor(parts) as threads:
        list(threads.map(run_part, range(parts), [parts] * parts))


def _edges(runs: Runs) -> FloatArray:
    return np.linspace(0.0, runs.times[-1], WINDOWS + 1)


def _nudges(values: FloatArray, by: FloatArray) -> Iterator[FloatArray]:
    """Values (n, k) beside given ones, `by` (n, k) or (n, 1) away or up to a hundred times less."""
    generator = np.random.default_rng(values.shape)
    for _ in range(NUDGES):
        yield values + by * 10.0 ** generator.uniform(-2.0, 0.0) * generator.normal(size=values.shape)


def _size(runs: Runs) -> FloatArray:
    """Largest component (n,) of starts and ends."""
    size: FloatArray = np.max(np.abs(np.hstack([runs.start, runs.states[:, -1]])), axis=1)
    return size


def _same(first: Runs, second: Runs) -> Flags:
    """Whether ends and reasons are the same to the last bit: (n,)."""
    ends: Flags = (first.states[:, -1] == second.states[:, -1]).all(axis=1)
    same: Flags = ends & (first.reason == second.reason)
    return same


def _apart(first: Runs, second: Runs, size: FloatArray) -> FloatArray:
    """How far (n,) ends are from each other; at least the `size` (n,) of the state, if reasons differ."""
    apart: FloatArray = np.max(np.abs(first.end - second.end), axis=1)
    apart[first.reason != second.reason] = np.maximum(apart, size)[first.reason != second.reason]
    return apart

"""Many trajectories of the closed loop at once: arrays of starts and gains, side by side and on all cores.

Where all Stribeck shapes are 1, eight trajectories go side by side in the lanes of packs
(`simulation.lanes`); others go one by one.

Neighbouring trajectories cost alike, and their cost changes along a sorted gain: part p of P takes every P-th
from the p-th on, so that all parts end together. A part is one compiled call that releases the interpreter
lock: threads are enough. Which threads is the caller's business, by `map_parts`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from compensation.closed_loop import STEP_LIMIT, ClosedLoop, checked_accuracy, checked_times
from compensation.controller import Gains
from compensation.loop_lanes import LOOP_LANES
from compensation.loop_modes import surfaces
from compensation.loop_parameters import COLUMNS
from compensation.loop_runs import begin, is_exponential, run_at, run_for
from compensation.loop_tables import GAIN_NAMES, gain_row, tables_over_gains
from ident.model.doors import expect
from ident.model.friction import ModelError
from ident.model.numbers import is_count, real_array, shown
from ident.simulation.compiled import compiled, owning, passed
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.integrate import END_REASONS, Progress
from ident.simulation.lanes import LANES, Batch, integrate_side_by_side, lanes_of, table_of

STATES: Final = 3
SURFACES: Final = 2


class MapParts(Protocol):
    """`map`, or what stands in for it on several threads."""

    def __call__(self, function: Callable[[int], None], parts: Iterable[int], /) -> Iterable[None]:
        """Apply a function to every part."""


@dataclass(frozen=True)
class Trajectories:
    """Where n trajectories went."""

    time: FloatArray  # (k,) [s]
    state: FloatArray  # (n, k, 3) x1 [rad], x2 [rad/s], x3 [rad/s]; nan after a trajectory that broke off
    reasons: Signs  # (n,) indices into END_REASONS
    end_time: FloatArray  # (n,) [s] of an equilibrium: since when the link rests
    end_state: FloatArray  # (n, 3) [rad, rad/s, rad/s]; of an equilibrium: where the state tends to

    @property
    def end_reasons(self) -> tuple[str, ...]:
        """Why each ended: "time reached", "equilibrium" or "step limit"."""
        return tuple(END_REASONS[reason] for reason in self.reasons.tolist())


def simulate_many(
    loop: ClosedLoop,
    starts: ArrayLike,
    *,
    duration: float,
    times: ArrayLike = (),
    gains: ArrayLike | None = None,
    tolerance: float = 1e-10,
    map_parts: MapParts = map,
    parts: int = 1,
) -> Trajectories:
    """Solve inclusion (8) from each of `starts` (n, 3) [rad, rad/s, rad/s] for `duration` [s].

    `gains` (n, 4) are n1 [N m/rad], n2 [N m s/rad], L [1/s] and r [-] of each trajectory, else the loop's.
    States are given at `times` (k,) [s]. The work is cut into `parts`, which `map_parts` applies.

    Raises
    ------
    ModelError
        If starts, gains, times, tolerance or parts are no numbers, have no fitting shape or run backwards; it
        names the trajectory and the gain.
    """
    expect("loop", loop, ClosedLoop, "eq 8")
    first = _checked_starts(starts)
    rows = gain_row(loop.controller)[np.newaxis] if gains is None else _checked_gains(gains, first.shape[0])
    duration, tolerance = checked_accuracy(duration, tolerance)
    if not (is_count(parts) and parts >= 1):
        raise ModelError(f"parts is {parts!r}: a whole number >= 1, into which the runs of eq (8) are cut")
    tables = tables_over_gains(loop.robot, loop.controller, rows)
    runs = np.array([run_for(tables[0])])  # the laws, and so the method, are the same for all
    wanted = checked_times(times, duration)
    count = first.shape[0]
    parts = min(int(parts), max(count, 1))  # more of them would be empty
    states = np.full((count, wanted.size, STATES), np.nan)
    end_times, reasons = np.empty(count), np.empty(count, np.int64)

    follow = run_side_by_side if is_exponential(tables[0]) and count >= parts * LANES else run_every

    def run_part(part: int) -> None:
        follow(runs, tables, part, parts, tolerance, duration, first, wanted, states, end_times, reasons)

    for _ in map_parts(run_part, range(parts)):
        pass
    return Trajectories(wanted, states, reasons, end_times, first)


def _checked_starts(starts: ArrayLike) -> FloatArray:
    first = real_array(starts)
    if first is None or first.ndim != 2 or first.shape[1] != STATES:
        shape = shown(starts) if first is None else f"of shape {first.shape}"
        raise ModelError(f"starts are {shape}: finite numbers of shape (n, 3) are needed (eq 8)")
    if not np.isfinite(first).all():
        i = int(np.argmin(np.isfinite(first).all(axis=1)))
        raise ModelError(f"starts[{i}] is {first[i].tolist()}: finite x1 [rad], x2, x3 [rad/s] (eq 8)")
    return first


def _checked_gains(gains: ArrayLike, count: int) -> FloatArray:
    rows = real_array(gains)
    if rows is None or rows.shape != (count, len(GAIN_NAMES)):
        shape = shown(gains) if rows is None else f"of shape {rows.shape}"
        raise ModelError(f"gains are {shape}: n1, n2, L, r for each of {count} starts (eqs 5-7)")
    good = np.isfinite(rows) & (rows >= 0.0)
    good[:, 0] &= rows[:, 0] > 0.0
    if not good.all():
        i = int(np.argmin(good.all(axis=1)))
        try:
            Gains(**dict(zip(GAIN_NAMES, rows[i].tolist(), strict=True)))
        except ModelError as broken:
            raise ModelError(f"gains[{i}]: {broken}") from None
    return rows


@compiled
def _go_on(
    run: int,
    batch: Batch,
    index: int,
    tolerance: float,
    end: float,
    steps: int,
    time: float,
    output: int,
) -> Progress:
    """One trajectory of a batch by itself, `integrate`; none of its events are kept."""
    now: Progress = run_at(
        run,
        (
            batch.tables[table_of(batch, index)], tolerance, end, steps, -1, 0, 0, time, batch.states[index],
            batch.signs[index], batch.contacts[index], batch.times[output:], batch.wanted[index, output:],
            batch.times[:0], batch.signs[index, :0], batch.signs[:0], batch.states[:0],
        ),
    )  # fmt: skip
    return now


GO_ON: Final = passed(_go_on)


@owning
def run_side_by_side(
    runs: Signs,
    tables: FloatArray,
    part: int,
    parts: int,
    tolerance: float,
    duration: float,
    starts: FloatArray,
    times: FloatArray,
    states: FloatArray,
    end_times: FloatArray,
    reasons: Signs,
) -> None:
    """As `run_every`, eight at a time, for Stribeck shapes of 1; `runs` (1,)."""
    count = starts.shape[0]
    signs, contacts = np.zeros((count, SURFACES), np.int64), np.zeros((count, SURFACES), np.int64)
    batch = Batch(tables, times, states, starts, signs, contacts, end_times, reasons)
    for i in range(part, count, parts):
        begin(tables[table_of(batch, i)], starts[i], signs[i], contacts[i])
    at, memory = lanes_of(STATES, SURFACES, COLUMNS)
    integrate_side_by_side(
        LOOP_LANES,
        GO_ON,
        runs[0],
        surfaces(),
        batch,
        at,
        memory,
        part,
        parts,
        tolerance,
        duration,
        STEP_LIMIT,
    )


@owning
def run_every(
    runs: Signs,
    tables: FloatArray,
    part: int,
    parts: int,
    tolerance: float,
    duration: float,
    starts: FloatArray,
    times: FloatArray,
    states: FloatArray,
    end_times: FloatArray,
    reasons: Signs,
) -> None:
    """Trajectories `part`, `part` + `parts`, ...; `starts` become their ends.

    `runs` are addresses of the kernels of `loop_runs`, one for all or one for each.
    """
    signs, contact = np.empty(2, np.int64), np.empty(2, np.int64)
    at, which = np.empty(0), np.empty(0, np.int64)
    modes, where = np.empty((0, 2), np.int64), np.empty((0, STATES))
    for i in range(part, starts.shape[0], parts):
        table = tables[min(i, tables.shape[0] - 1)]
        begin(table, starts[i], signs, contact)
        end = run_at(
            runs[min(i, runs.size - 1)],
            (
                table, tolerance, duration, STEP_LIMIT, -1, 0, 0, 0.0, starts[i], signs, contact,
                times, states[i], at, which, modes, where,
            ),
        )  # fmt: skip
        end_times[i], reasons[i] = end.time, end.reason

"""The cycle on which the motion of a closed loop settles, by its return map followed in one kernel.

A stable cycle is what the map repeats in the end, after however many returns; one more period from there
gives the derivative, the multipliers and the last correction (`orbits.periodic_orbits`). What repeats too
slowly is left undecided.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_parameters import COLUMNS, ROWS, mode_table
from compensation.loop_returns import (
    MOST_HALTS,
    MapKernels,
    derivative_at,
    map_kernels,
    newton_change,
    returns_at,
)
from compensation.loop_section import PATIENCE, REPEATS, STILL, LoopSection, with_gain
from compensation.loop_sweep import CLOSE, TANGENT_TOLERANCE
from compensation.loop_tables import COLUMN_OF, Parameter, gain_row, laws_of
from compensation.orbits.periodic_orbits import (
    MOST_TURNS,
    SAME_POINT,
    VANISHED,
    Cycle,
    NoCycle,
    cycle_of,
    find_cycle,
)
from ident.simulation.compiled import compiled, owning
from ident.simulation.filippov_system import FloatArray
from ident.simulation.integrate import SECTION

NOWHERE: Final = 0
UNDECIDED: Final = -1
NEARLY: Final = 1e-9  # relative distance of points that are the same, before the correction
MOST_RETURNS: Final = 48
MOST_CORRECTIONS: Final = 4
X1, X2, DURATION, LOW, HIGH, SLOPE = range(6)  # of what is told of a cycle; its derivative from SLOPE on
NUMBERS: Final = SLOPE + 4


def settled(loop: ClosedLoop, parameter: Parameter, value: float, start: FloatArray) -> Cycle | NoCycle:
    """The cycle at a value of a gain to which a point (2,) of the section v = 0 leads."""
    section = LoopSection(loop)
    if not section.lipschitz:  # repeats too roughly for the kernel
        return find_cycle(LoopSection(with_gain(loop, parameter, value)), start)
    laws, inertia = laws_of(loop.robot, loop.controller)
    gains = gain_row(loop.controller)
    gains[COLUMN_OF[parameter]] = value
    row = np.empty(NUMBERS)
    period = settle(
        map_kernels(loop.modes), laws, inertia, gains, section.symmetric,
        section.tolerance, PATIENCE, start, row,
    )  # fmt: skip
    if period == NOWHERE:
        return NoCycle("leads to no cycle")
    if period == UNDECIDED:
        return find_cycle(LoopSection(with_gain(loop, parameter, value)), row[: X2 + 1].copy())
    extremes = (float(row[LOW]), float(row[HIGH]))
    slope = row[SLOPE:].reshape(2, 2)
    return cycle_of(row[: X2 + 1], period, float(row[DURATION]), extremes, slope, section.symmetric)


@owning
def settle(
    kernels: MapKernels,
    laws: FloatArray,
    inertia: FloatArray,
    gains: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    start: FloatArray,
    row: FloatArray,
) -> int:
    """Follow the return map from `start` (2,) until it repeats: how many returns that takes.

    NOWHERE where it leads to no cycle; UNDECIDED where it does not repeat soon, and `row` (NUMBERS,) begins
    with the point reached. Otherwise `row` tells of the cycle: as it is over that many returns, in the frame
    of the first. Laws, inertia and gains are those of `loop_parameters.mode_table`, `kernels` those of
    the loop.
    """
    table, state, points = np.zeros((ROWS, COLUMNS)), np.empty(3), np.empty((MOST_RETURNS, 5))
    mode_table(laws, inertia, gains, table)
    row[X1], row[X2] = start[0], start[1]
    small = VANISHED * max(abs(start[0]), abs(start[1]))
    for made in range(MOST_RETURNS):
        state[0], state[1], state[2] = row[X1], row[X2], -row[X2]
        count, _ = returns_at(
            kernels.returns,
            (kernels.run, table, symmetric, tolerance, patience, state, points[made : made + 1]),
        )
        row[X1], row[X2] = points[made, 0], points[made, 1]
        size = max(abs(row[X1]), abs(row[X2]))
        if count == 0 or size <= small:
            return NOWHERE
        for back in range(1, min(MOST_TURNS, made) + 1):
            if _apart(points[made - back], row) <= NEARLY * size:
                return _complete(kernels, table, symmetric, tolerance, patience, back, row)
    return UNDECIDED


@compiled
def _apart(point: FloatArray, row: FloatArray) -> float:
    return float(max(abs(point[0] - row[X1]), abs(point[1] - row[X2])))


@owning
def _complete(
    kernels: MapKernels,
    table: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    count: int,
    row: FloatArray,
) -> int:
    """The `row` of a cycle of `count` returns from a point near it: their number, or as for `settle`.

    Motion that closes in from alternate sides comes near after two returns before it does after one: the
    count is lowered where the cycle, once corrected, turns out to take fewer.
    """
    for _ in range(MOST_CORRECTIONS):
        found, changed = _period(kernels, table, symmetric, tolerance, patience, count, row)
        if 0 < found < count:
            count = found
        elif found != count or changed <= REPEATS:
            return found
    return UNDECIDED


@owning
def _period(
    kernels: MapKernels,
    table: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    count: int,
    row: FloatArray,
) -> tuple[int, float]:
    """As `_complete`, from one period, and by how much that corrects the point, relative to its size.

    The number is smaller than `count` where the point came back sooner; the row is then unchanged.
    """
    state, slope = np.empty(3), np.zeros((3, 2))
    state[0], state[1], state[2] = row[X1], row[X2], -row[X2]
    slope[0, 0] = slope[1, 1] = 1.0
    low, high, extent, duration, side = np.inf, -np.inf, 0.0, 0.0, 1.0
    same = SAME_POINT * max(abs(row[X1]), abs(row[X2]))
    for made in range(1, count + 1):
        spent, lowest, highest = _turn(kernels, table, symmetric, tolerance, patience, state, slope)
        if not spent < np.inf:
            return UNDECIDED, np.inf
        duration += spent
        extent = max(extent, highest - lowest)
        low, high = min(low, side * lowest, side * highest), max(high, side * lowest, side * highest)
        if symmetric:
            side = -side
        if made < count and _apart(state, row) <= same:
            return made, np.inf
    if extent <= STILL * max(-low, high):
        return NOWHERE, 0.0
    change1, change2 = newton_change(slope, state[0] - row[X1], state[1] - row[X2])
    changed = max(abs(change1), abs(change2)) / max(abs(row[X1]), abs(row[X2]))
    if not changed <= CLOSE:
        return UNDECIDED, np.inf
    row[X1], row[X2] = row[X1] + change1, row[X2] + change2
    row[DURATION] = duration + slope[2, 0] * change1 + slope[2, 1] * change2
    row[LOW], row[HIGH] = low, high
    for i in range(2):
        row[SLOPE + i], row[SLOPE + 2 + i] = slope[0, i], slope[1, i]
    return count, changed


@owning
def _turn(
    kernels: MapKernels,
    table: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    state: FloatArray,
    slope: FloatArray,
) -> tuple[float, float, float]:
    """One return from `state` (3,), and of deviations `slope` (3, 2) from it: duration, least and largest x1.

    As `loop_returns.returns`, in the frame of its half turn. An infinite duration stands for no return.
    """
    once = np.empty((3, 2))
    low = high = state[0]
    duration = 0.0
    sign = -1.0 if symmetric else 1.0
    for _ in range(MOST_HALTS):
        before = state[0]
        spent, reason = derivative_at(
            kernels.derivative,
            (kernels.run, kernels.carried, table, tolerance, TANGENT_TOLERANCE, patience, state, once),
        )
        if reason != SECTION:
            break
        duration += spent
        low, high = min(low, state[0]), max(high, state[0])
        for i in range(2):
            by1, by2 = slope[0, i], slope[1, i]
            slope[0, i] = sign * (once[0, 0] * by1 + once[0, 1] * by2)
            slope[1, i] = sign * (once[1, 0] * by1 + once[1, 1] * by2)
            slope[2, i] += once[2, 0] * by1 + once[2, 1] * by2
        if symmetric or state[0] > before:
            for i in range(state.size):
                state[i] *= sign
            return duration, low, high
    return np.inf, low, high

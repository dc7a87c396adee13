"""The stable limit cycles of a closed loop at every value of a gain.

Cycles are followed upwards from value to value, beside new starts on both sides and far and near
(`loop_starts`), and then both ways from what was found: attractors that coexist are found too. A cycle of a
symmetric loop that is not symmetric itself has a mirror image, and both are given. A symmetric loop is swept
by a kernel (`loop_sweep`), and what coexists is looked for at a few values; what that leaves undecided, and
asymmetric loops, are searched value by value.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_returns import map_kernels
from compensation.loop_section import PATIENCE, TOLERANCE, LoopSection, with_gain
from compensation.loop_settling import settled
from compensation.loop_starts import start_sizes
from compensation.loop_sweep import COLUMNS, FOUND, HALF_PERIOD, SLOPE, UNDECIDED, sweep
from compensation.loop_tables import Parameter, tables_over
from compensation.orbits.periodic_orbits import Cycle, NoCycle
from ident.simulation.filippov_system import FloatArray

TRIALS: Final = 3  # values of a symmetric loop at which a cycle is looked for beside what was found
SAME_CYCLE: Final = 1e-6  # relative difference of extremes and period, at least
SAME_POINTS: Final = 30.0  # times the accuracy of the map, in which cycles are one


def stable_cycles(loop: ClosedLoop, parameter: Parameter, grid: FloatArray) -> list[list[Cycle]]:
    """The stable cycles at each of the ascending values of a gain."""
    first = LoopSection(loop)
    starts = start_sizes(loop, parameter, grid)
    if first.symmetric:
        search = _swept if first.by_series else _followed
        found = search(loop, parameter, grid, starts)
        _look_beside(loop, parameter, grid, starts, found)
    else:
        found = _searched(loop, parameter, grid, starts)
    _lead_on(loop, parameter, grid, found, upwards=True)
    _lead_on(loop, parameter, grid, found, upwards=False)
    return found


def _lead_on(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, found: list[list[Cycle]], *, upwards: bool
) -> None:
    """Add at each value what the cycles at the value before lead to and what is not known there."""
    same, last = _same(LoopSection(loop)), grid.size - 1
    for step in range(1, grid.size):
        index, before = (step, step - 1) if upwards else (last - step, last - step + 1)
        here, value = found[index], float(grid[index])
        for cycle in found[before]:
            if len(here) < len(found[before]) or all(cycle.returns != one.returns for one in here):
                at = LoopSection(with_gain(loop, parameter, value))
                _add_with_mirror(here, settled(loop, parameter, value, cycle.point), at, same)


def _look_beside(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, starts: FloatArray, found: list[list[Cycle]]
) -> None:
    """Add cycles of a symmetric loop that near starts (n, 2) lead to, at some of the values."""
    same = _same(LoopSection(loop))
    for index in np.unique(np.linspace(0, grid.size - 1, TRIALS).round().astype(int)).tolist():
        cycle = settled(loop, parameter, float(grid[index]), np.array([starts[index, 1], 0.0]))
        at = LoopSection(with_gain(loop, parameter, float(grid[index])))
        _add_with_mirror(found[index], cycle, at, same)


def cycle_near(loop: ClosedLoop, parameter: Parameter, value: float, cycle: Cycle) -> Cycle | NoCycle:
    """The cycle at a value of the gain to which another value's cycle leads.

    Of mirror images it is the nearer one, where either continues the other value's cycle.
    """
    found = settled(loop, parameter, value, cycle.point)
    if not isinstance(found, Cycle) or found.returns != cycle.returns:
        return found
    if not _has_mirror(found, LoopSection(loop)):
        return found
    image = mirrored(found, LoopSection(with_gain(loop, parameter, value)))
    return min(found, image, key=lambda one: distance(one, cycle))


def distance(one: Cycle, other: Cycle) -> float:
    """Relative difference of two cycles."""
    size = max(one.amplitude, other.amplitude)
    extremes = max(abs(one.x1_min - other.x1_min), abs(one.x1_max - other.x1_max)) / size
    return max(extremes, abs(one.period - other.period) / max(one.period, other.period))


def mirrored(cycle: Cycle, section: LoopSection) -> Cycle:
    """The mirror image of an asymmetric cycle of a symmetric loop: in its map, the other half turn.

    A cycle whose half turn is no return by itself, as the link all but rests on the way, is its own image.
    """
    points = section.follow(cycle.point, 1).points
    if points.size == 0:
        return cycle
    return replace(cycle, point=points[0], x1_min=-cycle.x1_max, x1_max=-cycle.x1_min)


def _swept(loop: ClosedLoop, parameter: Parameter, grid: FloatArray, starts: FloatArray) -> list[list[Cycle]]:
    """Of a symmetric loop: from the cycles of the value before, or else from `starts` (n, 2)."""
    tables = tables_over(loop.robot, loop.controller, parameter, grid)
    found: list[list[Cycle]] = []
    while len(found) < grid.size:
        here = len(found)
        if not (found and found[-1] and found[-1][0].returns > 1):
            first = found[-1][0].point if found and found[-1] else np.array([starts[here, 0], 0.0])
            found.extend(_decided(grid[here:], tables[here:], first, starts[here:]))
            here = len(found)
        if here < grid.size:
            before = found[-1] if found else []
            found.append(_at_one(loop, parameter, float(grid[here]), before, starts[here]))
    return found


def _followed(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, starts: FloatArray
) -> list[list[Cycle]]:
    """As `_swept`, value by value."""
    found: list[list[Cycle]] = []
    for value, cold in zip(grid.tolist(), starts, strict=True):
        found.append(_at_one(loop, parameter, value, found[-1] if found else [], cold))
    return found


def _at_one(
    loop: ClosedLoop, parameter: Parameter, value: float, before: list[Cycle], cold: FloatArray
) -> list[Cycle]:
    """A cycle of a symmetric loop, and its mirror image: from one before, or else from starts `cold` (2,)."""
    at = LoopSection(with_gain(loop, parameter, value))
    known: list[Cycle] = []
    for point in [*(cycle.point for cycle in before), *np.column_stack([cold, np.zeros(2)])]:
        _add_with_mirror(known, settled(loop, parameter, value, point), at, _same(LoopSection(loop)))
        if known:
            break
    return known


def _decided(
    values: FloatArray, tables: FloatArray, first: FloatArray, starts: FloatArray
) -> list[list[Cycle]]:
    """The cycles at as many of the values (n,) as the kernel decides upon."""
    rows, verdicts = np.empty((values.size, COLUMNS)), np.empty(values.size, np.int64)
    sweep(map_kernels(tables[0]), values, tables, TOLERANCE, PATIENCE, first, starts, rows, verdicts)
    undecided = np.flatnonzero(verdicts == UNDECIDED)
    done = int(undecided[0]) if undecided.size else verdicts.size
    cycles = iter(_cycles(rows[:done][verdicts[:done] == FOUND]))
    return [
        [cycle] if verdict == FOUND and (cycle := next(cycles)).stable else []
        for verdict in verdicts[:done].tolist()
    ]


def _cycles(rows: FloatArray) -> list[Cycle]:
    """Rows of the kernel as symmetric cycles: two returns make a period, and x1 is largest at its ends."""
    slopes = rows[:, SLOPE:].reshape(-1, 2, 2)
    multipliers = np.linalg.eigvals(slopes @ slopes).astype(np.complex128)
    order = np.argsort(-np.abs(multipliers), axis=1)
    multipliers = np.take_along_axis(multipliers, order, axis=1)
    stable = np.abs(multipliers[:, 0]) < 1.0
    amplitudes = np.abs(rows[:, 0])
    columns = (amplitudes, 2.0 * rows[:, HALF_PERIOD], multipliers, stable)
    return [
        Cycle(point, 1, period, -amplitude, amplitude, tuple(largest_first), stable=is_stable)
        for point, amplitude, period, largest_first, is_stable in zip(
            rows[:, :2], *(column.tolist() for column in columns), strict=True
        )
    ]


def _searched(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, starts: FloatArray
) -> list[list[Cycle]]:
    """Of an asymmetric loop: from those before and from `starts` (n, 2) on both sides."""
    section = LoopSection(loop)
    found: list[list[Cycle]] = []
    for value, cold in zip(grid.tolist(), starts, strict=True):
        warm = [cycle.point for cycle in found[-1]] if found else []
        known: list[Cycle] = []
        for point in [*warm, *(np.array([x1, 0.0]) for size in cold for x1 in (size, -size))]:
            _add(known, settled(loop, parameter, value, point), _same(section))
        found.append(known)
    return found


def _has_mirror(cycle: Cycle, section: LoopSection) -> bool:
    """Whether the loop is symmetric and the cycle is not."""
    return cycle.returns % 2 == 0 and section.symmetric


def _same(section: LoopSection) -> float:
    """Relative difference of two cycles that are one."""
    return max(SAME_CYCLE, SAME_POINTS * section.accuracy)


def _add_with_mirror(
    known: list[Cycle], candidate: Cycle | NoCycle, section: LoopSection, same: float
) -> None:
    _add(known, candidate, same)
    if isinstance(candidate, Cycle) and _has_mirror(candidate, section):
        _add(known, mirrored(candidate, section), same)


def _add(known: list[Cycle], candidate: Cycle | NoCycle, same: float) -> None:
    if not isinstance(candidate, Cycle) or not candidate.stable or not math.isfinite(candidate.period):
        return
    if all(distance(candidate, cycle) > same for cycle in known):
        known.append(candidate)

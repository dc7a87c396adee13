"""The stable limit cycles of a closed loop at every value of a gain.

Cycles are followed upwards from value to value, beside new starts on both sides and far and near, and then
downwards from what was found: attractors that coexist are found too. A cycle of a symmetric loop that is not
symmetric itself has a mirror image, and both are given. A symmetric loop is swept by a kernel
(`loop_sweep`); what that leaves undecided, and asymmetric loops, are searched value by value.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_returns import carry_for
from compensation.loop_runs import run_for
from compensation.loop_section import PATIENCE, TOLERANCE, LoopSection, with_gain
from compensation.loop_sweep import COLUMNS, FOUND, HIGH, LOW, PERIOD, SLOPE, UNDECIDED, sweep
from compensation.loop_tables import Parameter, tables_over
from compensation.orbits.periodic_orbits import Cycle, NoCycle, find_cycle
from ident.simulation.filippov_system import FloatArray

STARTS: Final = (0.6, -0.6, 0.1, -0.1)  # x1(0) [rad] from which cycles are looked for
SAME_CYCLE: Final = 1e-6  # relative difference of extremes and period


def stable_cycles(loop: ClosedLoop, parameter: Parameter, grid: FloatArray) -> list[list[Cycle]]:
    """The stable cycles at each of the ascending values of a gain."""
    first = LoopSection(loop)
    found = (
        _swept(loop, parameter, grid, np.array([STARTS[0], 0.0]))
        if first.symmetric and first.by_series
        else _searched(loop, parameter, grid)
    )
    for index in range(grid.size - 2, -1, -1):
        here = found[index]
        for cycle in found[index + 1]:
            if len(here) < len(found[index + 1]) or all(cycle.returns != one.returns for one in here):
                _add(found[index], cycle_near(loop, parameter, float(grid[index]), cycle))
    return found


def cycle_near(loop: ClosedLoop, parameter: Parameter, value: float, cycle: Cycle) -> Cycle | NoCycle:
    """The cycle at a value of the gain to which another value's cycle leads."""
    section = LoopSection(with_gain(loop, parameter, value))
    if section.symmetric and section.by_series and cycle.returns == 1:
        (stable,) = _swept(loop, parameter, np.array([value]), cycle.point)
        return stable[0] if stable else NoCycle("leads to no stable cycle")
    found = find_cycle(section, cycle.point)
    if isinstance(found, Cycle) and _has_mirror(found, section):
        return min(found, mirrored(found, section), key=lambda one: distance(one, cycle))
    return found


def distance(one: Cycle, other: Cycle) -> float:
    """Relative difference of two cycles."""
    size = max(one.amplitude, other.amplitude)
    extremes = max(abs(one.x1_min - other.x1_min), abs(one.x1_max - other.x1_max)) / size
    return max(extremes, abs(one.period - other.period) / max(one.period, other.period))


def mirrored(cycle: Cycle, section: LoopSection) -> Cycle:
    """The mirror image of an asymmetric cycle of a symmetric loop: in its map, the other half turn."""
    (point,) = section.follow(cycle.point, 1).points
    return replace(cycle, point=point, x1_min=-cycle.x1_max, x1_max=-cycle.x1_min)


def _swept(loop: ClosedLoop, parameter: Parameter, grid: FloatArray, cold: FloatArray) -> list[list[Cycle]]:
    """Of a symmetric loop: at most one cycle a value, from the one before or else from `cold` (2,)."""
    tables = tables_over(loop.robot, loop.controller, parameter, grid)
    run, carried = run_for(tables[0]), carry_for(tables[0])
    found: list[list[Cycle]] = []
    while len(found) < grid.size:
        here = len(found)
        rows = np.empty((grid.size - here, COLUMNS))
        verdicts = np.empty(grid.size - here, np.int64)
        start = found[-1][0].point if found and found[-1] else cold
        sweep(run, carried, tables[here:], True, TOLERANCE, PATIENCE, start, cold, rows, verdicts)
        undecided = np.flatnonzero(verdicts == UNDECIDED)
        done = int(undecided[0]) if undecided.size else verdicts.size
        cycles = iter(_cycles(rows[:done][verdicts[:done] == FOUND]))
        found.extend(
            [cycle] if verdict == FOUND and (cycle := next(cycles)).stable else []
            for verdict in verdicts[:done].tolist()
        )
        if len(found) < grid.size:
            known: list[Cycle] = []
            point = found[-1][0].point if found and found[-1] else cold
            section = LoopSection(with_gain(loop, parameter, float(grid[len(found)])))
            _add_with_mirror(known, find_cycle(section, point), section)
            found.append(known)
    return found


def _cycles(rows: FloatArray) -> list[Cycle]:
    """Rows of the kernel as symmetric cycles: their period is two returns."""
    slopes = rows[:, SLOPE:].reshape(-1, 2, 2)
    multipliers = np.linalg.eigvals(slopes @ slopes).astype(np.complex128)
    order = np.argsort(-np.abs(multipliers), axis=1)
    multipliers = np.take_along_axis(multipliers, order, axis=1)
    cycles = []
    for row, largest_first, point in zip(rows.tolist(), multipliers.tolist(), rows[:, :2], strict=True):
        amplitude = max(row[HIGH], -row[LOW])
        cycles.append(
            Cycle(
                point=point,
                returns=1,
                period=2.0 * row[PERIOD],
                x1_min=-amplitude,
                x1_max=amplitude,
                multipliers=tuple(largest_first),
                stable=abs(largest_first[0]) < 1.0,
            )
        )
    return cycles


def _searched(loop: ClosedLoop, parameter: Parameter, grid: FloatArray) -> list[list[Cycle]]:
    found: list[list[Cycle]] = []
    for value in grid.tolist():
        section = LoopSection(with_gain(loop, parameter, value))
        known: list[Cycle] = []
        warm = [cycle.point for cycle in found[-1]] if found else []
        cold = STARTS[:1] if section.symmetric else STARTS
        for point in warm:
            _add_with_mirror(known, find_cycle(section, point), section)
        if not (section.symmetric and warm):
            for x1 in cold:
                _add_with_mirror(known, find_cycle(section, np.array([x1, 0.0])), section)
        found.append(known)
    return found


def _has_mirror(cycle: Cycle, section: LoopSection) -> bool:
    """Whether the loop is symmetric and the cycle is not."""
    return section.symmetric and cycle.returns % 2 == 0


def _add_with_mirror(known: list[Cycle], candidate: Cycle | NoCycle, section: LoopSection) -> None:
    _add(known, candidate)
    if isinstance(candidate, Cycle) and _has_mirror(candidate, section):
        _add(known, mirrored(candidate, section))


def _add(known: list[Cycle], candidate: Cycle | NoCycle) -> None:
    if not isinstance(candidate, Cycle) or not candidate.stable or not math.isfinite(candidate.period):
        return
    if all(distance(candidate, cycle) > SAME_CYCLE for cycle in known):
        known.append(candidate)

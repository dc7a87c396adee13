"""Branches of equilibria and limit cycles over the compensation gain r or the observer gain L: figure 9.

For every value of the parameter the equilibrium sets come from their closed form (`rest_pieces`) and
the limit cycles from the return map on v = 0 (`loop_cycles`). A branch of cycles ends where the return map
jumps, and of a cycle without the loop's symmetry its mirror image is a branch of its own. The points at which
branches begin, end and change are refined (`cycle_changes`). Where no cycle was found because the motion is
not resolved, a note says so.

Amplitude is max|x1| over a period, everywhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Gains
from compensation.cycle_chains import Chain, chained
from compensation.cycle_changes import changes_of_cycles, cut_at_jumps
from compensation.loop_cycles import stable_cycles
from compensation.loop_parameters import own_time
from compensation.loop_section import PATIENCE, LoopSection, with_gain
from compensation.loop_starts import start_sizes
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import DECAYS, VANISHED, Cycle, find_cycle
from compensation.orbits.steady_state import SteadyState, classify
from compensation.rest_pieces import (
    SET_POINT,
    PieceName,
    Pieces,
    change_between,
    present,
    rest_pieces,
)
from ident.model.doors import expect
from ident.model.friction import ModelError
from ident.model.numbers import is_one_of, real_array, shown
from ident.simulation.filippov_system import FloatArray
from ident.simulation.integrate import END_REASONS, EQUILIBRIUM

Kind = Literal["equilibrium_set", "equilibrium", "limit_cycle"]

ONE_CHANGE: Final = 1e-9  # relative distance at which two changes are one
SETTLED: Final = (END_REASONS[EQUILIBRIUM], DECAYS)  # on no cycle
SAMPLES: Final = 4000  # of a trajectory that is classified by its samples


@dataclass(frozen=True)
class Point:
    """One attractor, or equilibrium, at one value of the parameter."""

    value: float  # of the parameter: r [-] or L [1/s]
    x1_min: float  # [rad]
    x1_max: float  # [rad]
    amplitude: float  # [rad] max|x1|
    period: float | None = None  # [s]
    multipliers: tuple[complex, ...] = ()


@dataclass(frozen=True)
class Branch:
    """Points that continue each other."""

    kind: Kind
    stable: bool
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Bifurcation:
    """A value at which something appears or vanishes."""

    value: float  # of the parameter: r [-] or L [1/s]
    kind: str


@dataclass(frozen=True)
class Diagram:
    """All branches over the values of a parameter."""

    parameter: Parameter
    gains: Gains  # the others are as here
    branches: tuple[Branch, ...]
    bifurcations: tuple[Bifurcation, ...]
    notes: tuple[str, ...] = ()  # what could not be resolved


def diagram(loop: ClosedLoop, parameter: Parameter, values: ArrayLike) -> Diagram:
    """The bifurcation diagram over `values` (n,) of r [-] or L [1/s], the other gains as in the loop.

    Raises
    ------
    ModelError
        If the parameter is unknown, or the values are no ascending finite numbers >= 0.
    """
    expect("loop", loop, ClosedLoop, "eq 8")
    if not is_one_of(parameter, ("r", "L")):
        raise ModelError(f"parameter is {shown(parameter)}: a diagram is drawn over 'r' or 'L' (eqs 6-7)")
    grid = real_array(values)
    if grid is None or grid.ndim != 1 or grid.size == 0 or not np.isfinite(grid).all():
        raise ModelError(f"values of {parameter} are {shown(values)}: a list of finite numbers (eqs 6-7)")
    backwards = np.flatnonzero(np.diff(grid) <= 0)
    if backwards.size:
        one, other = grid[backwards[0] : backwards[0] + 2]
        raise ModelError(f"values of {parameter} must ascend: {other:g} follows {one:g} (eqs 6-7)")
    with_gain(loop, parameter, float(grid[0]))  # refuses what is no gain
    pieces = rest_pieces(loop, parameter, grid)
    changes = list(_changes_of_equilibria(loop, parameter, grid, pieces))
    births = [change.value for change in changes]
    found = chained(stable_cycles(loop, parameter, grid))
    chains = cut_at_jumps(loop, parameter, grid, found, births)
    cycles = [_cycle_branch(chain, grid) for chain in chains]
    bifurcations = [
        *changes,
        *(Bifurcation(c.value, c.kind) for c in changes_of_cycles(loop, parameter, grid, chains, births)),
    ]
    return Diagram(
        parameter=parameter,
        gains=loop.controller.gains,
        branches=(*_equilibrium_branches(grid, pieces), *cycles),
        bifurcations=tuple(sorted(bifurcations, key=lambda item: item.value)),
        notes=tuple(_unresolved(loop, parameter, grid, chains)),
    )


def _unresolved(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, chains: Sequence[Chain]
) -> Iterator[str]:
    """What is said of ranges without a cycle whose motion neither repeats, nor rests, nor decays.

    Both ends of a range and its middle are looked at.
    """
    without = np.ones(grid.size, bool)
    for chain in chains:
        without[chain.first : chain.last + 1] = False
    there = np.flatnonzero(without)
    starts = start_sizes(loop, parameter, grid)
    for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
        for index in np.unique(run[[0, run.size // 2, -1]]).tolist() if run.size else ():
            value = float(grid[index])
            why = _does_not_settle(with_gain(loop, parameter, value), float(starts[index, 0]))
            if why is not None:
                yield (
                    f"no limit cycle is drawn from {parameter} = {grid[run[0]]:.6g} to {grid[run[-1]]:.6g}, "
                    f"but there may be one: at {value:.6g} the motion is not resolved ({why})"
                )
                break


def _does_not_settle(loop: ClosedLoop, x1: float) -> str | None:
    """Why the motion from x1 [rad] is seen neither to repeat, nor to rest, nor to decay; None where it is."""
    found = find_cycle(LoopSection(loop), np.array([x1, 0.0]))
    if isinstance(found, Cycle) or found.end_reason in SETTLED:
        return None
    run = simulate(loop, (x1, 0.0, 0.0), duration=PATIENCE * own_time(loop.modes), times=())
    decayed = run.end_reason == "time reached" and abs(run.end_state[0]) <= VANISHED * abs(x1)
    return None if decayed or run.end_reason == "equilibrium" else found.end_reason


def where_it_ends(loop: ClosedLoop, start: ArrayLike, *, duration: float) -> SteadyState:
    """Where the trajectory from `start` (3,) ends up, followed for `duration` [s] at most: the ideal loop.

    Exact where the link comes to rest for good, or repeats; a trajectory that does neither in time is
    judged by its samples, as a recorded one is.
    """
    trajectory = simulate(loop, start, duration=duration, times=())
    if trajectory.end_reason == "equilibrium":
        rest = float(trajectory.end_state[0])
        return SteadyState("equilibrium", rest, None, None, f"rests after {trajectory.end_time:.4g} s")
    halts = [event for event in trajectory.events if event.kind in ("stick", "velocity reversal")]
    if halts:
        point = halts[-1].state[:2]
        cycle = find_cycle(LoopSection(loop), point)
        if isinstance(cycle, Cycle) and cycle.stable and _is_on(cycle, [e.state[0] for e in halts[-4:]]):
            why = f"repeats every {cycle.period:.4g} s"
            return SteadyState("limit_cycle", None, cycle.amplitude, cycle.period, why)
    times = np.linspace(0.0, duration, SAMPLES)
    sampled = simulate(loop, start, duration=duration, times=times)
    return classify(sampled.time, sampled.state[:, 0])


def _is_on(cycle: Cycle, extremes: Sequence[float]) -> bool:
    slack = 0.02 * cycle.amplitude
    return all(cycle.x1_min - slack <= x1 <= cycle.x1_max + slack for x1 in extremes)


def _cycle_branch(chain: Chain, grid: FloatArray) -> Branch:
    values = grid[chain.first : chain.last + 1]
    points = [
        Point(float(value), c.x1_min, c.x1_max, c.amplitude, c.period, c.multipliers)
        for value, c in zip(values, chain.cycles, strict=True)
    ]
    return Branch("limit_cycle", True, tuple(points))


def _equilibrium_branches(grid: FloatArray, pieces: Pieces) -> list[Branch]:
    """Equilibrium sets, piece by piece, and the set point where it stands alone."""
    branches: list[Branch] = []
    for (name, stable), ranges in pieces.items():
        kind: Kind = "equilibrium" if name == SET_POINT else "equilibrium_set"
        there = np.flatnonzero(~np.isnan(ranges[:, 0]))
        for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
            amplitudes = np.max(np.abs(ranges[run]), axis=1)
            columns = (grid[run], *ranges[run].T, amplitudes)
            points = tuple(map(Point, *(column.tolist() for column in columns)))
            branches.append(Branch(kind, stable, points))
    return sorted(branches, key=lambda branch: branch.points[0].value)


def _changes_of_equilibria(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, pieces: Pieces
) -> Iterator[Bifurcation]:
    """Where pieces of the equilibrium set appear, vanish or leave the set point, by bisection.

    Changes within rounding of each other are one: a grid value may lie on the change itself.
    """
    there = np.array([~np.isnan(ranges[:, 0]) for ranges in pieces.values()])
    changes: list[tuple[float, frozenset[PieceName], frozenset[PieceName]]] = []
    for index in np.flatnonzero(np.any(there[:, 1:] != there[:, :-1], axis=0)).tolist():
        before, last = present(pieces, index), present(pieces, index + 1)
        low, high = grid[index : index + 2].tolist()
        while before != last:
            change = change_between(loop, parameter, low, high)
            low = change + ONE_CHANGE * change
            after = last if low >= high else present(rest_pieces(loop, parameter, np.array([low])), 0)
            if changes and change - changes[-1][0] <= ONE_CHANGE * change:
                change, before, _ = changes.pop()
            if before != after:
                changes.append((change, before, after))
            before = after
    for value, first, last in changes:
        gone = ", ".join(sorted(name for name, _ in first - last)) or "none"
        new = ", ".join(sorted(name for name, _ in last - first)) or "none"
        yield Bifurcation(value, f"equilibria change: {gone} ends, {new} begins")

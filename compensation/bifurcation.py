"""Branches of equilibria and limit cycles over the compensation gain r or the observer gain L: figure 9.

For every value of the parameter the equilibrium sets come from their closed form and the limit cycles
from the return map on v = 0. A cycle is continued from one value to the next: where the map is
superstable that takes two or three returns. New branches are looked for from large and small deviations
on both sides, upwards and downwards in the parameter, so that attractors that coexist are found too.
The points at which branches begin and end are refined by bisection.

Amplitude is max|x1| over a period, everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Gains
from compensation.equilibria import equilibrium_set
from compensation.loop_section import LoopSection, with_gain
from compensation.orbits.periodic_orbits import Cycle, NoCycle, find_cycle
from compensation.orbits.steady_state import SteadyState, classify
from ident.model.friction import ModelError
from ident.simulation.filippov_system import FloatArray

Parameter = Literal["r", "L"]
Kind = Literal["equilibrium_set", "equilibrium", "limit_cycle"]

SET_POINT: Final = "set point"
STARTS: Final = (0.6, -0.6, 0.1, -0.1)  # x1(0) [rad] from which cycles are looked for
SAME_CYCLE: Final = 1e-6  # relative difference of extremes and period
ONE_CHANGE: Final = 1e-9  # relative distance at which two changes are one
EQUILIBRIUM_REFINEMENTS: Final = 45
REFINEMENTS: Final = 12  # bisections of the ends of a branch
CONTINUOUS: Final = 0.25  # amplitude at an onset, relative to the next point, below which it grows from zero
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


def diagram(loop: ClosedLoop, parameter: Parameter, values: ArrayLike) -> Diagram:
    """The bifurcation diagram over `values` (n,) of r [-] or L [1/s], the other gains as in the loop.

    Raises
    ------
    ModelError
        If the parameter is unknown, or the values are no ascending finite numbers >= 0.
    """
    if parameter not in ("r", "L"):
        raise ModelError(f"parameter is {parameter!r}: a diagram is drawn over 'r' or 'L'")
    grid = np.asarray(values, dtype=np.float64)
    if grid.ndim != 1 or grid.size == 0 or not np.all(np.isfinite(grid)) or np.any(np.diff(grid) <= 0):
        raise ModelError(f"values of {parameter} must be finite and ascending")
    loops = [with_gain(loop, parameter, float(value)) for value in grid]
    chains = _cycle_branches(loops)
    cycles = [_cycle_branch(chain, grid) for chain in chains]
    rests = _equilibrium_branches(loops, grid)
    bifurcations = [
        *_ends_of_cycles(loop, parameter, grid, chains),
        *_changes_of_equilibria(loop, parameter, grid),
    ]
    return Diagram(
        parameter=parameter,
        gains=loop.controller.gains,
        branches=(*rests, *cycles),
        bifurcations=tuple(sorted(bifurcations, key=lambda item: item.value)),
    )


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


def _cycle_branches(loops: Sequence[ClosedLoop]) -> list[Chain]:
    """Stable cycles by branch: followed upwards with new starts, then downwards from what was found."""
    sections = [LoopSection(loop) for loop in loops]
    starts = [np.array([x1, 0.0]) for x1 in (STARTS[:1] if sections[0].symmetric else STARTS)]
    found: list[list[Cycle]] = []
    for section in sections:
        known: list[Cycle] = []
        warm = [cycle.point for cycle in found[-1]] if found else []
        for point in (*warm, *(starts if not (section.symmetric and warm) else ())):
            _add(known, find_cycle(section, point))
        found.append(known)
    for index in range(len(sections) - 2, -1, -1):
        for cycle in found[index + 1]:
            if len(found[index]) < len(found[index + 1]):
                _add(found[index], find_cycle(sections[index], cycle.point))
    return chained(found)


def _add(known: list[Cycle], candidate: Cycle | NoCycle) -> None:
    if not isinstance(candidate, Cycle) or not candidate.stable:
        return
    if all(_distance(candidate, cycle) > SAME_CYCLE for cycle in known):
        known.append(candidate)


def _distance(one: Cycle, other: Cycle) -> float:
    """Relative difference of two cycles."""
    size = max(one.amplitude, other.amplitude)
    extremes = max(abs(one.x1_min - other.x1_min), abs(one.x1_max - other.x1_max)) / size
    return max(extremes, abs(one.period - other.period) / max(one.period, other.period))


@dataclass(frozen=True)
class Chain:
    """A branch of cycles over consecutive values of the grid."""

    first: int  # index of the first value
    cycles: list[Cycle]

    @property
    def last(self) -> int:
        """Index of the last value."""
        return self.first + len(self.cycles) - 1


def chained(found: Sequence[Sequence[Cycle]]) -> list[Chain]:
    """Cycles at consecutive values, joined to branches: each branch goes on with the nearest cycle left."""
    chains: list[Chain] = []
    for index, cycles in enumerate(found):
        free = list(cycles)
        for chain in [chain for chain in chains if chain.last == index - 1]:
            if free:
                last = chain.cycles[-1]
                distances = [_distance(cycle, last) for cycle in free]
                chain.cycles.append(free.pop(distances.index(min(distances))))
        chains.extend(Chain(index, [cycle]) for cycle in free)
    return chains


def _cycle_branch(chain: Chain, grid: FloatArray) -> Branch:
    values = grid[chain.first : chain.last + 1]
    points = [
        Point(float(value), c.x1_min, c.x1_max, c.amplitude, c.period, c.multipliers)
        for value, c in zip(values, chain.cycles, strict=True)
    ]
    return Branch("limit_cycle", True, tuple(points))


def _ends_of_cycles(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, chains: Sequence[Chain]
) -> Iterator[Bifurcation]:
    """Where branches of cycles begin or end inside the grid, by bisection."""
    for chain in chains:
        for inner, outer in ((chain.first, chain.first - 1), (chain.last, chain.last + 1)):
            if not 0 <= outer < grid.size:
                continue
            begins = outer < inner
            cycle = chain.cycles[0 if begins else -1]
            size = cycle.amplitude
            good, bad = float(grid[inner]), float(grid[outer])
            for _ in range(REFINEMENTS):
                middle = 0.5 * (good + bad)
                next_cycle = find_cycle(LoopSection(with_gain(loop, parameter, middle)), cycle.point)
                if isinstance(next_cycle, Cycle) and next_cycle.stable:
                    good, cycle = middle, next_cycle
                else:
                    bad = middle
            small = cycle.amplitude < CONTINUOUS * size
            word = "appears" if begins else "vanishes"
            yield Bifurcation(
                good, f"limit cycle {word}, {'from zero amplitude' if small else 'with a jump'}"
            )


def _equilibrium_branches(loops: Sequence[ClosedLoop], grid: FloatArray) -> list[Branch]:
    """Equilibrium sets, piece by piece, and the set point where it stands alone."""
    open_branches: dict[tuple[str, bool], list[Point]] = {}
    branches: list[Branch] = []

    def close(key: tuple[str, bool]) -> None:
        kind: Kind = "equilibrium" if key[0] == SET_POINT else "equilibrium_set"
        branches.append(Branch(kind, key[1], tuple(open_branches.pop(key))))

    for loop, value in zip(loops, grid, strict=True):
        pieces = _pieces(loop)
        for key in [key for key in open_branches if key not in pieces]:
            close(key)
        for key, (low, high) in pieces.items():
            point = Point(float(value), low, high, max(abs(low), abs(high)))
            open_branches.setdefault(key, []).append(point)
    for key in list(open_branches):
        close(key)
    return sorted(branches, key=lambda branch: branch.points[0].value)


def _pieces(loop: ClosedLoop) -> dict[tuple[str, bool], tuple[float, float]]:
    """Ranges of x1 by (name, stable): what touches the set point as one piece, the rest one by one."""
    equilibria = equilibrium_set(loop.robot, loop.controller)
    pieces: dict[tuple[str, bool], tuple[float, float]] = {}
    touching = [segment for segment in equilibria.segments if segment.touches_zero]
    if touching:
        low = min(0.0, *(segment.x1_min for segment in touching))
        pieces["around the set point", True] = (low, max(0.0, *(segment.x1_max for segment in touching)))
    else:
        pieces[SET_POINT, not _pushed_away(loop)] = (0.0, 0.0)
    for number, segment in enumerate(s for s in equilibria.segments if not s.touches_zero):
        pieces[f"{segment.direction} {number}", True] = (segment.x1_min, segment.x1_max)
    return pieces


def _pushed_away(loop: ClosedLoop) -> bool:
    """Whether the compensation exceeds the static friction in a direction: the set point is then unstable."""
    r = loop.controller.gains.compensation
    true, model = loop.robot.friction, loop.controller.model.friction
    return (
        r * model.positive.static_torque > true.positive.static_torque
        or r * model.negative.static_torque > true.negative.static_torque
    )


def _changes_of_equilibria(loop: ClosedLoop, parameter: Parameter, grid: FloatArray) -> Iterator[Bifurcation]:
    """Where pieces of the equilibrium set appear, vanish or leave the set point, by bisection.

    Changes within rounding of each other are one: a grid value may lie on the change itself.
    """

    def names(value: float) -> frozenset[tuple[str, bool]]:
        return frozenset(_pieces(with_gain(loop, parameter, value)))

    changes: list[tuple[float, frozenset[tuple[str, bool]], frozenset[tuple[str, bool]]]] = []
    before = names(float(grid[0]))
    for low, high in itertools.pairwise(map(float, grid)):
        after = names(high)
        if after != before:
            good, bad = low, high
            for _ in range(EQUILIBRIUM_REFINEMENTS):
                middle = 0.5 * (good + bad)
                good, bad = (middle, bad) if names(middle) == before else (good, middle)
            first = before
            if changes and bad - changes[-1][0] <= ONE_CHANGE * abs(bad):
                bad, first, _ = changes.pop()
            changes.append((bad, first, after))
        before = after
    for value, first, last in changes:
        gone = ", ".join(sorted(name for name, _ in first - last)) or "none"
        new = ", ".join(sorted(name for name, _ in last - first)) or "none"
        yield Bifurcation(value, f"equilibria change: {gone} ends, {new} begins")

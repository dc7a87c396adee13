"""What happens to the cycles of a diagram between its values: ends, jumps, losses of symmetry, other modes.

A chain of cycles is cut where it hides a jump of the return map: halving the interval, always on into the
half in which the cycle changes more, leaves the change what it was. The ends of what remains are found by
bisection and named by what the motion settles on beyond: nothing, or other cycles. In between, the mode
sequence (see `cycle_modes`) is read at some of the values; where it differs, the change is located.

A mode sequence that changes and changes back between two readings, with no step off the trend, is missed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.cycle_chains import Chain, parted, suspects
from compensation.cycle_modes import events_of, mode_sequence, parting
from compensation.loop_cycles import cycle_near, distance
from compensation.loop_ends import LOCATED, CycleAt, WayToEnd, between, fineness, towards_the_end
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import Cycle, is_undecided
from ident.simulation.filippov_system import FloatArray

HALVINGS: Final = 12  # of an interval that may hold a jump
STAYED: Final = 0.15  # of the change over the interval, that a jump leaves of it
SAME_RETURN: Final = 0.25  # relative step of the section's point, above which it may be another return
READINGS: Final = 32  # values from one reading of the mode sequence to the next
BESIDE_NOTHING: Final = ("limit cycle appears", "limit cycle vanishes")
SEEN_TWICE: Final = 4.0  # times the accuracy of a change: so near two of a kind are one
LOSES_STABILITY: Final = 0.9  # of a multiplier: so near to 1 the cycle ends by it, and by no graze
DOUBLED: Final = 0.01  # relative difference of extremes just beyond a doubling of the period
ROUNDING: Final = 1e-9  # relative difference of x1_max and -x1_min of mirror images

Place = tuple[float, Cycle]
"""A value of the gain and a cycle there."""


@dataclass(frozen=True)
class Change:
    """Something that happens to cycles at a value of the gain."""

    value: float  # r [-] or L [1/s]
    kind: str

    @property
    def name(self) -> str:
        """The kind without how the motion parts there."""
        return self.kind.partition(":")[0]


def cut_at_jumps(
    loop: ClosedLoop,
    parameter: Parameter,
    grid: FloatArray,
    chains: Sequence[Chain],
    births: Sequence[float] = (),
) -> list[Chain]:
    """The chains, parted where two neighbours in a chain do not continue each other.

    `births` are values at which cycles may be born: where the equilibria change.
    """
    whole: list[Chain] = []
    for chain in chains:
        places = list(zip(grid[chain.first : chain.last + 1].tolist(), chain.cycles, strict=True))
        cuts = [i for i in suspects(chain, grid) if _jumps(loop, parameter, places[i], places[i + 1], births)]
        whole.extend(parted(chain, cuts))
    return whole


def _jumps(loop: ClosedLoop, parameter: Parameter, low: Place, high: Place, births: Sequence[float]) -> bool:
    """Whether the change between two cycles happens at once."""
    first = distance(low[1], high[1])
    for _ in range(HALVINGS):
        middle = between(low[0], high[0], births)
        found = next(
            (
                cycle
                for _, known in (low, high)
                if isinstance(cycle := cycle_near(loop, parameter, middle, known), Cycle) and cycle.stable
            ),
            None,
        )
        if found is None:
            return True
        if distance(low[1], found) >= distance(found, high[1]):
            high = (middle, found)
        else:
            low = (middle, found)
        if distance(low[1], high[1]) < STAYED * first:
            return False
    return True


def changes_of_cycles(
    loop: ClosedLoop,
    parameter: Parameter,
    grid: FloatArray,
    chains: Sequence[Chain],
    births: Sequence[float] = (),
) -> Iterator[Change]:
    """What happens within the grid to chains that hide no jumps, in no order; each change once.

    `births` are values at which cycles may be born: where the equilibria change.
    """
    ends: list[_End] = []
    changes: list[Change] = []
    for number, chain in enumerate(chains):
        if any(_are_mirrored(chain, other) for other in chains[:number]):
            continue
        ends.extend(_ends(loop, parameter, grid, chain, chains, births))
        changes.extend(_changes_of_modes(loop, parameter, grid, chain))
    changes.extend(end.change for end in ends if not any(_is_told_by(end, other) for other in ends))
    widest = float(np.max(np.diff(grid), initial=0.0))
    for index, change in enumerate(changes):
        near = SEEN_TWICE * fineness(change.value, change.value, widest)
        if not any(change.name == c.name and abs(change.value - c.value) <= near for c in changes[:index]):
            yield change


@dataclass(frozen=True)
class _End:
    """The end of a chain between two values of the grid."""

    change: Change
    interval: int  # the lower index of the two
    side: int  # of the chain from there: 1 upwards, -1 downwards
    returns: int  # of its last cycle


def _is_told_by(end: _End, other: _End) -> bool:
    """Whether an end is the other side of what the end of a chain of fewer returns is called.

    Where both chains reach to each other or beyond, what happens between them is one event, with hysteresis.
    """
    if end.interval != other.interval or end.side == other.side or end.change.name != other.change.name:
        return False
    gap = end.side * (end.change.value - other.change.value)
    near = SEEN_TWICE * LOCATED * abs(end.change.value)
    return gap <= near and (end.returns, end.side) > (other.returns, other.side)


def _are_mirrored(one: Chain, other: Chain) -> bool:
    """Whether two chains are mirror images: all that happens to one happens to the other."""
    (low, high), (other_low, other_high) = (
        (chain.cycles[0].x1_min, chain.cycles[0].x1_max) for chain in (one, other)
    )
    same = one.first == other.first and one.last == other.last
    return same and max(abs(low + other_high), abs(high + other_low)) <= ROUNDING * (high - low)


def _ends(
    loop: ClosedLoop,
    parameter: Parameter,
    grid: FloatArray,
    chain: Chain,
    chains: Sequence[Chain],
    births: Sequence[float],
) -> Iterator[_End]:
    for inner, outer, inwards in ((chain.first, chain.first - 1, 1), (chain.last, chain.last + 1, -1)):
        if not 0 <= outer < grid.size:
            continue
        others = [
            (float(grid[outer]), other.cycles[outer - other.first])
            for other in chains
            if other.first <= outer <= other.last
        ]
        last = _Last(float(grid[inner]), chain.cycles[inner - chain.first])
        if len(chain.cycles) > 1:
            next_one = chain.cycles[inner - chain.first + inwards]
            last = last.after((float(grid[inner + inwards]), next_one))
        changes = (
            [_at_others(loop, parameter, last, others, births)]
            if others
            else _at_nothing(loop, parameter, last, float(grid[outer]), births)
        )
        for change in changes:
            yield _End(change, min(inner, outer), inwards, last.cycle.returns)


def _at_nothing(
    loop: ClosedLoop, parameter: Parameter, last: _Last, outer: float, births: Sequence[float]
) -> Iterator[Change]:
    """The end of a chain at a value with no cycles, and how it changes on the way there."""
    way = towards_the_end(loop, parameter, (last.value, outer), last.cycle, births)
    yield _beside_nothing(way, outer)
    begun = last
    for one, other in pairwise(way.passed):
        if one.cycle.returns != other.cycle.returns:
            change = _at_others(loop, parameter, begun, [(other.value, other.cycle)], births)
            yield change
            if change.name.startswith(BESIDE_NOTHING):  # what is beyond the gap ends here, too
                beyond = _Last(other.value, other.cycle)
                yield _at_others(loop, parameter, beyond, [(one.value, one.cycle)], births)
        begun = _Last(other.value, other.cycle).after((one.value, one.cycle))


def _at_others(
    loop: ClosedLoop, parameter: Parameter, last: _Last, others: Sequence[Place], births: Sequence[float]
) -> Change:
    """The end of a chain at a value with others.

    A cycle found in between is on the chain if it takes as many returns and is nearer to the chain's trend
    than to the others. From far off the motion may miss a chain that goes on: the end is one only if from
    right beside it there is no going on either.
    """
    limit = bad = others[0][0]
    width = abs(limit - last.value)
    way, known = [last], list(others)
    beyond: list[Place | None] = [min(known, key=lambda other: distance(other[1], last.cycle))]

    def inside(value: float) -> bool:
        return min(last.value, limit) < value < max(last.value, limit)

    def goes_on(value: float) -> bool:
        found = cycle_near(loop, parameter, value, way[-1].guess(value))
        if not isinstance(found, Cycle) or not found.stable:
            goes_elsewhere = isinstance(found, Cycle) or is_undecided(found)
            beyond.append(min(known, key=lambda other: abs(other[0] - value)) if goes_elsewhere else None)
            return False
        off, alike = way[-1].off_trend(value, found), found.returns == last.cycle.returns
        if not alike or any(c.returns == found.returns and distance(found, c) < off for _, c in known):
            known.append((value, found))
            beyond.append(known[-1])
            return False
        way.append(_Last(value, found).after((way[-1].value, way[-1].cycle)))
        return True

    while True:
        here = way[-1].value
        if abs(bad - here) > fineness(bad, here, width):
            value = between(here, bad, births)
            if not goes_on(value):
                bad = value
            continue
        step = 2.0 * (bad - here)
        if not (inside(here + step) and goes_on(here + step)):
            break
        while inside(way[-1].value + 2.0 * step) and goes_on(way[-1].value + 2.0 * step):
            step *= 2.0
        bad = way[-1].value + 2.0 * step
        if not inside(bad):
            bad = limit
    end = way[-1]
    if beyond[-1] is None:
        passed = [CycleAt(last.value, last.cycle), CycleAt(end.value, end.cycle)]
        return _beside_nothing(WayToEnd(passed, end.value), bad)
    return Change(end.value, _name(loop, parameter, (end.value, end.cycle), beyond[-1]))


def _beside_nothing(way: WayToEnd, outer: float) -> Change:
    """The name of an end beyond which the motion finds no cycle."""
    what = BESIDE_NOTHING[0 if outer < way.passed[0].value else 1]
    return Change(way.end, f"{what}, {'from zero amplitude' if way.shrinks else 'with a jump'}")


@dataclass(frozen=True)
class _Last:
    """The last cycle that is known to be on a chain, and how the chain goes on from there."""

    value: float  # r [-] or L [1/s]
    cycle: Cycle
    slope: FloatArray | None = None  # (5,) of x1_min [rad], x1_max, period [s] and the point, by the gain

    def after(self, before: Place) -> _Last:
        """The same, with the slope from the one before."""
        value, cycle = before
        return replace(self, slope=(_row(self.cycle) - _row(cycle)) / (self.value - value))

    def off_trend(self, value: float, found: Cycle) -> float:
        """Relative difference of a cycle at another value from the trend."""
        expected = _row(self.cycle)
        if self.slope is not None:
            expected = expected + self.slope * (value - self.value)
        off = np.abs(_row(found) - expected)[:3]
        return float(np.max(off / np.array([found.amplitude, found.amplitude, found.period])))

    def guess(self, value: float) -> Cycle:
        """Where to look for the cycle at another value: on the trend, where both points are of one return."""
        if self.slope is None:
            return self.cycle
        step = self.slope[3:] * (value - self.value)
        near = float(np.max(np.abs(step))) <= SAME_RETURN * float(np.max(np.abs(self.cycle.point)))
        return replace(self.cycle, point=self.cycle.point + step) if near else self.cycle


def _row(cycle: Cycle) -> FloatArray:
    return np.array([cycle.x1_min, cycle.x1_max, cycle.period, *cycle.point])


def _name(loop: ClosedLoop, parameter: Parameter, last: Place, beyond: Place) -> str:
    """What an end at another cycle is, and how the motion parts there."""
    (value, cycle), (at, other) = last, beyond
    fewer, more = sorted((cycle.returns, other.returns))
    name = "limit cycle jumps"
    even = LoopSection(loop).symmetric
    if even and fewer % 2 != more % 2:  # an odd number of half turns makes a symmetric cycle
        name = "symmetry breaking"
    elif more == 2 * fewer and distance(replace(cycle, period=other.period), other) < DOUBLED:
        name = "period doubling"
    if abs(cycle.multipliers[0]) > LOSES_STABILITY:
        return name
    here, there = (
        events_of(with_gain(loop, parameter, gain), cycle.point, cycle.period) for gain in (value, at)
    )
    graze = parting(here, there, cycle.period)
    return name if graze is None else f"{name}: {graze}"


def _changes_of_modes(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, chain: Chain
) -> Iterator[Change]:
    """Where the mode sequence of a chain changes while its cycles go on."""
    places = list(zip(grid[chain.first : chain.last + 1].tolist(), chain.cycles, strict=True))
    section = LoopSection(loop)
    stride = READINGS if section.symmetric and section.by_series else 1
    readings = [*range(0, len(places) - 1, stride), len(places) - 1]

    @cache
    def read(index: int) -> tuple[str, ...]:
        return _modes(loop, parameter, places[index])

    todo = list(pairwise(readings))
    while todo:
        low, high = todo.pop()
        if read(low) == read(high):
            continue
        if high - low > 1:
            middle = (low + high) // 2
            todo.extend([(low, middle), (middle, high)])
        else:
            yield _change_of_modes(loop, parameter, places[low], places[high])


def _change_of_modes(loop: ClosedLoop, parameter: Parameter, low: Place, high: Place) -> Change:
    first, last = (_modes(loop, parameter, place) for place in (low, high))
    width = high[0] - low[0]
    while high[0] - low[0] > fineness(low[0], high[0], width):
        middle = 0.5 * (low[0] + high[0])
        found = cycle_near(loop, parameter, middle, low[1])
        if not isinstance(found, Cycle):
            break
        if _modes(loop, parameter, (middle, found)) == first:
            low = (middle, found)
        else:
            high = (middle, found)
    return Change(high[0], f"mode sequence: {', '.join(first)} becomes {', '.join(last)}")


def _modes(loop: ClosedLoop, parameter: Parameter, place: Place) -> tuple[str, ...]:
    """The mode sequence of a cycle, whichever of its returns it begins with."""
    value, cycle = place
    modes = mode_sequence(events_of(with_gain(loop, parameter, value), cycle.point, cycle.period))
    return min((modes[k:] + modes[:k] for k in range(len(modes))), default=())

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
from compensation.loop_ends import towards_the_end
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import Cycle
from ident.simulation.filippov_system import FloatArray

HALVINGS: Final = 12  # of an interval that may hold a jump
STAYED: Final = 0.15  # of the change over the interval, that a jump leaves of it
LOCATED: Final = 1e-5  # of an interval, to which an end at other cycles or a change of modes is located
RESOLVED: Final = 4e-16  # relative difference of numbers that can just be told apart
LOCATED_IN_PASSING: Final = 2.5e-4  # the same of a change between two values of which one has no cycle
SAME_RETURN: Final = 0.25  # relative step of the section's point, above which it may be another return
CONTINUOUS: Final = 0.25  # amplitude at an onset, relative to the next point, below which it grows from zero
READINGS: Final = 32  # values from one reading of the mode sequence to the next
ONE: Final = 1e-3  # of an interval: so near two changes of a kind are one
DOUBLED: Final = 0.01  # relative difference of extremes just beyond a doubling of the period
ROUNDING: Final = 1e-9  # relative difference of x1_max and -x1_min of mirror images

Place = tuple[float, Cycle]
"""A value of the gain and a cycle there."""


@dataclass(frozen=True)
class Change:
    """Something that happens to cycles at a value of the gain."""

    value: float  # r [-] or L [1/s]
    kind: str


def cut_at_jumps(
    loop: ClosedLoop, parameter: Parameter, grid: FloatArray, chains: Sequence[Chain]
) -> list[Chain]:
    """The chains, parted where two neighbours in a chain do not continue each other."""
    whole: list[Chain] = []
    for chain in chains:
        places = list(zip(grid[chain.first : chain.last + 1].tolist(), chain.cycles, strict=True))
        cuts = [i for i in suspects(chain, grid) if _jumps(loop, parameter, places[i], places[i + 1])]
        whole.extend(parted(chain, cuts))
    return whole


def _jumps(loop: ClosedLoop, parameter: Parameter, low: Place, high: Place) -> bool:
    """Whether the change between two cycles happens at once."""
    first = distance(low[1], high[1])
    for _ in range(HALVINGS):
        middle = 0.5 * (low[0] + high[0])
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
    known: list[tuple[float, str]] = []
    for number, chain in enumerate(chains):
        if any(_are_mirrored(chain, other) for other in chains[:number]):
            continue
        for change in (
            *_ends(loop, parameter, grid, chain, chains, births),
            *_changes_of_modes(loop, parameter, grid, chain),
        ):
            name = change.kind.partition(":")[0]
            near = ONE * float(np.max(np.diff(grid)))
            if not any(name == other and abs(change.value - value) <= near for value, other in known):
                known.append((change.value, name))
                yield change


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
) -> Iterator[Change]:
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
        if others:
            yield _at_others(loop, parameter, last, others)
        else:
            yield from _at_nothing(loop, parameter, last, float(grid[outer]), births)


def _at_nothing(
    loop: ClosedLoop, parameter: Parameter, last: _Last, outer: float, births: Sequence[float]
) -> Iterator[Change]:
    """The end of a chain at a value with no cycles, and how it changes on the way there."""
    way = towards_the_end(loop, parameter, (last.value, outer), last.cycle, births)
    yield _beside_nothing(last, _Last(way[-1].value, way[-1].cycle), outer)
    begun = last
    for one, other in pairwise(way):
        if one.cycle.returns != other.cycle.returns:
            coarse = LOCATED_IN_PASSING * abs(outer - last.value)
            yield _at_others(loop, parameter, begun, [(other.value, other.cycle)], coarse)
        begun = _Last(other.value, other.cycle).after((one.value, one.cycle))


def _at_others(
    loop: ClosedLoop, parameter: Parameter, last: _Last, others: Sequence[Place], coarse: float = 0.0
) -> Change:
    """The end of a chain at a value with others, located to `coarse` or better.

    A cycle found in between is on the chain if it takes as many returns and is nearer to the chain's trend
    than to the others.
    """
    begun, known = last, list(others)
    bad = known[0][0]
    fine = max(_fine(last.value, bad), coarse)
    beyond: Place | None = min(known, key=lambda other: distance(other[1], last.cycle))
    while abs(bad - last.value) > fine:
        middle = 0.5 * (last.value + bad)
        found = cycle_near(loop, parameter, middle, last.guess(middle))
        if not isinstance(found, Cycle) or not found.stable:
            bad, beyond = middle, None
            continue
        off = last.off_trend(middle, found)
        if found.returns != last.cycle.returns or any(distance(found, other) < off for _, other in known):
            bad, beyond = middle, (middle, found)
            known.append(beyond)
        else:
            last = _Last(middle, found).after((last.value, last.cycle))
    if beyond is None:
        return _beside_nothing(begun, last, bad)
    return Change(last.value, _name(loop, parameter, (last.value, last.cycle), beyond))


def _fine(one: float, other: float) -> float:
    """How closely a change between two values is located; numbers have an end."""
    return max(LOCATED * abs(one - other), RESOLVED * max(abs(one), abs(other)))


def _beside_nothing(last: _Last, end: _Last, outer: float) -> Change:
    """The name of an end beyond which the motion finds no cycle, refined from the `last` value of a chain."""
    word = "appears" if outer < end.value else "vanishes"
    small = end.cycle.amplitude < CONTINUOUS * last.cycle.amplitude
    return Change(end.value, f"limit cycle {word}, {'from zero amplitude' if small else 'with a jump'}")


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
    fine = _fine(low[0], high[0])
    while high[0] - low[0] > fine:
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

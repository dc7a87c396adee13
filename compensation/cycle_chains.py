"""Cycles at consecutive values of a gain joined to chains, and where a chain may hide a jump.

Cycles that continue each other take as many returns and are nearest in extremes and period. The nearest at
the next value may still lie across a jump of the return map: there the step from one to the next leaves
the trend of its neighbours. What does is a suspect, to be looked at closely (`cycle_changes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from compensation.loop_cycles import distance
from compensation.orbits.periodic_orbits import Cycle
from ident.simulation.filippov_system import FloatArray

OFF_TREND: Final = 0.25  # of its neighbours' steps, by which a step may differ from their mean
OFF_TREND_AT_ENDS: Final = 0.5  # the same at the ends of a chain, where the trend is known from one side
SMALLEST: Final = 2e-3  # relative change of extremes or period, below which no jump is looked for
FEWEST: Final = 4  # cycles that have a trend


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
    """Cycles at consecutive values, joined to branches: the nearest pairs first."""
    chains: list[Chain] = []
    going_on: list[Chain] = []
    for index, cycles in enumerate(found):
        if len(going_on) == len(cycles) == 1 and cycles[0].returns == going_on[0].cycles[-1].returns:
            going_on[0].cycles.append(cycles[0])  # as nearly always: nothing to compare
            continue
        pairs = sorted(
            (distance(cycle, chain.cycles[-1]), number, place)
            for number, chain in enumerate(going_on)
            for place, cycle in enumerate(cycles)
            if cycle.returns == chain.cycles[-1].returns
        )
        free = dict(enumerate(cycles))
        for _, number, place in pairs:
            if place in free and going_on[number].last == index - 1:
                going_on[number].cycles.append(free.pop(place))
        begun = [Chain(index, [cycle]) for cycle in free.values()]
        chains.extend(begun)
        going_on = [chain for chain in (*going_on, *begun) if chain.last == index]
    return chains


def parted(chain: Chain, cuts: Sequence[int]) -> list[Chain]:
    """The chain cut after each of the rising places."""
    edges = [0, *(cut + 1 for cut in cuts), len(chain.cycles)]
    return [Chain(chain.first + begin, chain.cycles[begin:end]) for begin, end in pairwise(edges)]


def suspects(chain: Chain, grid: FloatArray) -> list[int]:
    """Places i of a chain over some of a `grid` (n,) where the step from i to i + 1 leaves the trend."""
    if len(chain.cycles) < FEWEST:
        return list(range(len(chain.cycles) - 1))
    rows = np.array([(cycle.x1_min, cycle.x1_max, cycle.period) for cycle in chain.cycles])
    widths = np.diff(grid[chain.first : chain.last + 1])[:, None]
    slopes = np.diff(rows, axis=0) / widths
    before, after = np.roll(slopes, 1, axis=0), np.roll(slopes, -1, axis=0)
    before[0], after[0] = slopes[1], 2.0 * slopes[1] - slopes[2]  # at the ends: from one side
    before[-1], after[-1] = 2.0 * slopes[-2] - slopes[-3], slopes[-2]
    off = np.abs(slopes - 0.5 * (before + after))
    usual = 0.5 * (np.abs(before) + np.abs(after))
    size = np.maximum(np.abs(rows[:-1]), np.abs(rows[1:]))
    least = np.full((len(slopes), 1), OFF_TREND)
    least[0] = least[-1] = OFF_TREND_AT_ENDS
    nearby = np.zeros((len(slopes) + 2, 3))
    nearby[2:-2] = off[1:-1]  # what is off at an end may be so by the step beside it
    strays = (off > least * usual + SMALLEST * size / widths) & (off >= nearby[:-2]) & (off >= nearby[2:])
    places: list[int] = np.flatnonzero(np.any(strays, axis=1)).tolist()
    return places

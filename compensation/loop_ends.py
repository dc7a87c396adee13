"""Where a branch of stable cycles ends over a gain, by trial: does the motion still settle on a cycle?

Trials cut the interval between two values of the gain, one with the cycle and one without (`loop_settling`),
until the end is known to a part of its own value. Where the equilibria change inside it they are made first:
there cycles are born from the set point. A branch that lives just inside such a change and not just outside
ends at the change, which is known to rounding.

Beside a birth cycles change with the distance from it and not with the gain: from 1e-12 beyond it to 1e-3
their amplitudes grow by nine decades. There intervals are cut in logarithms of that distance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_settling import settled
from compensation.loop_starts import start_sizes
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import Cycle

LOCATED: Final = 3e-8  # of the gain, to which what happens to cycles is located
OF_INTERVAL: Final = 1e-4  # the same, of an interval that is narrow itself
RESOLVED: Final = 4e-16  # relative difference of numbers that can just be told apart
NOTHING: Final = 1e-30  # of an interval: so near to zero an end is there
BESIDE: Final = 1e-9  # of a suspect: so near to it a branch that it ends still lives
WIDE: Final = 4.0  # ratio of distances from a birth, above which their logarithms are cut


@dataclass(frozen=True)
class CycleAt:
    """A stable cycle on the way to the end of its branch."""

    value: float  # of the gain: r [-] or L [1/s]
    cycle: Cycle


@dataclass(frozen=True)
class WayToEnd:
    """A branch of stable cycles as far as it goes."""

    passed: list[CycleAt]  # the nearest to the end last
    end: float  # of the gain: r [-] or L [1/s]

    @property
    def shrinks(self) -> bool:
        """Whether the cycle becomes a point: its size falls at least as the root of the distance to it."""
        first, last = self.passed[0], self.passed[-1]
        far = abs(first.value - self.end)
        near = abs(last.value - self.end) or fineness(self.end, self.end, far)
        size = last.cycle.amplitude / first.cycle.amplitude
        return near < far and size * size * far <= near


def fineness(one: float, other: float, width: float) -> float:
    """How closely is located what happens between two values, in an interval of some width."""
    size = max(abs(one), abs(other))
    return max(min(LOCATED * size, OF_INTERVAL * width), RESOLVED * size, NOTHING * width)


def between(one: float, other: float, births: Iterable[float] = ()) -> float:
    """Where to cut an interval: in its middle, or that of logarithms beside a value of birth."""
    for birth in births:
        near, far = sorted((one - birth, other - birth), key=abs)
        if near * far > 0.0 and abs(far) > WIDE * abs(near):
            return birth + math.copysign(math.sqrt(abs(near)) * math.sqrt(abs(far)), far)
    return 0.5 * (one + other)


def towards_the_end(
    loop: ClosedLoop,
    parameter: Parameter,
    interval: tuple[float, float],
    cycle: Cycle,
    suspects: Sequence[float],
) -> WayToEnd:
    """The branch from a value with `cycle` on to one where that leads to none.

    `suspects` are values at which the branch may end.
    """
    inside, outside = interval
    passed = [CycleAt(inside, cycle)]

    def goes_on(value: float) -> bool:
        if value in (passed[-1].value, outside):
            return value != outside
        found = _leads_to(loop, parameter, value, passed[-1].cycle)
        if found is not None:
            passed.append(CycleAt(value, found))
        return found is not None

    within = [s for s in suspects if min(interval) <= s <= max(interval) and s != inside]
    for suspect in sorted(within, key=lambda value: abs(value - inside)):
        before, beyond = (_beside(suspect, side) for side in interval)
        if not goes_on(before):
            outside = before
            break
        if not goes_on(beyond):
            return WayToEnd(passed, suspect)
    width = abs(outside - inside)
    while abs(outside - passed[-1].value) > fineness(outside, passed[-1].value, width):
        value = between(passed[-1].value, outside)
        if not goes_on(value):
            outside = value
    return WayToEnd(passed, passed[-1].value)


def _beside(suspect: float, side: float) -> float:
    """A value just beside a suspect."""
    return suspect + math.copysign(min(BESIDE * abs(suspect), 0.5 * abs(side - suspect)), side - suspect)


def _leads_to(loop: ClosedLoop, parameter: Parameter, value: float, cycle: Cycle) -> Cycle | None:
    """The stable cycle at a value to which another's cycle leads, or else motion from near the set point."""
    near = start_sizes(loop, parameter, np.array([value]))[0, 1]
    for point in (cycle.point, np.array([near, 0.0])):
        found = settled(loop, parameter, value, point)
        if isinstance(found, Cycle) and found.stable:
            return found
    return None

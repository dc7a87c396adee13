"""Where a branch of stable cycles ends over a gain, by trial: does the motion still settle on a cycle?

Trials cut the interval between two values of the gain, one with the cycle and one without (`loop_settling`).
Where the equilibria change inside it they are made first: there cycles are born from the set point.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from compensation.closed_loop import ClosedLoop
from compensation.loop_settling import settled
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import Cycle

FINE: Final = 2.0**-20  # of an interval, to which an end is found


@dataclass(frozen=True)
class CycleAt:
    """A stable cycle on the way to the end of its branch."""

    value: float  # of the gain: r [-] or L [1/s]
    cycle: Cycle


def towards_the_end(
    loop: ClosedLoop,
    parameter: Parameter,
    interval: tuple[float, float],
    cycle: Cycle,
    suspects: Iterable[float],
) -> list[CycleAt]:
    """The cycles on the way from a value with `cycle` to one where that leads to none, nearest last.

    `suspects` are values at which the branch may end.
    """
    inside, outside = interval
    fine = FINE * abs(outside - inside)
    probes = _probes(interval, suspects)
    passed = [CycleAt(inside, cycle)]
    while abs(outside - passed[-1].value) > fine:
        probe = next(probes, None)
        last = passed[-1]
        value = 0.5 * (last.value + outside) if probe is None else probe
        if min(last.value, outside) < value < max(last.value, outside):
            found = settled(loop, parameter, value, last.cycle.point)
            if isinstance(found, Cycle) and found.stable:
                passed.append(CycleAt(value, found))
            else:
                outside = value
        elif probe is None:
            break  # between neighbouring numbers there is nothing
    return passed


def _probes(interval: tuple[float, float], suspects: Iterable[float]) -> Iterator[float]:
    """Values just before and just beyond each suspect."""
    inside, outside = interval
    near = 0.5 * FINE * (inside - outside)
    for suspect in sorted(suspects, key=lambda value: abs(value - inside)):
        yield suspect + near
        yield suspect - near

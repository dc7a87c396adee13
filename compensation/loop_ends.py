"""Where a branch of stable cycles ends over a gain, by trial: does the motion still settle on a cycle?

A stable cycle is what the return map repeats in the end, after however many returns, so that a trial needs
neither its derivative nor that its symmetry lasts. What repeats too slowly is left to
`orbits.periodic_orbits`. Trials cut the interval between two values of the gain, one with the cycle and one
without. Where the equilibria change inside it they are made first: there cycles are born from the set point.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_parameters import COLUMNS, ROWS, mode_table
from compensation.loop_returns import returns
from compensation.loop_runs import run_for
from compensation.loop_section import PATIENCE, LoopSection, with_gain
from compensation.loop_tables import COLUMN_OF, Parameter, gain_row, laws_of, mode_parameters
from compensation.orbits.periodic_orbits import MOST_TURNS, VANISHED, Cycle, find_cycle
from ident.simulation.compiled import owning
from ident.simulation.filippov_system import FloatArray

FINE: Final = 2.0**-20  # of an interval, to which an end is found
REPEATS: Final = 1e-9  # relative distance of points that are the same
MOST_RETURNS: Final = 48  # of a trial
NOWHERE, UNDECIDED = 0, -1


@dataclass(frozen=True)
class LastCycle:
    """The cycle nearest to the end of its branch."""

    value: float  # of the gain: r [-] or L [1/s]
    point: FloatArray  # (2,) x1 [rad] and x2 [rad/s] where the link halts
    amplitude: float  # [rad]


def last_cycle(
    loop: ClosedLoop,
    parameter: Parameter,
    interval: tuple[float, float],
    cycle: Cycle,
    suspects: Iterable[float],
) -> LastCycle:
    """The last cycle in an interval from a value with `cycle` to one where that leads to none.

    `suspects` are values at which the branch may end.
    """
    inside, outside = interval
    fine = FINE * abs(outside - inside)
    probes = _probes(interval, suspects)
    last = LastCycle(inside, cycle.point, cycle.amplitude)
    while abs(outside - last.value) > fine:
        value = next(probes, 0.5 * (last.value + outside))
        if not min(last.value, outside) < value < max(last.value, outside):
            continue
        found = _settled(loop, parameter, value, last.point)
        if found is None:
            outside = value
        else:
            last = found
    return last


def _probes(interval: tuple[float, float], suspects: Iterable[float]) -> Iterator[float]:
    """Values just before and just beyond each suspect."""
    inside, outside = interval
    near = 0.5 * FINE * (inside - outside)
    for suspect in sorted(suspects, key=lambda value: abs(value - inside)):
        yield suspect + near
        yield suspect - near


def _settled(loop: ClosedLoop, parameter: Parameter, value: float, start: FloatArray) -> LastCycle | None:
    """The cycle at a value of the gain on which the motion from a point (2,) of the section settles."""
    section, parameters = LoopSection(loop), mode_parameters(loop.robot, loop.controller)
    laws, inertia = laws_of(loop.robot, loop.controller)
    gains = gain_row(loop.controller)
    gains[COLUMN_OF[parameter]] = value
    points = np.empty((MOST_RETURNS, 5))
    period, made = settle(
        run_for(parameters),
        laws,
        inertia,
        gains,
        section.symmetric,
        section.tolerance,
        PATIENCE,
        start,
        points,
    )
    if period == NOWHERE:
        return None
    if period == UNDECIDED:
        cycle = find_cycle(LoopSection(with_gain(loop, parameter, value)), points[-1, :2])
        if not isinstance(cycle, Cycle) or not cycle.stable:
            return None
        return LastCycle(value, cycle.point, cycle.amplitude)
    turns = points[made - period : made]
    return LastCycle(value, turns[-1, :2], float(np.max(np.abs(turns[:, 3:]))))


@owning
def settle(
    run: int,
    laws: FloatArray,
    inertia: FloatArray,
    gains: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    start: FloatArray,
    points: FloatArray,
) -> tuple[int, int]:
    """Follow the return map from `start` (2,) until it repeats: (returns of a period, returns made).

    The returns go into `points` (n, 5), as in `loop_returns`; of a period there are NOWHERE if it leads to no
    cycle and UNDECIDED after n returns. Laws, inertia and gains are those of `loop_parameters.mode_table`.
    """
    table, state = np.zeros((ROWS, COLUMNS)), np.empty(3)
    mode_table(laws, inertia, gains, table)
    state[0], state[1], state[2] = start[0], start[1], -start[1]
    small = VANISHED * max(abs(start[0]), abs(start[1]))
    for made in range(points.shape[0]):
        count, _ = returns(run, table, symmetric, tolerance, patience, state, points[made : made + 1])
        here = points[made]
        size = max(abs(here[0]), abs(here[1]))
        if count == 0 or size <= small:
            return NOWHERE, made
        for back in range(1, min(MOST_TURNS, made) + 1):
            before = points[made - back]
            if max(abs(before[0] - here[0]), abs(before[1] - here[1])) <= REPEATS * size:
                return back, made + 1
        state[0], state[1], state[2] = here[0], here[1], -here[1]
    return UNDECIDED, points.shape[0]

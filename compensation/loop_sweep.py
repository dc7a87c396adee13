"""Cycles of the closed loop over many values of a gain, in one kernel.

A cycle that takes one return of the map, as most do, is followed from one value to the next: the point is
guessed from the last two, and the map is iterated until it repeats. Where it contracts strongly the second
return repeats already, and carries the derivative. What takes several returns in a period, contracts slowly
or leads elsewhere is left undecided: `orbits.periodic_orbits` looks at it closely.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from compensation.loop_modes import POSITION
from compensation.loop_returns import MOST_HALTS, derivative, returns
from ident.simulation.compiled import compiled, owning
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.integrate import SECTION

FOUND: Final = 0
LEADS_ELSEWHERE: Final = 1
UNDECIDED: Final = 2
X1, X2, PERIOD, LOW, HIGH, SLOPE = range(6)  # columns of a row; the derivative of one return from SLOPE on
COLUMNS: Final = SLOPE + 4
REPEATS: Final = 1e-11  # relative distance of points that are the same
DEFINITE: Final = 1e-3  # relative distance within which a derivative is worth its cost
MOST_RETURNS: Final = 8
TANGENT_TOLERANCE: Final = 1e-9  # of a step of the derivative, against the multipliers' absolute 1e-8


@owning
def sweep(
    run: int,
    carried: int,
    tables: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    first: FloatArray,
    cold: FloatArray,
    rows: FloatArray,
    verdicts: Signs,
) -> None:
    """The cycle at each of n values, from the one before or else from `cold` (2,): rows (n, COLUMNS).

    The first value starts from `first` (2,). `run` and `carried` are the addresses of the loop's kernels.

    `tables` (n, 6, 16) are the parameters of `loop_parameters`; verdicts (n,) are those named above. The
    sweep ends at the first value that stays undecided.
    """
    guess = np.empty(2)
    for value in range(tables.shape[0]):
        verdicts[value] = UNDECIDED
    for value in range(tables.shape[0]):
        warm = value > 0 and verdicts[value - 1] == FOUND
        known = 2 if value > 1 and warm and verdicts[value - 2] == FOUND else 1
        for i in range(2):
            guess[i] = first[i] if value == 0 else cold[i]
            if warm:
                guess[i] = rows[value - 1, i]
            if warm and known == 2:
                guess[i] += rows[value - 1, i] - rows[value - 2, i]
        verdicts[value] = cycle_from(
            run, carried, tables[value], symmetric, tolerance, patience, guess, rows[value]
        )
        if verdicts[value] == UNDECIDED:
            return


@owning
def cycle_from(
    run: int,
    carried: int,
    table: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    start: FloatArray,
    row: FloatArray,
) -> int:
    """The cycle of one return that a point (2,) of the section leads to, into `row`; the verdict."""
    state, once, points = np.empty(3), np.empty((2, 2)), np.empty((1, 5))
    here = start.copy()
    before = np.inf
    for _ in range(MOST_RETURNS):
        state[0], state[1], state[2] = here[0], here[1], -here[1]
        size = max(abs(here[0]), abs(here[1]))
        if before <= DEFINITE * size:
            if _turn(run, carried, table, symmetric, patience, tolerance, state, once, row) != SECTION:
                return LEADS_ELSEWHERE
            before = max(abs(row[X1] - here[0]), abs(row[X2] - here[1]))
            if before <= REPEATS * size:
                _correct(here, row)
                return FOUND
            here[0], here[1] = row[X1], row[X2]
        else:
            made, _ = returns(run, table, symmetric, tolerance, patience, state, points)
            if made == 0:
                return LEADS_ELSEWHERE
            before = max(abs(points[0, 0] - here[0]), abs(points[0, 1] - here[1]))
            here[0], here[1] = points[0, 0], points[0, 1]
    return UNDECIDED


@owning
def _turn(
    run: int,
    carried: int,
    table: FloatArray,
    symmetric: bool,
    patience: float,
    tolerance: float,
    state: FloatArray,
    once: FloatArray,
    row: FloatArray,
) -> int:
    """One return with its derivative, into `row`; why it ended."""
    low = high = state[POSITION]
    period = 0.0
    for i in range(4):
        row[SLOPE + i] = 1.0 if i in (0, 3) else 0.0
    for _ in range(MOST_HALTS):
        begun = state[POSITION]
        duration, reason = derivative(
            run, carried, table, tolerance, TANGENT_TOLERANCE, patience, state, once
        )
        if reason != SECTION:
            return reason
        period += duration
        low, high = min(low, state[POSITION]), max(high, state[POSITION])
        a, b, c, d = row[SLOPE], row[SLOPE + 1], row[SLOPE + 2], row[SLOPE + 3]
        row[SLOPE], row[SLOPE + 1] = once[0, 0] * a + once[0, 1] * c, once[0, 0] * b + once[0, 1] * d
        row[SLOPE + 2], row[SLOPE + 3] = once[1, 0] * a + once[1, 1] * c, once[1, 0] * b + once[1, 1] * d
        if symmetric or state[POSITION] > begun:
            break
    sign = -1.0 if symmetric else 1.0
    row[X1], row[X2] = sign * state[0], sign * state[1]
    for i in range(4):
        row[SLOPE + i] *= sign
    row[PERIOD], row[LOW], row[HIGH] = period, low, high
    return SECTION


@compiled
def _correct(here: FloatArray, row: FloatArray) -> None:
    """One Newton step on the fixed point: (1 - slope) change = return - point."""
    a, b, c, d = 1.0 - row[SLOPE], -row[SLOPE + 1], -row[SLOPE + 2], 1.0 - row[SLOPE + 3]
    first, second = row[X1] - here[0], row[X2] - here[1]
    determinant = a * d - b * c
    row[X1] = here[0] + (d * first - b * second) / determinant
    row[X2] = here[1] + (a * second - c * first) / determinant

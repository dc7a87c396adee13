"""Cycles of the closed loop over many values of a gain, in one kernel.

A symmetric cycle that takes one return of the map, as most do, is followed from one value to the next. Its
point is guessed from those before by polynomials of rising degree (Neville): by that which changes the guess
of the degree below least. The map is followed until it repeats, with its derivative once the point is nearly
known. The derivative tells how far the next return would still move, and corrects what was found for it:
where the map contracts strongly, as friction makes it, one return from a good guess is enough. What takes
several returns in a period, contracts slowly or leads elsewhere is left undecided: `orbits.periodic_orbits`
looks at it closely.
"""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np

from compensation.loop_returns import MapKernels, derivative_at, newton_change, returns_at
from ident.simulation.compiled import compiled, owning
from ident.simulation.filippov_system import FloatArray, Signs, assign
from ident.simulation.integrate import SECTION

FOUND: Final = 0
LEADS_ELSEWHERE: Final = 1
UNDECIDED: Final = 2
X1, X2, HALF_PERIOD, SLOPE = range(4)  # columns of a row; the derivative of the half turn from SLOPE on
COLUMNS: Final = SLOPE + 4
REPEATS: Final = 1e-11  # relative distance of points that are the same
CLOSE: Final = 1e-6  # relative distance that the derivative corrects to rounding
DEFINITE: Final = 1e-3  # relative distance within which a derivative is worth its cost
CONTRACTS: Final = 0.5  # norm of a derivative with which Newton's method is safe
MOST_RETURNS: Final = 8
MOST_KNOWN: Final = 6  # points that a guess is made from
ROUGH: Final = 1e-9  # tolerance of a step on the way to a point that is nearly known
TANGENT_TOLERANCE: Final = 1e-9  # of a step of the derivative, against the multipliers' absolute 1e-8


@owning
def sweep(
    kernels: MapKernels,
    values: FloatArray,
    tables: FloatArray,
    tolerance: float,
    patience: float,
    first: FloatArray,
    cold: FloatArray,
    rows: FloatArray,
    verdicts: Signs,
) -> None:
    """The cycle at each of n ascending values, from those before or else from `cold`: rows (n, COLUMNS).

    The first value starts from `first` (2,), others without a cycle before them from the starts x1 [rad] of
    `cold` (n, 2), the far one first. `kernels` are those of the loop.

    `tables` (n, 6, 16) are the parameters of `loop_parameters` at the `values` (n,) of a gain; verdicts (n,)
    are those named above. The sweep ends at the first value that stays undecided.
    """
    guess, memory = np.empty(2), np.empty(MOST_KNOWN)
    assign(guess, first)
    for value in range(values.size):
        verdicts[value] = UNDECIDED
    known = 0
    missed = inf
    for value in range(values.size):
        if known > 0:
            extrapolate(values, rows, value, known, memory, guess)
        elif value > 0:
            guess[0], guess[1] = cold[value, 0], 0.0
        row = rows[value]
        verdict, missed = cycle_from(kernels, tables[value], tolerance, patience, guess, missed <= CLOSE, row)
        if verdict == LEADS_ELSEWHERE and known > 0:
            assign(guess, rows[value - 1, :2])  # the branch may bend more than its guess
            verdict, missed = cycle_from(kernels, tables[value], tolerance, patience, guess, False, row)
        if verdict == LEADS_ELSEWHERE:
            guess[0], guess[1] = cold[value, 1], 0.0
            verdict, missed = cycle_from(kernels, tables[value], tolerance, patience, guess, False, row)
        verdicts[value] = verdict
        if verdict == UNDECIDED:
            return
        known = min(known + 1, MOST_KNOWN) if verdict == FOUND else 0


@compiled
def extrapolate(
    values: FloatArray, rows: FloatArray, index: int, known: int, memory: FloatArray, guess: FloatArray
) -> None:
    """The point (2,) at a value, from the `known` rows before it."""
    at = values[index]
    for i in range(guess.size):
        for k in range(known):
            memory[k] = rows[index - 1 - k, i]
        guess[i] = before = memory[0]
        least = inf
        for degree in range(1, known):
            for k in range(known - degree):
                near, far = values[index - 1 - k], values[index - 1 - k - degree]
                memory[k] = ((at - far) * memory[k] - (at - near) * memory[k + 1]) / (near - far)
            change = abs(memory[0] - before)
            before = memory[0]
            if change < least:
                least, guess[i] = change, before


@owning
def cycle_from(
    kernels: MapKernels,
    table: FloatArray,
    tolerance: float,
    patience: float,
    start: FloatArray,
    nearly_known: bool,
    row: FloatArray,
) -> tuple[int, float]:
    """The cycle of one return that a point (2,) of the section leads to, into `row`.

    The verdict, and how far the first return was from the start, relative to their size. Where the point is
    `nearly_known`, the first return is made with its derivative.
    """
    state, slope, points = np.empty(3), np.empty((3, 2)), np.empty((1, 5))
    here = start.copy()
    missed = inf
    apart = 0.0 if nearly_known else inf
    for turn in range(MOST_RETURNS):
        state[0], state[1], state[2] = here[0], here[1], -here[1]
        by_derivative = apart <= DEFINITE
        if by_derivative:
            duration, reason = derivative_at(
                kernels.derivative,
                (kernels.run, kernels.carried, table, tolerance, TANGENT_TOLERANCE, patience, state, slope),
            )
            if reason != SECTION:
                return LEADS_ELSEWHERE, missed
            row[X1], row[X2], row[HALF_PERIOD] = -state[0], -state[1], duration
            for i in range(2):
                slope[0, i], slope[1, i] = -slope[0, i], -slope[1, i]
                row[SLOPE + i], row[SLOPE + 2 + i] = slope[0, i], slope[1, i]
        else:
            made, _ = returns_at(
                kernels.returns, (kernels.run, table, True, max(tolerance, ROUGH), patience, state, points)
            )
            if made == 0:
                return LEADS_ELSEWHERE, missed
            row[X1], row[X2] = points[0, 0], points[0, 1]
        size = max(abs(here[0]), abs(here[1]))
        apart = max(abs(row[X1] - here[0]), abs(row[X2] - here[1])) / size
        if turn == 0:
            missed = apart
        if by_derivative and apart <= DEFINITE:
            steep = _norm(slope)
            settled = apart <= CLOSE and apart * min(steep, 1.0) <= REPEATS and steep < inf
            if settled or steep <= CONTRACTS:
                _correct(here, slope, row)
            if settled:
                return FOUND, missed
        here[0], here[1] = row[X1], row[X2]
    return UNDECIDED, missed


@compiled
def _norm(slope: FloatArray) -> float:
    """The largest stretch of the derivative, in the maximum norm."""
    first, second = abs(slope[0, 0]) + abs(slope[0, 1]), abs(slope[1, 0]) + abs(slope[1, 1])
    norm: float = max(first, second)
    return norm


@compiled
def _correct(here: FloatArray, slope: FloatArray, row: FloatArray) -> None:
    """One Newton step from `here` (2,) to the fixed point; the duration follows."""
    change1, change2 = newton_change(slope, row[X1] - here[0], row[X2] - here[1])
    row[X1], row[X2] = here[0] + change1, here[1] + change2
    row[HALF_PERIOD] += slope[2, 0] * change1 + slope[2, 1] * change2

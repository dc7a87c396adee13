"""One step by the Taylor series of the solution, for modes that give a recurrence.

The series itself is the dense output, and events are zeros of polynomials. The step follows Jorba and
Zou (2005): with the coefficients c_k of a series of order p, h is the smaller of (tol |y| /
|c_k|)^(1/k) over the last two k, so that the terms left out stay below tol |y|. Tight tolerances ask
for a high order rather than for short steps: about -ln(tol)/2 + 4 costs least here.
"""

from __future__ import annotations

import math

from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, OneStepMethod, Signs, Surfaces

MAX_ORDER = 24


@compiled
def order_for(tolerance: float) -> int:
    """Order of the series that reaches a tolerance at least cost."""
    return min(MAX_ORDER, max(8, math.ceil(-0.5 * math.log(tolerance) + 4.0)))


@specialised
def taylor_step(
    system: FilippovSystem,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    tolerance: float,
    longest: float,
    suggested: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> tuple[float, int, float]:
    """Length of the step, degree of its polynomials in theta = t / length (rows 0..n-1), next length.

    `tolerance` is relative to the largest component of the state. Where `longest` is negative, a step of
    exactly that length is taken.
    """
    n = state.size
    order = order_for(tolerance)
    reach = system.series(signs, state, parameters, order, polynomials, work)
    if longest < 0.0:
        length = -longest
    else:
        size = 0.0
        last = 0.0
        before = 0.0
        for i in range(n):
            size = max(size, abs(state[i]))
            last = max(last, abs(polynomials[i, order]))
            before = max(before, abs(polynomials[i, order - 1]))
        length = min(longest, reach)
        if last > 0.0:
            length = min(length, (tolerance * size / last) ** (1.0 / order))
        if before > 0.0:
            length = min(length, (tolerance * size / before) ** (1.0 / (order - 1)))
        if size == 0.0:
            length = min(length, 1e-3 / (1.0 + abs(last) ** (1.0 / order)))
    for i in range(n):
        power = 1.0
        for k in range(1, order + 1):
            power *= length
            polynomials[i, k] *= power
    return length, order, suggested


@specialised
def end_of_series(
    system: FilippovSystem,
    surfaces: Surfaces,
    surface: int,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    length: float,
    part: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> tuple[float, float]:
    """A series holds anywhere on its step: the event ends it where it was found."""
    return length, part


TAYLOR = OneStepMethod(step=passed(taylor_step), end_at=passed(end_of_series))

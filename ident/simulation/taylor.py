"""One step by the Taylor series of the solution, for modes that give a recurrence.

The series itself is the dense output, and events are zeros of polynomials. The step follows Jorba and
Zou (2005): with the coefficients c_k of a series of order p, h is the smaller of (tol |y| /
|c_k|)^(1/k) over the last two k, so that the terms left out stay below tol |y|.

The order is the same for every tolerance. A component that decays at a rate mu bounds the step by the
stability of the truncated series, mu h < p/e about, however loose the tolerance is: a high order serves stiff
modes at loose tolerances as it serves tight ones.
"""

from __future__ import annotations

from math import exp, log
from typing import Final

from ident.simulation.compiled import passed, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, OneStepMethod, Signs, Surfaces

ORDER: Final = 20
SMALLEST: Final = 1e-300  # stands for a coefficient that vanishes


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
    reach = system.series(signs, state, parameters, ORDER, polynomials, work)
    if longest < 0.0:
        length = -longest
    else:
        size = 0.0
        last = 0.0
        before = 0.0
        for i in range(n):
            size = max(size, abs(state[i]))
            last = max(last, abs(polynomials[i, ORDER]))
            before = max(before, abs(polynomials[i, ORDER - 1]))
        if size > 0.0:
            allowed = tolerance * size
            by_last = log(allowed / max(last, SMALLEST)) / ORDER
            by_before = log(allowed / max(before, SMALLEST)) / (ORDER - 1)
            length = min(longest, reach, exp(min(by_last, by_before)))
        else:
            length = min(longest, reach, 1e-3 / (1.0 + last ** (1.0 / ORDER)))
    power = 1.0
    for k in range(1, ORDER + 1):
        power *= length
        for i in range(n):
            polynomials[i, k] *= power
    return length, ORDER, suggested


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

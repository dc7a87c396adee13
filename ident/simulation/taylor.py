"""One step by the Taylor series of the solution, for modes that give a recurrence.

The series itself is the dense output, and events are zeros of polynomials. The step follows Jorba and
Zou (2005): with the coefficients c_k of a series of order p, h is the smaller of (tol |y| /
|c_k|)^(1/k) over the last two k, so that the terms left out stay below tol |y|.

The order is the same for every tolerance. A component that decays at a rate mu bounds the step by the
stability of the truncated series, mu h < p/e about, however loose the tolerance is: a high order serves stiff
modes at loose tolerances as it serves tight ones. Constant factors on the last terms, chosen for stability as
those of Runge-Kutta-Chebyshev methods are, would allow mu h = 13 on the real axis with two of them and 24
with six, but only 9.2 and 11.5 where eigenvalues lie 60 degrees off it, which is where a coupled observer has
them; and they cost accuracy, so that a trajectory takes no fewer steps at the same error.
"""

from __future__ import annotations

from typing import Any, Final

from ident.simulation.compiled import passed, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, OneStepMethod, Signs, Surfaces
from ident.simulation.pack_functions import rough_power_of_two
from ident.simulation.packs import number_of, rough_log2, smaller, spread, spread_as
from ident.simulation.polynomials import scale

ORDER: Final = 20
SMALLEST: Final = 1e-300  # stands for a coefficient that vanishes


@specialised
def true_length(allowed: Any, last: Any, before: Any) -> Any:
    """Length (a pack) of steps whose last two terms are `allowed`, to a hundredth.

    `last` and `before` are the magnitudes of the last two coefficients, `SMALLEST` at least.
    """
    most = rough_log2(allowed)
    by_last = (most - rough_log2(last)) * spread_as(last, 1.0 / ORDER)
    by_before = (most - rough_log2(before)) * spread_as(before, 1.0 / (ORDER - 1))
    return rough_power_of_two(smaller(by_last, by_before))


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
        size, last, before = 0.0, SMALLEST, SMALLEST
        for i in range(n):
            size = max(size, abs(state[i]))
            last = max(last, abs(polynomials[i, ORDER]))
            before = max(before, abs(polynomials[i, ORDER - 1]))
        if size > 0.0:
            allowed = spread(4, tolerance * size)
            longest_true = number_of(true_length(allowed, spread(4, last), spread(4, before)), 0)
            length = min(longest, reach, longest_true)
        else:
            length = min(longest, reach, 1e-3 / (1.0 + last ** (1.0 / ORDER)))
    scale(polynomials, n, ORDER, length)
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

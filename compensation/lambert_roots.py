"""The resting estimates of `torque_balance` in closed form, for a Stribeck shape of 1: kernels.

With c = F_s - r F_c^ the roots of h are s = c/a + v_s W(-K e^{-c/(a v_s)}), K = r dF^/(a v_s): the principal
branch of Lambert's W for the outer edge, branch -1 for the inner. The argument under- and overflows long
before the roots do, so W is taken in logarithmic form.
"""

from __future__ import annotations

from math import exp, expm1, log, sqrt
from typing import Final

from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray

NEWTON_LIMIT: Final = 100
CONVERGED: Final = 4e-16


@compiled
def resting_ranges(
    slope: FloatArray, onset: FloatArray, fading: FloatArray, width: float, out: FloatArray
) -> None:
    """The range of s > 0 with h(s) <= 0 for each of n balances with slopes a > 0, into `out` (n, 2).

    Arguments (n,) as in `TorqueBalance`: h is convex, so there is one range at most. Both ends are 0 where
    there is none.
    """
    for i in range(slope.size):
        out[i, 0], out[i, 1] = resting_range(slope[i], onset[i], fading[i], width)


@compiled
def resting_range(slope: float, onset: float, fading: float, width: float) -> tuple[float, float]:
    """As `resting_ranges`, for one balance."""
    end = (fading - onset) / slope
    if end <= 0.0:
        return 0.0, 0.0
    inner, outer = 0.0, end
    if fading > 0.0:
        inner, outer = lambert_roots(slope, onset, fading, width, end)
    elif onset >= 0.0:
        outer = 0.0
    return (inner, outer) if outer > inner else (0.0, 0.0)


@compiled
def lambert_roots(slope: float, onset: float, fading: float, width: float, end: float) -> tuple[float, float]:
    """Inner and outer positive root of h for a > 0, r dF^ > 0 and end = c/a > 0; 0 where there is none."""
    steepness = fading / (slope * width)  # K
    exponent = end / width - (log(fading) - log(slope * width))
    if exponent < 1.0:  # the minimum of h is positive
        return 0.0, 0.0
    if onset >= 0.0 and steepness <= 1.0:  # h rises from 0 on
        return 0.0, 0.0
    upper, lower = minus_lambert(exponent)
    outer = _refined(slope, onset, fading, width, end - width * upper)
    inner = 0.0
    if onset > 0.0:
        inner = _refined(slope, onset, fading, width, end - width * lower)
    return max(inner, 0.0), max(outer, 0.0)


@compiled
def _refined(slope: float, onset: float, fading: float, width: float, root: float) -> float:
    """Two Newton steps, each kept only if it lowers |h|."""
    if root <= 0.0:
        return 0.0
    value = slope * root + (onset + fading * expm1(-root / width))
    for _ in range(2):
        gradient = slope - fading * exp(-root / width) / width
        if value == 0.0 or gradient == 0.0:
            break
        better = root - value / gradient
        if not better > 0.0:
            break
        remaining = slope * better + (onset + fading * expm1(-better / width))
        if abs(remaining) >= abs(value):
            break
        root, value = better, remaining
    return root


@compiled
def minus_lambert(exponent: float) -> tuple[float, float]:
    """-W_0(-e^-u) and -W_-1(-e^-u), u = `exponent` >= 1: the w <= 1 and w >= 1 with w - ln w = u.

    With w = e^-t the equation is t + e^-t = u: t >= 0 is the principal branch, t <= 0 branch -1. The left
    side is convex, so Newton's method from outside converges from one side, and no exponent is too large.
    """
    if exponent <= 1.0:
        return 1.0, 1.0
    logarithm = -log(exponent + 2.0 * sqrt(exponent))  # -t is below ln(u + 2 sqrt(u))
    return exp(-_newton_from_outside(exponent, exponent)), exp(-_newton_from_outside(logarithm, exponent))


@compiled
def _newton_from_outside(t: float, exponent: float) -> float:
    for _ in range(NEWTON_LIMIT):
        fading = exp(-t)
        if fading == 1.0:
            break
        step = (t + fading - exponent) / (1.0 - fading)
        t -= step
        if abs(step) <= CONVERGED * (1.0 + abs(t)):
            break
    return t

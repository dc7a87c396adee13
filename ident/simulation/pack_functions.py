"""exp of packs, all numbers at once by the same operations; and a power of two that is only rough.

With n the whole number nearest to x / ln 2 and r = x - n ln 2, |r| <= 0.35 (Cody and Waite: ln 2 in two
parts, the first so short that its product with n is exact), exp(x) - 1 = 2^n (exp(r) - 1) + (2^n - 1), and
exp(r) - 1 is its Taylor polynomial of degree 14: to two units in the last place, whatever the machine.
"""

from __future__ import annotations

from math import factorial
from typing import Any, Final

from ident.simulation.compiled import specialised
from ident.simulation.packs import fused, larger, nearest, scaled_two, smaller, spread_as

BY_LN2: Final = 1.4426950408889634
LN2_HIGH: Final = 6.93147180369123816490e-01
LN2_LOW: Final = 1.90821492927058770002e-10
LOWEST: Final = -708.0  # below, exp is no normal number: it is given as exp(-708)
HIGHEST: Final = 709.0
DEGREE: Final = 14
INVERSE_FACTORIALS: Final = tuple(1.0 / factorial(k) for k in range(DEGREE + 1))
C2, C3, C4, C5, C6, C7, C8, C9, C10, C11, C12, C13, C14 = INVERSE_FACTORIALS[2:]


@specialised
def parted_exponential(x: Any) -> tuple[Any, Any]:
    """2^n and exp(r) - 1 of a pack, exp(x) = 2^n + 2^n (exp(r) - 1); x is taken within -708 and 709."""
    bounded = smaller(larger(x, spread_as(x, LOWEST)), spread_as(x, HIGHEST))
    whole = nearest(bounded * spread_as(x, BY_LN2))
    r = fused(whole, spread_as(x, -LN2_LOW), fused(whole, spread_as(x, -LN2_HIGH), bounded))
    p = fused(spread_as(x, C14), r, spread_as(x, C13))
    p = fused(p, r, spread_as(x, C12))
    p = fused(p, r, spread_as(x, C11))
    p = fused(p, r, spread_as(x, C10))
    p = fused(p, r, spread_as(x, C9))
    p = fused(p, r, spread_as(x, C8))
    p = fused(p, r, spread_as(x, C7))
    p = fused(p, r, spread_as(x, C6))
    p = fused(p, r, spread_as(x, C5))
    p = fused(p, r, spread_as(x, C4))
    p = fused(p, r, spread_as(x, C3))
    p = fused(p, r, spread_as(x, C2))
    return scaled_two(whole), fused(p * r, r, r)


@specialised
def exponential(x: Any) -> Any:
    """exp of a pack."""
    scale, rest = parted_exponential(x)
    return fused(scale, rest, scale)


@specialised
def exponential_less_one(x: Any) -> Any:
    """exp - 1 of a pack, to rounding where x is small; 0 for x = 0."""
    scale, rest = parted_exponential(x)
    return fused(scale, rest, scale - spread_as(x, 1.0))


@specialised
def rough_power_of_two(x: Any) -> Any:
    """2^x of a pack, up to a part in 200 too small: enough for the length of a step."""
    whole = nearest(x)
    rest = (x - whole) * spread_as(x, LN2_HIGH)
    bend = fused(rest, spread_as(x, 0.5), spread_as(x, 1.0))
    return scaled_two(whole) * fused(bend, rest, spread_as(x, 0.9925))

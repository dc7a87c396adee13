"""Taylor series of the closed loop in a slip mode, all Stribeck shapes 1: the kernel that costs the time.

With the symbols of `loop_modes`: E = exp(-s2 x2/v_s^) obeys E' = -(s2/v_s^) x2' E, and exp(-|v|/v_s) the
like with v'. So each new coefficient of the state gives the next of E and W, and they the next of the state
(Knuth, The Art of Computer Programming, volume 2, 4.7), at one short convolution each. Where W is the
difference exp(-|v|/v_s) - E, its equation is W' = -(sv/v_s) (v' W + x3' E), and no digits are lost.

The three convolutions, x2' with E, v' with W and x3' with E, are one of packs (`packs`): rates (x2', v', x3',
0) with fadings (E, W, E, 0), the third fading 0 where W stands alone. It is summed in two interleaved halves:
additions wait for each other, and two chains wait half as long. The terms with the newest coefficients come
last, from registers, so that all others are summed while those are still awaited.
"""

from __future__ import annotations

from math import exp, inf
from typing import Final

from compensation.loop_parameters import (
    A1,
    A2,
    A3,
    ALIKE,
    C1,
    C2,
    GAIN,
    K0,
    K2,
    KV,
    SIGN2,
    SIGNV,
    WIDTH2,
    WIDTHV,
    fading_difference,
    slip_row,
)
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, spread

UNSEEN: Final = 40.0  # exp(-40) is below rounding


@compiled
def series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """Taylor coefficients of the state into rows 0..2 of `coefficients`.

    `work` keeps those of the rates, 4 numbers each, and from `fadings(order)` on those of the fadings.
    Returns for how long the series hold: at many times v_s, E is lost in rounding, yet is back before v is
    small.
    """
    mode = slip_row(signs)
    a1, a2, a3 = parameters[mode, A1], parameters[mode, A2], parameters[mode, A3]
    c1, c2, gain = parameters[mode, C1], parameters[mode, C2], parameters[mode, GAIN]
    k2, kv, shared = parameters[mode, K2], parameters[mode, KV], parameters[mode, ALIKE]
    rate2 = -parameters[mode, SIGN2] / parameters[mode, WIDTH2]
    ratev = -parameters[mode, SIGNV] / parameters[mode, WIDTHV]
    faded = fadings(order)
    x1, x2, x3 = state[0], state[1], state[2]
    fall2, fallv = -(rate2 * x2), -(ratev * (x2 + x3))
    e = exp(-fall2)
    w = fading_difference(e, fallv, ratev * x3) if shared != 0.0 else exp(-fallv)
    e0, w0, w0_shared = e, w, w + shared * e
    two = c1 * x1 + c2 * x2 + gain * x3
    three = (a1 * x1 + a2 * x2 + a3 * x3 + parameters[mode, K0]) + k2 * e + kv * w
    two_0, both_0, shared_0 = two, two + three, shared * three
    coefficients[0, 0], coefficients[1, 0], coefficients[2, 0] = x1, x2, x3
    place_pack(work, 0, packed(two, both_0, three, 0.0))
    place_pack(work, faded, packed(e, w, shared * e, 0.0))
    x1, x2, x3 = x2 + x3, two, three
    coefficients[0, 1], coefficients[1, 1], coefficients[2, 1] = x1, x2, x3
    e, w = rate2 * (two * e0), ratev * (two * w0 + three * w0_shared)
    place_pack(work, faded + 4, packed(e, w, shared * e, 0.0))
    for i in range(1, order):
        step = 1.0 / (i + 1)
        even, odd = spread(4, 0.0), spread(4, 0.0)
        for pair in range((i - 1) >> 1):
            at = 8 * pair + 4
            back = faded + 4 * i - at
            odd = fused(pack_at(4, work, at), pack_at(4, work, back), odd)
            even = fused(pack_at(4, work, at + 4), pack_at(4, work, back - 4), even)
        if i & 1 == 0:
            odd = fused(pack_at(4, work, 4 * i - 4), pack_at(4, work, faded + 4), odd)
        known = even + odd
        two = c1 * x1 + c2 * x2 + gain * x3
        three = (a1 * x1 + a2 * x2 + a3 * x3) + k2 * e + kv * w
        fade = (number_of(known, 0) + two_0 * e) + two * e0
        slide = (number_of(known, 1) + number_of(known, 2)) + (both_0 * w + shared_0 * e)
        slide = (slide + two * w0) + three * w0_shared
        place_pack(work, 4 * i, packed(two, two + three, three, 0.0))
        x1, x2, x3 = (x2 + x3) * step, two * step, three * step
        coefficients[0, i + 1], coefficients[1, i + 1], coefficients[2, i + 1] = x1, x2, x3
        e, w = rate2 * step * fade, ratev * step * slide
        place_pack(work, faded + 4 * i + 4, packed(e, w, shared * e, 0.0))
    if max(fall2, fallv) > order:
        return reach_of(work, order, rate2, ratev, fall2, fallv)
    return inf


@compiled
def fadings(order: int) -> int:
    """Where in `work` the coefficients of the fadings begin."""
    return 4 * (order + 1)


@compiled
def reach_of(work: FloatArray, order: int, rate2: float, ratev: float, fall2: float, fallv: float) -> float:
    """Time within which neither exponent falls by more than `order`, nor from above to below UNSEEN.

    The exponents `fall2` and `fallv` change with the rates in `work`, two of every 4 numbers.
    """
    reach = inf
    for k in range(1, order + 1):
        known = pack_at(4, work, 4 * k - 4)
        for fall, change in ((fall2, rate2 * number_of(known, 0)), (fallv, ratev * number_of(known, 1))):
            if fall > order and change != 0.0:
                allowed = max(float(order), fall - UNSEEN)
                reach = min(reach, 0.5 * (allowed * k / abs(change)) ** (1.0 / k))
    return reach

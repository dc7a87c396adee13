"""Taylor series of the closed loop in a slip mode, all Stribeck shapes 1: the kernel that costs the time.

With the symbols of `loop_modes`: E = exp(-s2 x2/v_s^) obeys E' = -(s2/v_s^) x2' E, and exp(-|v|/v_s) the
like with v'. So each new coefficient of the state gives the next of E and W, and they the next of the state
(Knuth, The Art of Computer Programming, volume 2, 4.7), at one short convolution each. Where W is the
difference exp(-|v|/v_s) - E, its equation is W' = -(sv/v_s) (v' W + x3' E), and no digits are lost.

The three convolutions are one of packs (`packs`): slopes (., x3', x2', x2') with fadings (., W + E, E, W),
where W + E is W alone if W is no difference. What they cost is waiting, coefficient for coefficient, and so
nothing waits that need not. With y = (x2, x3, E, W), all terms that contain the two newest coefficients, or
the two first ones, are linear in those of order i and i - 1,

    (i + 1) y_{i+1} = b1 x1_i + (b2 + i c2) x2_i + (b3 + i c3) x3_i + b_e E_i + b_w W_i
                      + d_e E_{i-1} + d_w W_{i-1} + convolution of what is older (2..i - 2),

with columns b, c, d that are formed once; the convolution runs from its middle outwards, so that its newest
terms come last, and is laid out for every order (`unrolled`).
"""

from __future__ import annotations

from math import exp, inf
from typing import Any, Final

from compensation.bell_series import bell_series
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
    SHAPE2,
    SHAPEV,
    SIGN2,
    SIGNV,
    WIDTH2,
    WIDTHV,
    fading_difference,
    slip_row,
)
from compensation.series_reach import fadings, reach_of
from ident.simulation.compiled import compiled, passed, specialised, unrolled
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, spread


@compiled
def series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """Taylor coefficients of the state into rows 0..2 of `coefficients`; `order` is a literal.

    A mode with a bell is left to `bell_series`: here, as a function between the two costs time at every step.

    `work` keeps those of the slopes, 4 numbers each, and from `fadings(order)` on those of the fadings.
    Returns for how long the series hold: at many times v_s, E is lost in rounding, yet is back before v is
    small.
    """
    mode = slip_row(signs)
    if parameters[mode, SHAPE2] != 1.0 or parameters[mode, SHAPEV] != 1.0:
        return float(bell_series(signs, state, parameters, order, coefficients, work))
    a1, a2, a3 = parameters[mode, A1], parameters[mode, A2], parameters[mode, A3]
    c1, c2, gain = parameters[mode, C1], parameters[mode, C2], parameters[mode, GAIN]
    k2, kv, shared = parameters[mode, K2], parameters[mode, KV], parameters[mode, ALIKE]
    rate2 = -parameters[mode, SIGN2] / parameters[mode, WIDTH2]
    ratev = -parameters[mode, SIGNV] / parameters[mode, WIDTHV]
    x1, x2, x3 = state[0], state[1], state[2]
    fall2, fallv = -(rate2 * x2), -(ratev * (x2 + x3))
    e = exp(-fall2)
    w = fading_difference(e, fallv, ratev * x3) if shared != 0.0 else exp(-fallv)
    two = c1 * x1 + c2 * x2 + gain * x3
    three = (a1 * x1 + a2 * x2 + a3 * x3 + parameters[mode, K0]) + k2 * e + kv * w
    coefficients[0, 0], coefficients[1, 0], coefficients[2, 0] = x1, x2, x3
    x1 = x2 + x3
    coefficients[0, 1], coefficients[1, 1], coefficients[2, 1] = x1, two, three
    f, g, h = rate2 * e, ratev * w, ratev * (w + shared * e)
    e, w = f * two, g * two + h * three
    by1 = packed(c1, a1, f * c1, g * c1 + h * a1)
    by2 = packed(c2, a2, f * c2, g * c2 + h * a2)
    by3 = packed(gain, a3, f * gain, g * gain + h * a3)
    by_e = packed(0.0, k2, rate2 * two, ratev * shared * three + h * k2)
    by_w = packed(0.0, kv, 0.0, ratev * (two + three) + h * kv)
    more2 = packed(0.0, 0.0, rate2 * e, ratev * w)
    more3 = packed(0.0, 0.0, 0.0, ratev * (w + shared * e))
    slope = fused(by_e, spread(4, e), by_w * spread(4, w))
    slope = fused(by3, spread(4, three), slope)
    slope = fused(by1, spread(4, x1), fused(by2, spread(4, two), slope))
    x1 = 0.5 * (two + three)
    y = slope * spread(4, 0.5)
    coefficients[0, 2], coefficients[1, 2], coefficients[2, 2] = x1, number_of(y, 0), number_of(y, 1)
    two, three = number_of(slope, 0), number_of(slope, 1)
    second_e = packed(0.0, 0.0, rate2 * two, ratev * shared * three)
    second_w = packed(0.0, 0.0, 0.0, ratev * (two + three))
    rates, shares = packed(0.0, ratev, rate2, ratev), packed(0.0, shared * ratev, 0.0, 0.0)
    by2, by3 = by2 + more2, by3 + more3
    faded = fadings(order)
    given = (coefficients, work, faded, by1, by_e, by_w, more2, more3, second_e, second_w, rates, shares)
    unrolled(NEXT_ORDER, 2, order, (x1, y, by2, by3, spread(4, 0.0)), given)
    if max(fall2, fallv) > order:
        for k in range(1, order + 1):
            x2, v = coefficients[1, k], coefficients[1, k] + coefficients[2, k]
            place_pack(work, 4 * k, packed(rate2 * x2, ratev * v, 0.0, 0.0))
        return float(reach_of(work, 0, order, fall2, fallv))
    return inf


@specialised
def _next_order(i: int, carried: Any, given: Any) -> Any:
    """Coefficients i + 1 from those up to i >= 2; `carried` from one order to the next, `given` for all."""
    x1, y, by2, by3, second = carried
    coefficients, work, faded, by1, by_e, by_w, more2, more3, second_e, second_w, rates, shares = given
    step = spread(4, 1.0 / (i + 1))
    one, other = spread(4, 0.0), spread(4, 0.0)
    if i & 1 == 0 and i > 2:
        one = pack_at(4, work, 2 * i) * pack_at(4, work, faded + 2 * i)
    for j in range((i - 1) >> 1, 1, -1):
        at, back = 4 * j, 4 * (i - j)
        one = fused(pack_at(4, work, at), pack_at(4, work, faded + back), one)
        other = fused(pack_at(4, work, back), pack_at(4, work, faded + at), other)
    known = one + other
    known = packed(0.0, 0.0, number_of(known, 2), number_of(known, 1) + number_of(known, 3))
    here2, here3 = spread(4, number_of(y, 0)), spread(4, number_of(y, 1))
    here_e, here_w = spread(4, number_of(y, 2)), spread(4, number_of(y, 3))
    fading = packed(number_of(y, 3), number_of(y, 3), number_of(y, 2), number_of(y, 3))
    place_pack(work, faded + 4 * i, fused(here_e, shares, fading * rates))
    by2, by3 = by2 + more2, by3 + more3
    early = fused(by1, spread(4, x1), second) * step
    early = fused(by_e * step, here_e, fused(by2 * step, here2, early))
    x1 = (number_of(y, 0) + number_of(y, 1)) * number_of(step, 0)
    y = early + fused(known, step, fused(by_w * step, here_w, (by3 * step) * here3))
    coefficients[0, i + 1] = x1
    coefficients[1, i + 1], coefficients[2, i + 1] = number_of(y, 0), number_of(y, 1)
    slope = packed(number_of(y, 1), number_of(y, 1), number_of(y, 0), number_of(y, 0))
    place_pack(work, 4 * i, slope * spread(4, i + 1.0))
    return x1, y, by2, by3, fused(second_e, here_e, second_w * here_w)


NEXT_ORDER: Final = passed(_next_order)

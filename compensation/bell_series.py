"""Taylor series of the closed loop in a slip mode where a Stribeck curve is a bell, exp(-(s/v_s)^2).

With the symbols of `loop_series`: E = exp(-(x2/v_s^)^2) obeys E' = -(2/v_s^^2) (x2 x2') E, so that its rate
is the product x2 x2' where that of shape 1 is x2': one more convolution. Where W is the difference of the two
bells, its equation is W' = -(2/v_s^2) ((v v') W + (v v' - x2 x2') E), and the last bracket is v x3' + x3 x2',
0 where x3 is, bit for bit. One curve of a mode may have shape 1 and the other 2.
"""

from __future__ import annotations

from math import exp, inf
from typing import Any, Final

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
from ident.simulation.compiled import compiled, specialised
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, spread

BELL: Final = 2.0


@compiled
def rate_of(sign: float, width: float, bell: bool) -> float:
    """What the logarithm of a fading changes by with its rate: with s x2' or x2 x2'."""
    return -2.0 / (width * width) if bell else -sign / width


@specialised
def rates_of(product: Any, two: float, three: float, bell2: bool, bellv: bool) -> Any:
    """The rates (4,) of the fadings: products of factors and slopes for bells, else the slopes."""
    return packed(
        number_of(product, 0) if bell2 else two,
        number_of(product, 1) if bellv else two + three,
        number_of(product, 2) + number_of(product, 3) if bellv else three,
        0.0,
    )


@compiled
def bell_series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """As `loop_series.series` for shapes of 1 and 2.

    `work` keeps the rates, 4 numbers an order, from `fadings(order)` on the fadings (E, W, E or 0), and
    behind them the factors of the rates, (x2, v, v, x3) and (x2', v', x3', x2').
    """
    mode = slip_row(signs)
    a1, a2, a3 = parameters[mode, A1], parameters[mode, A2], parameters[mode, A3]
    c1, c2, gain = parameters[mode, C1], parameters[mode, C2], parameters[mode, GAIN]
    k2, kv, shared = parameters[mode, K2], parameters[mode, KV], parameters[mode, ALIKE]
    bell2, bellv = parameters[mode, SHAPE2] == BELL, parameters[mode, SHAPEV] == BELL
    rate2 = rate_of(parameters[mode, SIGN2], parameters[mode, WIDTH2], bell2)
    ratev = rate_of(parameters[mode, SIGNV], parameters[mode, WIDTHV], bellv)
    faded = fadings(order)
    factors, slopes = 2 * faded, 3 * faded
    x1, x2, x3 = state[0], state[1], state[2]
    v = x2 + x3
    fall2 = -0.5 * rate2 * x2 * x2 if bell2 else -rate2 * x2
    fallv = -0.5 * ratev * v * v if bellv else -ratev * v
    apart = 0.5 * ratev * x3 * (2.0 * x2 + x3) if bellv else ratev * x3
    e = exp(-fall2)
    w = fading_difference(e, fallv, apart) if shared != 0.0 else exp(-fallv)
    constant = parameters[mode, K0]
    coefficients[0, 0], coefficients[1, 0], coefficients[2, 0] = x1, x2, x3
    for i in range(order):
        two = c1 * x1 + c2 * x2 + gain * x3
        three = (a1 * x1 + a2 * x2 + a3 * x3 + constant) + k2 * e + kv * w
        constant = 0.0
        place_pack(work, faded + 4 * i, packed(e, w, shared * e, 0.0))
        place_pack(work, factors + 4 * i, packed(x2, x2 + x3, x2 + x3, x3))
        place_pack(work, slopes + 4 * i, packed(two, two + three, three, two))
        product = spread(4, 0.0)
        for j in range(i + 1):
            product = fused(
                pack_at(4, work, factors + 4 * j), pack_at(4, work, slopes + 4 * (i - j)), product
            )
        place_pack(work, 4 * i, rates_of(product, two, three, bell2, bellv))
        total = spread(4, 0.0)
        for j in range(i + 1):
            total = fused(pack_at(4, work, 4 * j), pack_at(4, work, faded + 4 * (i - j)), total)
        step = 1.0 / (i + 1)
        x1, x2, x3 = (x2 + x3) * step, two * step, three * step
        coefficients[0, i + 1], coefficients[1, i + 1], coefficients[2, i + 1] = x1, x2, x3
        e = rate2 * step * number_of(total, 0)
        w = ratev * step * (number_of(total, 1) + number_of(total, 2))
    if max(fall2, fallv) > order:
        exponents = 4 * faded
        for k in range(1, order + 1):
            rate = pack_at(4, work, 4 * k - 4)
            exponent2, exponentv = rate2 * number_of(rate, 0) / k, ratev * number_of(rate, 1) / k
            place_pack(work, exponents + 4 * k, packed(exponent2, exponentv, 0.0, 0.0))
        return reach_of(work, exponents, order, fall2, fallv)
    return inf

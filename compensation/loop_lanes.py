"""Taylor series of eight closed loops side by side, all Stribeck shapes 1: `loop_series`, a pack wide.

The symbols and the recurrences are those of `loop_series`; every number there is a pack here, so that no sum
waits for another. The coefficients of a mode, which lanes do not share, stand in a column each.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from compensation.loop_parameters import (
    A1,
    A2,
    A3,
    ALIKE,
    C1,
    C2,
    COLUMNS,
    GAIN,
    K0,
    K2,
    KV,
    SIGN2,
    SIGNV,
    WIDTH2,
    WIDTHV,
    slip_row,
)
from compensation.series_reach import reach_of
from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.lanes import LANES, LaneSystem
from ident.simulation.pack_functions import exponential, exponential_less_one
from ident.simulation.packs import chosen, fused, magnitude, pack_at, packed, place_pack, spread
from ident.simulation.taylor import ORDER

STATES: Final = 3
ROW: Final = LANES * (ORDER + 1)  # numbers of one series
SERIES: Final = 5  # of them in `work`; those beyond are memory
D3, DV, E, W = ROW, 2 * ROW, 3 * ROW, 4 * ROW  # in `work`, where those of x2' come first


@compiled
def enter(signs: Signs, parameters: FloatArray, lane: int, modes: FloatArray) -> None:
    """The coefficients of a slip mode into a column of `modes` (16, LANES)."""
    row = slip_row(signs)
    for i in range(COLUMNS):
        modes[i, lane] = parameters[row, i]


@compiled
def lane_series(
    modes: FloatArray, states: FloatArray, coefficients: FloatArray, work: FloatArray, reach: FloatArray
) -> None:
    """Taylor coefficients of all lanes into rows 0..2 of `coefficients` (rows, ORDER + 1, LANES).

    `states` (3, LANES); `reach` (LANES,) [s] is the time for which they hold.
    """
    a1, a2, a3 = _of(modes, A1), _of(modes, A2), _of(modes, A3)
    c1, c2, gain = _of(modes, C1), _of(modes, C2), _of(modes, GAIN)
    k2, kv, shared = _of(modes, K2), _of(modes, KV), _of(modes, ALIKE)
    x1, x2, x3 = pack_at(8, states, 0), pack_at(8, states, LANES), pack_at(8, states, 2 * LANES)
    none = spread(8, 0.0)
    rate2, ratev = (
        none - _of(modes, SIGN2) / _of(modes, WIDTH2),
        none - _of(modes, SIGNV) / _of(modes, WIDTHV),
    )
    e = exponential(rate2 * x2)
    apart = ratev * x3
    alone = exponential(ratev * (x2 + x3))
    difference = chosen(apart, e, none - alone) * exponential_less_one(none - magnitude(apart))
    w = chosen(shared, alone, difference)
    place_pack(work, E, e)
    place_pack(work, W, w)
    _keep(coefficients, 0, x1, x2, x3)
    e0, w0 = e, w
    w0_shared = w0 + shared * e0
    two = fused(c1, x1, fused(c2, x2, gain * x3))
    three = fused(kv, w, fused(k2, e, fused(a1, x1, fused(a2, x2, fused(a3, x3, _of(modes, K0))))))
    two_0, both_0, shared_0 = two, two + three, shared * three
    place_pack(work, 0, two)
    place_pack(work, D3, three)
    place_pack(work, DV, both_0)
    x1, x2, x3 = x2 + x3, two, three
    _keep(coefficients, 1, x1, x2, x3)
    e, w = rate2 * (two * e0), ratev * fused(two, w0, three * w0_shared)
    for i in range(1, ORDER):
        place_pack(work, E + LANES * i, e)
        place_pack(work, W + LANES * i, w)
        fade, slide, share = none, none, none
        for j in range(1, i):
            back = LANES * (i - j)
            faded = pack_at(8, work, E + back)
            fade = fused(pack_at(8, work, LANES * j), faded, fade)
            share = fused(pack_at(8, work, D3 + LANES * j), faded, share)
            slide = fused(pack_at(8, work, DV + LANES * j), pack_at(8, work, W + back), slide)
        two = fused(c1, x1, fused(c2, x2, gain * x3))
        three = fused(kv, w, fused(k2, e, fused(a1, x1, fused(a2, x2, a3 * x3))))
        place_pack(work, LANES * i, two)
        place_pack(work, D3 + LANES * i, three)
        place_pack(work, DV + LANES * i, two + three)
        fade = fused(two, e0, fused(two_0, e, fade))
        slide = fused(shared, share, slide) + fused(both_0, w, shared_0 * e)
        slide = fused(three, w0_shared, fused(two, w0, slide))
        step = spread(8, 1.0 / (i + 1))
        x1, x2, x3 = (x2 + x3) * step, two * step, three * step
        _keep(coefficients, i + 1, x1, x2, x3)
        e, w = rate2 * step * fade, ratev * step * slide
    for lane in range(LANES):
        reach[lane] = inf
        by_estimate = modes[SIGN2, lane] / modes[WIDTH2, lane]
        by_velocity = modes[SIGNV, lane] / modes[WIDTHV, lane]
        estimate, velocity = states[1, lane], states[1, lane] + states[2, lane]
        fall2, fallv = by_estimate * estimate, by_velocity * velocity
        if max(fall2, fallv) > ORDER:
            for k in range(1, ORDER + 1):
                x2, x3 = coefficients[1, k, lane], coefficients[2, k, lane]
                exponents = packed(by_estimate * x2, by_velocity * (x2 + x3), 0.0, 0.0)
                place_pack(work, SERIES * ROW + 4 * k, exponents)
            reach[lane] = reach_of(work, SERIES * ROW, ORDER, fall2, fallv)


@specialised
def _of(modes: FloatArray, column: int) -> Any:
    return pack_at(8, modes, LANES * column)


@specialised
def _keep(coefficients: FloatArray, order: int, x1: Any, x2: Any, x3: Any) -> None:
    place_pack(coefficients, LANES * order, x1)
    place_pack(coefficients, ROW + LANES * order, x2)
    place_pack(coefficients, 2 * ROW + LANES * order, x3)


LOOP_LANES: Final = LaneSystem(enter=passed(enter), series=passed(lane_series))

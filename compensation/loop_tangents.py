"""Deviations from a trajectory of the closed loop: its modes linearised, as kernels.

The nine states are (x1, x2, x3) and two deviations from it, which span a section of the state space.
Their Taylor recurrences are the derivatives of those in `loop_modes`, their fields its Jacobian times
the deviation.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Any, Final

from compensation.bell_series import BELL, bell_series, rate_of, rates_of
from compensation.loop_modes import field
from compensation.loop_parameters import (
    A1,
    A2,
    A3,
    ALIKE,
    C1,
    C2,
    GAIN,
    GOAL,
    K2,
    KV,
    RATE,
    SHAPE2,
    SHAPEV,
    SIGN2,
    SIGNV,
    WIDTH2,
    WIDTHV,
    slip_row,
)
from compensation.loop_series import fadings
from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, Signs, no_slide, no_slide_at
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, spread

STATES: Final = 3
DEVIATIONS: Final = 2


@compiled
def _faded(signed: float, width: float, shape: float) -> tuple[float, float]:
    """exp(-(s/v_s)^beta) and its derivative by s, at s = `signed`."""
    if shape == 1.0:
        value = exp(-signed / width)
        return value, -value / width
    speed = abs(signed)
    power = (speed / width) ** shape
    value = exp(-power)
    slope = -value * shape * power / speed if speed > 0.0 else 0.0
    return value, slope if signed >= 0.0 else -slope


@compiled
def tangent_field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    """Time derivatives (9,) of the state and of two deviations."""
    field(signs, state[:STATES], parameters, out[:STATES])
    k = parameters[slip_row(signs)]
    _, slope2 = _faded(k[SIGN2] * state[1], k[WIDTH2], k[SHAPE2])
    _, slopev = _faded(k[SIGNV] * (state[1] + state[2]), k[WIDTHV], k[SHAPEV])
    by_estimate, by_velocity = k[SIGN2] * slope2, k[SIGNV] * slopev
    factor = k[K2] - k[KV] if k[ALIKE] != 0.0 else k[K2]
    for d in range(1, 1 + DEVIATIONS):
        i = STATES * d
        e1, e2, e3 = state[i], state[i + 1], state[i + 2]
        out[i] = e2 + e3
        out[i + 1] = k[C1] * e1 + k[C2] * e2 + k[GAIN] * e3
        out[i + 2] = (
            k[A1] * e1 + k[A2] * e2 + k[A3] * e3 + factor * by_estimate * e2 + k[KV] * by_velocity * (e2 + e3)
        )


@compiled
def tangent_series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """Taylor coefficients of the state and of two deviations into rows 0..8, shapes 1 or 2."""
    reach = bell_series(signs, state[:STATES], parameters, order, coefficients, work)
    mode = slip_row(signs)
    a1, a2, a3 = parameters[mode, A1], parameters[mode, A2], parameters[mode, A3]
    c1, c2, gain = parameters[mode, C1], parameters[mode, C2], parameters[mode, GAIN]
    k2, kv, shared = parameters[mode, K2], parameters[mode, KV], parameters[mode, ALIKE]
    bell2, bellv = parameters[mode, SHAPE2] == BELL, parameters[mode, SHAPEV] == BELL
    rate2 = rate_of(parameters[mode, SIGN2], parameters[mode, WIDTH2], bell2)
    ratev = rate_of(parameters[mode, SIGNV], parameters[mode, WIDTHV], bellv)
    faded = fadings(order)
    factors, slopes = 2 * faded, 3 * faded
    start = pack_at(4, work, faded)
    here2, here3 = state[1], state[2]
    for d in range(1, 1 + DEVIATIONS):
        s = STATES * d
        own = 4 * faded * d  # where the deviation's share of `work` begins, in the order of the state's
        x1, x2, x3 = state[s], state[s + 1], state[s + 2]
        coefficients[s, 0], coefficients[s + 1, 0], coefficients[s + 2, 0] = x1, x2, x3
        begun2, begunv, apart = x2, x2 + x3, x3
        if bell2:
            begun2 = here2 * x2
        if bellv:
            begunv, apart = (here2 + here3) * (x2 + x3), here3 * x2 + (here2 + here3) * x3
        e = rate2 * number_of(start, 0) * begun2
        w = ratev * (number_of(start, 1) * begunv + number_of(start, 2) * apart)
        for i in range(order):
            two = c1 * x1 + c2 * x2 + gain * x3
            three = a1 * x1 + a2 * x2 + a3 * x3 + k2 * e + kv * w
            place_pack(work, own + faded + 4 * i, packed(e, w, shared * e, 0.0))
            product = spread(4, 0.0)
            if bell2 or bellv:
                place_pack(work, own + factors + 4 * i, packed(x2, x2 + x3, x2 + x3, x3))
                place_pack(work, own + slopes + 4 * i, packed(two, two + three, three, two))
                product = _crossed(work, own, factors, slopes, i)
            place_pack(work, own + 4 * i, rates_of(product, two, three, bell2, bellv))
            total = _crossed(work, own, 0, faded, i)
            step = 1.0 / (i + 1)
            x1, x2, x3 = (x2 + x3) * step, two * step, three * step
            coefficients[s, i + 1], coefficients[s + 1, i + 1], coefficients[s + 2, i + 1] = x1, x2, x3
            e = rate2 * step * number_of(total, 0)
            w = ratev * step * (number_of(total, 1) + number_of(total, 2))
    return reach


@specialised
def _crossed(work: FloatArray, own: int, first: int, second: int, i: int) -> Any:
    """Coefficient i of the deviation of a product: each factor's deviation with the other factor."""
    one, other = spread(4, 0.0), spread(4, 0.0)
    for j in range(i + 1):
        at, back = 4 * j, 4 * (i - j)
        one = fused(pack_at(4, work, own + first + at), pack_at(4, work, second + back), one)
        other = fused(pack_at(4, work, first + at), pack_at(4, work, own + second + back), other)
    return one + other


@compiled
def stick_deviations(deviations: FloatArray, sign: int, parameters: FloatArray, duration: float) -> None:
    """Carry deviations (2, 3) of a sticking state, in place: x1 stays, x2 forgets its start."""
    k = parameters[4 + (1 if sign > 0 else 0)]
    forgotten = -expm1(-k[RATE] * duration)
    for i in range(deviations.shape[0]):
        deviations[i, 1] += (k[GOAL] * deviations[i, 0] - deviations[i, 1]) * forgotten
        deviations[i, 2] = -deviations[i, 1]


TANGENTS: Final = FilippovSystem(
    field=passed(tangent_field),
    series=passed(tangent_series),
    slide=passed(no_slide),
    slide_at=passed(no_slide_at),
)

"""Deviations from a trajectory of the closed loop: its modes linearised, as kernels.

The nine states are (x1, x2, x3) and two deviations from it, which span a section of the state space.
Their Taylor recurrences are the derivatives of those in `loop_modes`, their fields its Jacobian times
the deviation.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Final

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
)
from compensation.loop_series import fadings, series
from ident.simulation.compiled import compiled, passed
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
    k = parameters[(2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)]
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
    """Taylor coefficients of the state and of two deviations into rows 0..8, all shapes 1."""
    reach = series(signs, state[:STATES], parameters, order, coefficients, work)
    mode = (2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)
    a1, a2, a3 = parameters[mode, A1], parameters[mode, A2], parameters[mode, A3]
    c1, c2, gain = parameters[mode, C1], parameters[mode, C2], parameters[mode, GAIN]
    k2, kv, shared = parameters[mode, K2], parameters[mode, KV], parameters[mode, ALIKE]
    rate2 = -parameters[mode, SIGN2] / parameters[mode, WIDTH2]
    ratev = -parameters[mode, SIGNV] / parameters[mode, WIDTHV]
    faded = fadings(order)
    for d in range(1, 1 + DEVIATIONS):
        s = STATES * d
        rates, fades = 2 * faded * d, 2 * faded * d + faded  # where those of the deviation begin in `work`
        x1, x2, x3 = state[s], state[s + 1], state[s + 2]
        coefficients[s, 0], coefficients[s + 1, 0], coefficients[s + 2, 0] = x1, x2, x3
        start = pack_at(4, work, faded)
        e = rate2 * number_of(start, 0) * x2
        w = ratev * (number_of(start, 1) * (x2 + x3) + number_of(start, 2) * x3)
        place_pack(work, fades, packed(e, w, shared * e, 0.0))
        for i in range(order):
            step = 1.0 / (i + 1)
            two = c1 * x1 + c2 * x2 + gain * x3
            three = a1 * x1 + a2 * x2 + a3 * x3 + k2 * e + kv * w
            place_pack(work, rates + 4 * i, packed(two, two + three, three, 0.0))
            x1, x2, x3 = (x2 + x3) * step, two * step, three * step
            coefficients[s, i + 1], coefficients[s + 1, i + 1], coefficients[s + 2, i + 1] = x1, x2, x3
            own, base = spread(4, 0.0), spread(4, 0.0)
            for ahead in range(i + 1):
                at, back = 4 * ahead, 4 * (i - ahead)
                own = fused(pack_at(4, work, rates + at), pack_at(4, work, faded + back), own)
                base = fused(pack_at(4, work, at), pack_at(4, work, fades + back), base)
            both = own + base
            e = rate2 * step * number_of(both, 0)
            w = ratev * step * (number_of(both, 1) + number_of(both, 2))
            place_pack(work, fades + 4 * i + 4, packed(e, w, shared * e, 0.0))
    return reach


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

"""Deviations from a trajectory of the closed loop: its modes linearised, as kernels.

The nine states are (x1, x2, x3) and two deviations from it, which span a section of the state space, as
the columns of a matrix (3, 2): its rows follow the state. Their fields are the Jacobian of `loop_modes` times
the deviation: with its symbols, a deviation d of the state changes E by -(s2/v_s^) E d2 and exp(-|v|/v_s)
by -(sv/v_s) exp(-|v|/v_s) (d2 + d3). So its Taylor recurrence needs the series of the state and two
convolutions. Packs hold both deviations.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Any, Final

from compensation.bell_series import BELL, bell_series, rate_of
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
from compensation.series_reach import fadings
from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, Signs, no_slide, no_slide_at
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, spread

STATES: Final = 3
DEVIATIONS: Final = 2
ROW1, ROW2, ROW3 = STATES, STATES + DEVIATIONS, STATES + 2 * DEVIATIONS  # of the deviations of x1, x2, x3


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
    for d in range(DEVIATIONS):
        one, two, three = ROW1 + d, ROW2 + d, ROW3 + d
        e1, e2, e3 = state[one], state[two], state[three]
        out[one] = e2 + e3
        out[two] = k[C1] * e1 + k[C2] * e2 + k[GAIN] * e3
        out[three] = (
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
    bell2, bellv = parameters[mode, SHAPE2] == BELL, parameters[mode, SHAPEV] == BELL
    rate2 = rate_of(parameters[mode, SIGN2], parameters[mode, WIDTH2], bell2)
    ratev = rate_of(parameters[mode, SIGNV], parameters[mode, WIDTHV], bellv)
    by2 = (parameters[mode, K2] - parameters[mode, ALIKE] * parameters[mode, KV]) * rate2
    weights = 4 * fadings(order)
    _weigh(order, by2, parameters[mode, KV] * ratev, bell2, bellv, work, weights)
    now = pack_at(4, work, weights)
    now2, nowv = number_of(now, 0), number_of(now, 2)
    a1, a2 = spread(2, parameters[mode, A1]), spread(2, parameters[mode, A2] + now2 + nowv)
    a3, gain = spread(2, parameters[mode, A3] + nowv), spread(2, parameters[mode, GAIN])
    c1, c2 = spread(2, parameters[mode, C1]), spread(2, parameters[mode, C2])
    x1, x2, x3 = pack_at(2, state, ROW1), pack_at(2, state, ROW2), pack_at(2, state, ROW3)
    _keep(coefficients, 0, x1, x2, x3)
    own = weights + fadings(order)
    for i in range(order):
        by_estimate, by_velocity = spread(2, 0.0), spread(2, 0.0)
        for j in range(i):
            at, back = own + 4 * j, weights + 4 * (i - j)
            by_estimate = fused(pack_at(2, work, at), pack_at(2, work, back), by_estimate)
            by_velocity = fused(pack_at(2, work, at + 2), pack_at(2, work, back + 2), by_velocity)
        v = x2 + x3
        place_pack(work, own + 4 * i, x2)
        place_pack(work, own + 4 * i + 2, v)
        two = fused(gain, x3, fused(c2, x2, c1 * x1))
        three = fused(a2, x2, fused(a3, x3, fused(a1, x1, by_estimate + by_velocity)))
        step = spread(2, 1.0 / (i + 1))
        x1, x2, x3 = v * step, two * step, three * step
        _keep(coefficients, i + 1, x1, x2, x3)
    return reach


@specialised
def _keep(coefficients: FloatArray, order: int, x1: Any, x2: Any, x3: Any) -> None:
    coefficients[ROW1, order], coefficients[ROW1 + 1, order] = number_of(x1, 0), number_of(x1, 1)
    coefficients[ROW2, order], coefficients[ROW2 + 1, order] = number_of(x2, 0), number_of(x2, 1)
    coefficients[ROW3, order], coefficients[ROW3 + 1, order] = number_of(x3, 0), number_of(x3, 1)


@specialised
def _weigh(
    order: int, by2: float, byv: float, bell2: bool, bellv: bool, work: FloatArray, weights: int
) -> None:
    """The series by which deviations of x2 and of v accelerate, twice each, into `work` from `weights` on.

    They are `by2` E and `byv` exp(-|v|/v_s) where the shape is 1, of a bell `by2` x2 E and `byv` v
    exp(-(v/v_s)^2).
    """
    faded = fadings(order)
    factors, alone = 2 * faded, weights + faded
    for i in range(order):
        here = pack_at(4, work, faded + 4 * i)
        e, w = by2 * number_of(here, 0), byv * (number_of(here, 1) + number_of(here, 2))
        place_pack(work, weights + 4 * i, packed(e, e, w, w))
        if bell2 or bellv:
            place_pack(work, alone + 4 * i, packed(e, e, w, w))
    if not (bell2 or bellv):
        return
    for i in range(order):
        total = spread(4, 0.0)
        for j in range(i + 1):
            factor = pack_at(4, work, factors + 4 * j)
            x2, v = number_of(factor, 0), number_of(factor, 1)
            total = fused(packed(x2, x2, v, v), pack_at(4, work, alone + 4 * (i - j)), total)
        own = pack_at(4, work, alone + 4 * i)
        e = number_of(total, 0) if bell2 else number_of(own, 0)
        w = number_of(total, 2) if bellv else number_of(own, 2)
        place_pack(work, weights + 4 * i, packed(e, e, w, w))


@compiled
def stick_deviations(deviations: FloatArray, sign: int, parameters: FloatArray, duration: float) -> None:
    """Carry deviations (3, 2) of a sticking state, in place: x1 stays, x2 forgets its start."""
    k = parameters[4 + (1 if sign > 0 else 0)]
    forgotten = -expm1(-k[RATE] * duration)
    for i in range(DEVIATIONS):
        deviations[1, i] += (k[GOAL] * deviations[0, i] - deviations[1, i]) * forgotten
        deviations[2, i] = -deviations[1, i]


TANGENTS: Final = FilippovSystem(
    field=passed(tangent_field),
    series=passed(tangent_series),
    slide=passed(no_slide),
    slide_at=passed(no_slide_at),
)

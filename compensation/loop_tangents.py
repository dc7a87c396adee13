"""Deviations from a trajectory of the closed loop: its modes linearised, as kernels.

The nine states are (x1, x2, x3) and two deviations from it, which span a section of the state space.
Their Taylor recurrences are the derivatives of those in `loop_modes`, their fields its Jacobian times
the deviation.
"""

from __future__ import annotations

from math import exp, expm1
from typing import Final

import numpy as np

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
from compensation.loop_series import series
from ident.simulation.compiled import compiled, passed
from ident.simulation.filippov_system import FilippovSystem, FloatArray, Signs, no_slide, no_slide_at

STATES: Final = 3
DEVIATIONS: Final = 2
SERIES_ROWS: Final = 5  # rows of `work` that the series of the states takes, and of each deviation


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
    k = parameters[(2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)]
    a1, a2, a3, k2, kv = k[A1], k[A2], k[A3], k[K2], k[KV]
    c1, c2, gain = k[C1], k[C2], k[GAIN]
    alike = k[ALIKE] != 0.0
    shared = 1.0 if alike else 0.0
    d2, d3, dv, e, w = work[0], work[1], work[2], work[3], work[4]
    rate2, ratev = -k[SIGN2] / k[WIDTH2], -k[SIGNV] / k[WIDTHV]
    for d in range(1, 1 + DEVIATIONS):
        s = STATES * d
        p1, p2, p3 = coefficients[s], coefficients[s + 1], coefficients[s + 2]
        own = work[SERIES_ROWS * d :]
        t2, t3, tv, te, tw = own[0], own[1], own[2], own[3], own[4]
        p1[0], p2[0], p3[0] = state[s], state[s + 1], state[s + 2]
        te[0] = rate2 * e[0] * p2[0]
        if alike:
            tw[0] = ratev * (w[0] * (p2[0] + p3[0]) + e[0] * p3[0])
        else:
            tw[0] = ratev * w[0] * (p2[0] + p3[0])
        for i in range(order):
            step = 1.0 / (i + 1)
            two = c1 * p1[i] + c2 * p2[i] + gain * p3[i]
            three = a1 * p1[i] + a2 * p2[i] + a3 * p3[i] + k2 * te[i] + kv * tw[i]
            t2[i], t3[i], tv[i] = two, three, two + three
            p1[i + 1] = (p2[i] + p3[i]) * step
            p2[i + 1] = two * step
            p3[i + 1] = three * step
            fade, fade_base = 0.0, 0.0  # every sum is a chain of its own: they do not wait for each other
            slide, slide_base = 0.0, 0.0
            share, share_base = 0.0, 0.0
            for ahead in range(i + 1):
                j, back = np.uint64(ahead), np.uint64(i - ahead)
                fade += t2[j] * e[back]
                slide += tv[j] * w[back]
                share += t3[j] * e[back]
                fade_base += d2[j] * te[back]
                slide_base += dv[j] * tw[back]
                share_base += d3[j] * te[back]
            te[i + 1] = rate2 * step * (fade + fade_base)
            tw[i + 1] = ratev * step * ((slide + slide_base) + shared * (share + share_base))
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

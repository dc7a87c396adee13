"""Taylor series of the closed loop in a slip mode, all Stribeck shapes 1: the kernel that costs the time.

With the symbols of `loop_modes`: E = exp(-s2 x2/v_s^) obeys E' = -(s2/v_s^) x2' E, and exp(-|v|/v_s) the
like with v'. So each new coefficient of the state gives the next of E and W, and they the next of the state
(Knuth, The Art of Computer Programming, volume 2, 4.7), at one short convolution each. Where W is the
difference exp(-|v|/v_s) - E, its equation is W' = -(sv/v_s) (v' W + x3' E), and no digits are lost.

A convolution is summed in two interleaved halves: additions wait for each other, and two chains wait half as
long; the terms with the newest coefficients come last, from registers, so that all others are summed while
those are still awaited. Indices are unsigned where they are differences, which spares a test for negative
ones.
"""

from __future__ import annotations

from math import exp, inf
from typing import Final

import numpy as np

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
)
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray, Signs

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

    `work` keeps those of x2', x3', v', E and W in rows 0..4. Returns for how long they hold: at many times
    v_s, E is lost in rounding, yet is back before v is small.
    """
    k = parameters[(2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)]
    a1, a2, a3, k2, kv = k[A1], k[A2], k[A3], k[K2], k[KV]
    c1, c2, gain = k[C1], k[C2], k[GAIN]
    shared = 1.0 if k[ALIKE] != 0.0 else 0.0
    p1, p2, p3 = coefficients[0], coefficients[1], coefficients[2]
    d2, d3, dv, faded, slid = work[0], work[1], work[2], work[3], work[4]
    x1, x2, x3 = state[0], state[1], state[2]
    p1[0], p2[0], p3[0] = x1, x2, x3
    rate2, ratev = -k[SIGN2] / k[WIDTH2], -k[SIGNV] / k[WIDTHV]
    by_velocity = k[SIGNV] * (x2 + x3) / k[WIDTHV]
    e = exp(-(k[SIGN2] * x2 / k[WIDTH2]))
    w = fading_difference(e, by_velocity, -k[SIGNV] * x3 / k[WIDTHV]) if shared != 0.0 else exp(-by_velocity)
    faded[0], slid[0] = e, w
    e0, w0, shared_e0 = e, w, shared * e
    two_0 = c1 * x1 + c2 * x2 + gain * x3
    three_0 = (a1 * x1 + a2 * x2 + a3 * x3 + k[K0]) + k2 * e + kv * w
    both_0, shared_0 = two_0 + three_0, shared * three_0
    d2[0], d3[0], dv[0] = two_0, three_0, both_0
    x1, x2, x3 = x2 + x3, two_0, three_0
    p1[1], p2[1], p3[1] = x1, x2, x3
    e, w = rate2 * (two_0 * e0), ratev * (both_0 * w0 + three_0 * shared_e0)
    faded[1], slid[1] = e, w
    for i in range(1, order):
        step = 1.0 / (i + 1)
        fade, fade_odd = 0.0, 0.0
        slide, slide_odd = 0.0, 0.0
        share, share_odd = 0.0, 0.0
        for pair in range((i - 1) >> 1):
            odd, even = np.uint64(2 * pair + 1), np.uint64(2 * pair + 2)
            back, further = np.uint64(i - 2 * pair - 1), np.uint64(i - 2 * pair - 2)
            fade_odd += d2[odd] * faded[back]
            slide_odd += dv[odd] * slid[back]
            share_odd += d3[odd] * faded[back]
            fade += d2[even] * faded[further]
            slide += dv[even] * slid[further]
            share += d3[even] * faded[further]
        if i & 1 == 0:
            before = np.uint64(i - 1)
            fade += d2[before] * faded[1]
            slide += dv[before] * slid[1]
            share += d3[before] * faded[1]
        two = c1 * x1 + c2 * x2 + gain * x3
        three = (a1 * x1 + a2 * x2 + a3 * x3) + k2 * e + kv * w
        both = two + three
        fade = (fade + fade_odd) + two_0 * e
        slide = (slide + slide_odd) + shared * (share + share_odd) + (both_0 * w + shared_0 * e)
        x1, x2, x3 = (x2 + x3) * step, two * step, three * step
        p1[i + 1], p2[i + 1], p3[i + 1] = x1, x2, x3
        d2[i], d3[i], dv[i] = two, three, both
        e = rate2 * step * (fade + two * e0)
        w = ratev * step * (slide + (both * w0 + three * shared_e0))
        faded[i + 1], slid[i + 1] = e, w
    if -rate2 * p2[0] > order or -ratev * (p2[0] + p3[0]) > order:
        return _reach(coefficients, order, rate2, ratev)
    return inf


@compiled
def _reach(coefficients: FloatArray, order: int, rate2: float, ratev: float) -> float:
    """Time within which neither exponent falls by more than `order`, nor from above to below UNSEEN."""
    reach = inf
    for k in range(1, order + 1):
        two = coefficients[1, k]
        for rate, start, term in (
            (rate2, coefficients[1, 0], two),
            (ratev, coefficients[1, 0] + coefficients[2, 0], two + coefficients[2, k]),
        ):
            exponent = -rate * start
            if exponent > order and term != 0.0:
                allowed = max(float(order), exponent - UNSEEN)
                reach = min(reach, 0.5 * (allowed / abs(rate * term)) ** (1.0 / k))
    return reach

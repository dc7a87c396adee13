r"""Slip under a given torque, as a Taylor series in time.

In one direction of motion, with the speed s = |v| > 0 and the torque u in that direction,

    J s' = (u - F_s) + u' t - b s + dF G,    G = 1 - E,    E = exp(-y),    y = (s / v_s)^beta,

which is eq (1) with eq (3), written with F_s so that nothing cancels near rest. E' = -y' E, and s y' = beta
y s': the coefficients of s, y and E follow from each other by short convolutions, at any order. For beta =
1, y is s / v_s itself and the series is as good at s = 0 as elsewhere; for any other beta it exists for s >
0 only (`ident.near_rest` covers the rest of the way).

Coefficients are scaled by the step, c_k = s^(k)(0) h^k / k!, so that c_k is the size of its term at the
step's end. The step is the series' own: where the last terms are not yet below the tolerance, it is
shortened until they are. A link that slows down from far above v_s meets a friction that its first terms
cannot know, E being below rounding there and growing exponentially; its step therefore ends where y reaches
45 (E = 3e-20), and below that y changes by 1.5 a step at most. So it does in both directions where beta is
not 1, because the terms of exp(-y) then pass through zeros, as Hermite's polynomials do, and small last
terms prove nothing.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.simulation.compiled import compiled, owning

ORDER: Final = 24  # highest order; a step of 1 ms of Table 1's robot ends at 8 to 14
TOLERANCE: Final = 2e-17  # last terms, relative to the speed (to s + v_s where beta = 1)
_FELT: Final = 45.0  # largest y whose E is felt
_CHANGE: Final = 1.5  # largest change of y in a step
_EXACT_ROOT: Final = 4e-16


@owning
def workspace() -> FloatArray:
    """Room for the coefficients of s, E and y, (3, ORDER + 1)."""
    return np.empty((3, ORDER + 1))


@compiled
def _largest_change(speed: float, power: float, shape: float) -> float:
    """How far the speed may fall in one step, or for beta other than 1 rise while E is felt [rad/s]."""
    if power > _FELT + _CHANGE:
        return speed * (1.0 - math.pow(_FELT / power, 1.0 / shape))
    return speed * _CHANGE / (shape * power)


@compiled
def expand(
    speed: float, drive: tuple[float, float], step: float, body: tuple[float, FloatArray], series: FloatArray
) -> tuple[int, float]:
    """Fill `series` from `speed` [rad/s]; its order, and the step [s] on which it holds, at most `step`.

    `drive` is u - F_s [N m] at the step's start and u' [N m/s]; `body` is J [kg m^2] and the curve (5,) of
    the direction, F_s, F_c, v_s, b, beta.
    """
    (excess, ramp), (inertia, curve) = drive, body
    stribeck_torque, scale = curve[0] - curve[1], curve[2]
    damping, shape = curve[3], curve[4]
    plain = shape == 1.0 or stribeck_torque == 0.0
    s, fading, power = series[0], series[1], series[2]
    ratio = speed / scale
    power[0] = ratio if plain else math.pow(ratio, shape)
    fading[0] = math.exp(-power[0])
    risen = -math.expm1(-power[0])
    s[0] = speed
    tolerance = TOLERANCE * (speed + scale) if plain else TOLERANCE * speed
    previous = math.inf
    for k in range(1, ORDER + 1):
        if k == 1:
            rate = excess - damping * speed + stribeck_torque * risen
        else:
            rate = -damping * s[k - 1] - stribeck_torque * fading[k - 1]
        if k == 2:
            rate += ramp * step
        s[k] = step * rate / (inertia * k)
        if k == 1:
            change = 1e3 * (speed + scale) if plain else 4.0 * speed  # far beyond the series' radius
            if s[1] < 0.0 or (power[0] < _FELT and not plain):
                change = min(change, _largest_change(speed, power[0], 1.0 if plain else shape))
            if abs(s[1]) > change:
                shorter = change / abs(s[1])
                step *= shorter
                s[1] *= shorter
        size = abs(s[k])
        if k > 2 and size <= tolerance and previous <= tolerance:
            return k, step
        if k == ORDER:
            break
        if plain:
            power[k] = s[k] / scale
        else:
            total = 0.0
            for j in range(1, k + 1):
                total += (shape * j - (k - j)) * s[j] * power[k - j]
            power[k] = total / (k * speed)
        total = 0.0
        for j in range(1, k + 1):
            total += j * power[j] * fading[k - j]
        fading[k] = -total / k
        previous = size
    last = math.pow(tolerance / max(abs(s[ORDER]), tolerance), 1.0 / ORDER)
    before = math.pow(tolerance / max(abs(s[ORDER - 1]), tolerance), 1.0 / (ORDER - 1))
    shrink = 0.95 * min(last, before)
    factor = 1.0
    for k in range(1, ORDER + 1):
        factor *= shrink
        s[k] *= factor
    return ORDER, step * shrink


@compiled
def speed_at(series: FloatArray, order: int, part: float) -> float:
    """Speed [rad/s] at the `part` (0 to 1) of the step."""
    total = 0.0
    for k in range(order, -1, -1):
        total = total * part + series[0, k]
    return total


@compiled
def distance_at(series: FloatArray, order: int, part: float, step: float) -> float:
    """Distance [rad] covered up to the `part` (0 to 1) of the `step` [s]."""
    total = 0.0
    for k in range(order, -1, -1):
        total = total * part + series[0, k] / (k + 1)
    return total * part * step


@compiled
def part_at_rest(series: FloatArray, order: int) -> float:
    """The part of the step at which the speed, falling all the way through it, is 0: Newton inside a
    bracket.
    """
    low, high = 0.0, 1.0
    part = float(series[0, 0] / (series[0, 0] - speed_at(series, order, 1.0)))
    for _ in range(80):
        value, slope = 0.0, 0.0
        for k in range(order, -1, -1):
            slope = slope * part + value
            value = value * part + series[0, k]
        if value > 0.0:
            low = part
        else:
            high = part
        guess = part - value / slope if slope < 0.0 else 0.5 * (low + high)
        if not low <= guess <= high:
            guess = 0.5 * (low + high)
        if abs(guess - part) <= _EXACT_ROOT * part:
            return guess
        part = guess
    return part


@compiled
def part_at_distance(series: FloatArray, order: int, step: float, distance: float) -> float:
    """The part of the step at which `distance` [rad], less than the whole step's, is covered."""
    low, high = 0.0, 1.0
    part = 0.5
    for _ in range(80):
        value = distance_at(series, order, part, step) - distance
        if value < 0.0:
            low = part
        else:
            high = part
        slope = step * speed_at(series, order, part)
        guess = part - value / slope if slope > 0.0 else 0.5 * (low + high)
        if not low <= guess <= high:
            guess = 0.5 * (low + high)
        if abs(guess - part) <= _EXACT_ROOT * part:
            return guess
        part = guess
    return part

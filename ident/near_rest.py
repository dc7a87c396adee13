r"""The first and last moments of a slip where beta is not 1.

At s = 0 the law goes like s^beta: for beta < 1 its slope is infinite there, for any beta but 1 and 2 no
Taylor series starts there. While the torque u is held, though, the motion is a quadrature: with the excess
torque c = u - F_s of the direction of motion,

    t(s) = \int_0^s J dw / |c - b w + dF G(w)|,        x(s) = \int_0^s w J dw / |c - b w + dF G(w)|,

the time and distance from rest (c > 0) or to rest (c < 0). The quadrature is used only where friction
differs from F_s by less than a quarter of |c| and y < 1/4, so that the integrand neither changes sign nor
comes near a pole; w = s z^m makes it smooth at z = 0, and Gauss-Legendre with 20 nodes is then exact to
rounding. Given the time, the speed follows by Newton's method, whose derivative is the integrand.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.simulation.compiled import compiled

_GAUSS: Final = np.polynomial.legendre.leggauss(20)
_NODES: Final = 0.5 * (_GAUSS[0] + 1.0)
_WEIGHTS: Final = 0.5 * _GAUSS[1]


@compiled
def acceleration(speed: float, excess: float, inertia: float, curve: FloatArray) -> float:
    """s' [rad/s^2] at the speed s >= 0 under the held torque F_s + `excess`.

    `curve` (5,) holds F_s, F_c, v_s, b, beta of the direction.
    """
    risen = -math.expm1(-math.pow(speed / curve[2], curve[4]))
    return float((excess - curve[3] * speed + (curve[0] - curve[1]) * risen) / inertia)


@compiled
def speed_limit(excess: float, curve: FloatArray) -> float:
    """The speed [rad/s] below which friction differs little from F_s."""
    share = 0.125 * abs(excess)
    limit = curve[2] * math.pow(min(share / (curve[0] - curve[1]), 0.25), 1.0 / curve[4])
    return float(min(limit, share / curve[3])) if curve[3] > 0.0 else float(limit)


@compiled
def from_rest(speed: float, excess: float, inertia: float, curve: FloatArray) -> tuple[float, float]:
    """Time [s] and distance [rad] between rest and `speed` [rad/s]."""
    exponent = 4.0 if curve[4] > 1.0 else 8.0
    duration, distance = 0.0, 0.0
    for i in range(_NODES.size):
        w = speed * _NODES[i] ** exponent
        weight = _WEIGHTS[i] * exponent * w / _NODES[i] / abs(acceleration(w, excess, inertia, curve))
        duration += weight
        distance += weight * w
    return duration, distance


@compiled
def speed_after(duration: float, guess: float, excess: float, inertia: float, curve: FloatArray) -> float:
    """The speed [rad/s] that lies `duration` [s] from rest."""
    speed = guess
    for _ in range(20):
        step = (from_rest(speed, excess, inertia, curve)[0] - duration) * abs(
            acceleration(speed, excess, inertia, curve)
        )
        speed = max(speed - step, 0.1 * speed)
        if abs(step) <= 4e-16 * speed:
            break
    return speed


@compiled
def slip_near_rest(
    speed: float, excess: float, period: float, inertia: float, curve: FloatArray
) -> tuple[float, float, float]:
    """Move below `speed_limit` for at most `period` [s]: speed after it, distance covered, time used.

    Ends early at rest (excess < 0) or at the limit (excess > 0).
    """
    duration, distance = from_rest(speed, excess, inertia, curve)
    if excess < 0.0:
        if duration <= period:
            return 0.0, distance, duration
        end = speed_after(duration - period, speed * (1.0 - period / duration), excess, inertia, curve)
        return end, distance - from_rest(end, excess, inertia, curve)[1], period
    limit = speed_limit(excess, curve)
    last, far = from_rest(limit, excess, inertia, curve)
    if last - duration <= period:
        return limit, far - distance, last - duration
    end = speed_after(duration + period, limit * (duration + period) / last, excess, inertia, curve)
    return end, from_rest(end, excess, inertia, curve)[1] - distance, period

r"""The closed loop, inclusion (8), as the modes of a Filippov system: kernels.

State (x1, x2, x3) as in `compensation`. Surfaces: h_0 = x2, where the compensated friction and the
observer's damping change direction, and h_1 = v = x2 + x3, where the true friction does. With hats for
what the controller believes, s2 and sv for the signs of x2 and v, and the curve of the direction
understood,

    x1' = v
    x2' = -(n1/J^) x1 - ((b^ + n2)/J^) x2 + L x3
    x3' = n1 (1/J^ - 1/J) x1 + ((b^ + n2)/J^ - (b + n2)/J) x2 - (b/J + L) x3 + (r F^(x2) - F(v))/J

where the last is v' - x2'. The coefficients are formed once (`loop_parameters`). The dry terms are
written k0 + k2 E + kv W, with E = exp(-(|x2|/v_s^)^beta^) and, in general, W =
exp(-(|v|/v_s)^beta). Where s2 = sv and both curves bend alike (v_s^ = v_s, beta^ = beta), W is the
difference exp(-(|v|/v_s)^beta) - E instead, formed by expm1: then x3 = 0 gives W = 0, and with r = 1 and
equal laws x3' is exactly zero. For beta = 1 and 2 the Taylor
series of a mode is a recurrence (`loop_series`, `bell_series`).

Sticking (v = 0) is linear: x1 stays, x3 = -x2, and x2 -> w = -n1 x1/(b^ + n2 + J^ L) at the rate (b^ +
n2)/J^ + L. The torque on the link, T = -n1 x1 - n2 x2 + r F^(x2), is monotone in x2 on each side of 0,
so the stick ends at a root of T = F_s(positive) or T = -F_s(negative), or at x2 = 0 where the model
changes direction, or never.
"""

from __future__ import annotations

from math import exp, expm1, inf, log1p
from typing import Final

import numpy as np

from compensation.loop_parameters import (
    A1,
    A2,
    A3,
    ALIKE,
    C1,
    C2,
    COULOMB,
    DAMP,
    FADING,
    GAIN,
    GOAL,
    HIGH,
    K0,
    K2,
    KV,
    LOW,
    RATE,
    SHAPE,
    SHAPE2,
    SHAPEV,
    SIGN2,
    SIGNV,
    STIFF,
    WIDTH,
    WIDTH2,
    WIDTHV,
    fading,
    fading_difference,
    slip_row,
)
from compensation.loop_series import series
from ident.simulation.compiled import compiled, passed
from ident.simulation.filippov_system import FilippovSystem, FloatArray, Signs, Surfaces

POSITION, ESTIMATE, ERROR = range(3)
REVERSAL: Final = 0  # surface x2 = 0
MOTION: Final = 1  # surface v = 0
REST_MARGIN: Final = 256 * 2.220446049250313e-16  # rounding of the torque balance
NEWTON_LIMIT: Final = 100


@compiled
def field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    """dx/dt (3,) in a slip mode."""
    k = parameters[slip_row(signs)]
    x1, x2, x3 = state[0], state[1], state[2]
    by_estimate = fading(k[SIGN2] * x2, k[WIDTH2], k[SHAPE2])
    by_velocity = fading(k[SIGNV] * (x2 + x3), k[WIDTHV], k[SHAPEV])
    e = exp(-by_estimate)
    if k[ALIKE] == 0.0:
        w = exp(-by_velocity)
    elif k[SHAPEV] == 1.0:
        w = fading_difference(e, by_velocity, -k[SIGNV] * x3 / k[WIDTHV])
    else:
        w = fading_difference(e, by_velocity, by_estimate - by_velocity)
    out[0] = x2 + x3
    out[1] = k[C1] * x1 + k[C2] * x2 + k[GAIN] * x3
    out[2] = k[A1] * x1 + k[A2] * x2 + k[A3] * x3 + k[K0] + k[K2] * e + k[KV] * w


@compiled
def _stick_torque(k: FloatArray, side: float, x1: float, x2: float) -> float:
    """T [N m] at rest, on the side of x2's sign."""
    faded = exp(-fading(side * x2, k[WIDTH], k[SHAPE]))
    torque: float = -k[STIFF] * x1 - k[DAMP] * x2 + side * (k[COULOMB] + k[FADING] * faded)
    return torque


@compiled
def slide(signs: Signs, state: FloatArray, parameters: FloatArray) -> tuple[float, int, int, int]:
    """How long the link sticks, and what ends it: (duration, surface, its new sign, contact)."""
    if signs[0] == 0:
        return (inf, 0, 0, 0) if signs[1] == 0 else (0.0, REVERSAL, 1, 1)
    side = float(signs[0])
    k = parameters[4 + (1 if side > 0 else 0)]
    x1, x2 = state[0], state[1]
    goal = k[GOAL] * x1
    crosses = side * goal < 0.0
    last = 0.0 if crosses else goal
    torque = _stick_torque(k, side, x1, last)
    margin = REST_MARGIN * (k[STIFF] * abs(x1) + k[DAMP] * abs(last) + k[COULOMB] + k[FADING])
    bound, way = 0.0, 0
    if goal < x2 and torque > k[HIGH] + margin:
        bound, way = k[HIGH], 1
    elif goal > x2 and torque < k[LOW] - margin:
        bound, way = k[LOW], -1
    if way != 0:
        there = _breakaway(k, side, x1, x2, last, bound)
        if there == x2:
            return 0.0, MOTION, way, 1  # the torque is beyond its bound already: no tangent departure
        return log1p((x2 - there) / (there - goal)) / k[RATE], MOTION, way, 2
    if crosses:
        return log1p(-x2 / goal) / k[RATE], REVERSAL, -signs[0], 1
    return inf, 0, 0, 0


@compiled
def _breakaway(k: FloatArray, side: float, x1: float, start: float, last: float, bound: float) -> float:
    """x2 between `start` and `last` where T reaches `bound`: bracketed Newton; T falls as x2 grows."""
    if (_stick_torque(k, side, x1, start) - bound) * (1.0 if last < start else -1.0) >= 0.0:
        return start
    inner, outer = start, last
    at = last
    for _ in range(NEWTON_LIMIT):
        faded = fading(side * at, k[WIDTH], k[SHAPE])
        excess = _stick_torque(k, side, x1, at) - bound
        if excess == 0.0:
            return at
        if (excess > 0.0) == (last < start):
            outer = at
        else:
            inner = at
        bend = faded if k[SHAPE] == 1.0 else (k[SHAPE] * faded)
        slope = -k[DAMP]
        if k[SHAPE] == 1.0:
            slope -= k[FADING] * exp(-faded) / k[WIDTH]
        elif at != 0.0:
            slope -= k[FADING] * exp(-faded) * bend / abs(at)
        after = at - excess / slope if slope < 0.0 else 0.5 * (inner + outer)
        if not min(inner, outer) < after < max(inner, outer):
            after = 0.5 * (inner + outer)
        if after == at or after in (inner, outer):
            return after
        at = after
    return at


@compiled
def slide_at(signs: Signs, state: FloatArray, parameters: FloatArray, time: float, out: FloatArray) -> None:
    """The sticking state `time` [s] after `state`; x2 is at its goal after an infinite time."""
    out[0] = state[0]
    if signs[0] == 0:
        out[1] = state[1]
    else:
        k = parameters[4 + (1 if signs[0] > 0 else 0)]
        out[1] = state[1] + (k[GOAL] * state[0] - state[1]) * -expm1(-k[RATE] * time)
    out[2] = -out[1]


SYSTEM: Final = FilippovSystem(
    field=passed(field), series=passed(series), slide=passed(slide), slide_at=passed(slide_at)
)
SURFACE_ROWS: Final = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0]])
SURFACE_PIVOTS: Final = np.array([1, 2])


@compiled
def surfaces() -> Surfaces:
    """x2 = 0 and v = x2 + x3 = 0; a state is put onto them by x2 and by x3."""
    return Surfaces(SURFACE_ROWS, SURFACE_PIVOTS)

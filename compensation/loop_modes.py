r"""The closed loop, inclusion (8), as the modes of a Filippov system: kernels.

State (x1, x2, x3) as in `compensation`. Surfaces: h_0 = x2, where the compensated friction and the
observer's damping change direction, and h_1 = v = x2 + x3, where the true friction does. With hats for
what the controller believes, s2 and sv for the signs of x2 and v, and the curve of the direction
understood,

    x1' = v
    x2' = -(n1/J^) x1 - ((b^ + n2)/J^) x2 + L x3
    x3' = n1 (1/J^ - 1/J) x1 + ((b^ + n2)/J^ - (b + n2)/J) x2 - (b/J + L) x3 + (r F^(x2) - F(v))/J

where the last is v' - x2'. The differences of coefficients are formed once, so that they are exactly
zero where the model is the robot. The dry terms are written k0 + k2 E + kv W, with E =
exp(-(|x2|/v_s^)^beta^) and, in general, W = exp(-(|v|/v_s)^beta). Where s2 = sv and both curves bend
alike (v_s^ = v_s, beta^ = beta), W is the difference exp(-(|v|/v_s)^beta) - E instead, formed by expm1:
then x3 = 0 gives W = 0, and with r = 1 and equal laws x3' is exactly zero. For beta = 1, E' = -(s2/v_s)
x2' E makes the Taylor series a recurrence (`numerics`: Knuth's rule for the exponential of a series);
so does W.

Sticking (v = 0) is linear: x1 stays, x3 = -x2, and x2 -> w = -n1 x1/(b^ + n2 + J^ L) at the rate (b^ +
n2)/J^ + L. The torque on the link, T = -n1 x1 - n2 x2 + r F^(x2), is monotone in x2 on each side of 0,
so the stick ends at a root of T = F_s(positive) or T = -F_s(negative), or at x2 = 0 where the model
changes direction, or never.
"""

from __future__ import annotations

from math import exp, expm1, inf, log1p
from typing import Final

import numpy as np

from ident.simulation.compiled import compiled, passed
from ident.simulation.filippov_system import FilippovSystem, FloatArray, Signs, Surfaces

# Rows 0..3 of the parameters: slip, by 2 (x2 > 0) + (v > 0). Rows 4, 5: stick, by (x2 > 0).
A1, A2, A3, K0, K2, KV, C1, C2, GAIN, SIGN2, SIGNV, WIDTH2, WIDTHV, SHAPE2, SHAPEV, ALIKE = range(16)
RATE, GOAL, STIFF, DAMP, COULOMB, FADING, WIDTH, SHAPE, HIGH, LOW = range(10)
ROWS: Final = 6
COLUMNS: Final = 16
POSITION, ESTIMATE, ERROR = range(3)
REVERSAL: Final = 0  # surface x2 = 0
MOTION: Final = 1  # surface v = 0
REST_MARGIN: Final = 256 * 2.220446049250313e-16  # rounding of the torque balance
NEWTON_LIMIT: Final = 100
UNSEEN: Final = 40.0  # exp(-40) is below rounding
SLOWEST: Final = 1e-12  # [1/s] stands for an observer without gain or damping, whose estimate never settles


@compiled
def _fading(speed: float, width: float, shape: float) -> float:
    """(s/v_s)^beta; for beta = 1 continued through 0 analytically, else evenly."""
    return speed / width if shape == 1.0 else (abs(speed) / width) ** shape


@compiled
def _difference(estimated: float, by_velocity: float, exponent: float) -> float:
    """exp(-by_velocity) - estimated, where estimated = exp(-by_velocity - exponent): 0 for exponent 0."""
    return estimated * expm1(exponent) if exponent <= 0.0 else -exp(-by_velocity) * expm1(-exponent)


@compiled
def field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    """dx/dt (3,) in a slip mode."""
    k = parameters[(2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)]
    x1, x2, x3 = state[0], state[1], state[2]
    by_estimate = _fading(k[SIGN2] * x2, k[WIDTH2], k[SHAPE2])
    by_velocity = _fading(k[SIGNV] * (x2 + x3), k[WIDTHV], k[SHAPEV])
    e = exp(-by_estimate)
    if k[ALIKE] == 0.0:
        w = exp(-by_velocity)
    elif k[SHAPEV] == 1.0:
        w = _difference(e, by_velocity, -k[SIGNV] * x3 / k[WIDTHV])
    else:
        w = _difference(e, by_velocity, by_estimate - by_velocity)
    out[0] = x2 + x3
    out[1] = k[C1] * x1 + k[C2] * x2 + k[GAIN] * x3
    out[2] = k[A1] * x1 + k[A2] * x2 + k[A3] * x3 + k[K0] + k[K2] * e + k[KV] * w


@compiled
def series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """Taylor coefficients of the state in a slip mode, all shapes 1, into rows 0..2 of `coefficients`.

    Returns for how long they hold: at many times v_s, E is lost in rounding, yet is back before v is small.
    """
    k = parameters[(2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)]
    a1, a2, a3, k0, k2, kv = k[A1], k[A2], k[A3], k[K0], k[K2], k[KV]
    c1, c2, gain = k[C1], k[C2], k[GAIN]
    alike = k[ALIKE] != 0.0
    p1, p2, p3 = coefficients[0], coefficients[1], coefficients[2]
    d2, d3, dv, e, w = work[0], work[1], work[2], work[3], work[4]
    p1[0], p2[0], p3[0] = state[0], state[1], state[2]
    rate2, ratev = -k[SIGN2] / k[WIDTH2], -k[SIGNV] / k[WIDTHV]
    e[0] = exp(-(k[SIGN2] * p2[0] / k[WIDTH2]))
    if alike:
        w[0] = _difference(e[0], k[SIGNV] * (p2[0] + p3[0]) / k[WIDTHV], -k[SIGNV] * p3[0] / k[WIDTHV])
    else:
        w[0] = exp(-(k[SIGNV] * (p2[0] + p3[0]) / k[WIDTHV]))
    for i in range(order):
        step = 1.0 / (i + 1)
        two = c1 * p1[i] + c2 * p2[i] + gain * p3[i]
        three = a1 * p1[i] + a2 * p2[i] + a3 * p3[i]
        if i == 0:
            three += k0
        three = three + k2 * e[i] + kv * w[i]
        d2[i], d3[i], dv[i] = two, three, two + three
        p1[i + 1] = (p2[i] + p3[i]) * step
        p2[i + 1] = two * step
        p3[i + 1] = three * step
        fade, slide = 0.0, 0.0
        for j in range(i + 1):
            fade += d2[j] * e[i - j]
            slide += dv[j] * w[i - j]
        if alike:
            for j in range(i + 1):
                slide += d3[j] * e[i - j]
        e[i + 1] = rate2 * fade * step
        w[i + 1] = ratev * slide * step
    reach = inf
    if -rate2 * p2[0] > order or -ratev * (p2[0] + p3[0]) > order:
        reach = _reach(coefficients, order, rate2, ratev)
    return reach


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


@compiled
def _stick_torque(k: FloatArray, side: float, x1: float, x2: float) -> float:
    """T [N m] at rest, on the side of x2's sign."""
    faded = exp(-_fading(side * x2, k[WIDTH], k[SHAPE]))
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
        faded = _fading(side * at, k[WIDTH], k[SHAPE])
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


@compiled
def mode_table(laws: FloatArray, inertia: FloatArray, gains: FloatArray, out: FloatArray) -> None:
    """The parameters (6, 16) of all modes.

    `laws` (4, 5): F_s, F_c, v_s, b, beta of the robot's positive and negative, the model's positive and
    negative direction. `inertia` (2,): robot, model. `gains` (4,): n1, n2, L, r.
    """
    j, j_model = inertia[0], inertia[1]
    n1, n2, observer, r = gains[0], gains[1], gains[2], gains[3]
    for forward2 in range(2):
        model = laws[2] if forward2 else laws[3]
        s2 = 1.0 if forward2 else -1.0
        damping = (model[3] + n2) / j_model
        for forward in range(2):
            true = laws[0] if forward else laws[1]
            sv = 1.0 if forward else -1.0
            k = out[2 * forward2 + forward]
            rise, rise_model = true[0] - true[1], model[0] - model[1]
            alike = forward == forward2 and true[2] == model[2] and true[4] == model[4]
            k[A1] = n1 / j_model - n1 / j
            k[A2] = damping - (true[3] + n2) / j
            k[A3] = -(true[3] / j + observer)
            k[K0] = (s2 * r * model[1] - sv * true[1]) / j
            k[K2] = s2 * (r * rise_model - rise) / j if alike else s2 * r * rise_model / j
            k[KV] = -sv * rise / j
            k[C1] = -n1 / j_model
            k[C2] = -damping
            k[GAIN] = observer
            k[SIGN2], k[SIGNV] = s2, sv
            k[WIDTH2], k[WIDTHV] = model[2], true[2]
            k[SHAPE2], k[SHAPEV] = model[4], true[4]
            k[ALIKE] = 1.0 if alike else 0.0
        k = out[4 + forward2]
        k[RATE] = max(damping + observer, SLOWEST)
        k[GOAL] = -n1 / j_model / k[RATE]
        k[STIFF], k[DAMP] = n1, n2
        k[COULOMB], k[FADING] = r * model[1], r * rise_model
        k[WIDTH], k[SHAPE] = model[2], model[4]
        k[HIGH], k[LOW] = laws[0, 0], -laws[1, 0]

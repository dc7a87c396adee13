"""The first zero of a polynomial on (0, 1], to rounding: where a step leaves its mode.

A step of an integrator is a polynomial p(theta), theta in [0, 1], and so is every switching function
along it. Most steps meet no surface, which one sum of absolute values proves, or the same sum beside a
parabola. Otherwise the interval is cut until a part either holds no zero, by that bound, or is
monotone, by the same bound on the derivative; a safeguarded Newton iteration then ends at rounding. No
zero is passed over, a double zero (a graze) included.
"""

from __future__ import annotations

from math import inf

from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray

SHORTEST = 1e-14  # part of a step below which a double zero counts as one
ROUNDING = 1e-10  # of the first coefficient that counts, against the sum of the others
NEWTON_LIMIT = 60
SETTLED = 4.5e-16  # relative change within which Newton steps only follow rounding
MOST_CRAWLS = 32  # of the shortest parts: a polynomial that vanishes identically has no first zero


@compiled
def first_crossing(polynomial: FloatArray, degree: int, sign: int, contact: int, work: FloatArray) -> float:
    """Smallest theta in (0, 1] where sign * polynomial falls to zero, inf where it does not.

    `polynomial` (>= degree + 1,) ascending, its first `contact` coefficients zero; `work` is as long.
    """
    last = degree - contact
    rest = 0.0
    for k in range(1, last + 1):
        rest += abs(polynomial[k + contact])
    lead = sign * polynomial[contact]
    if lead > rest:
        return inf
    if last >= 2 and _parabola_is_clear(lead, sign, polynomial[contact:], rest):
        return inf
    for k in range(last + 1):
        work[k] = sign * polynomial[k + contact]
    if lead <= 0.0:
        if contact == 0 or -lead > ROUNDING * rest:
            return 0.0
        work[0] = 0.0  # on which side the state leaves was decided before
    return _isolate(work, last)


@compiled
def _parabola_is_clear(lead: float, sign: int, q: FloatArray, rest: float) -> bool:
    """Whether the first three terms stay above what the others can take away, on all of [0, 1]."""
    slope, bend = sign * q[1], sign * q[2]
    least = min(lead, lead + slope + bend)
    if slope < 0.0 and 0.0 < -slope < 2.0 * bend:
        least = lead - 0.25 * slope * slope / bend
    return bool(least > (1.0 + ROUNDING) * (rest - abs(slope) - abs(bend)) + ROUNDING * rest)


@compiled
def _isolate(q: FloatArray, degree: int) -> float:
    """First zero of q, which is >= 0 at 0, on (0, 1]; q is overwritten."""
    start = 0.0
    width = 1.0
    crawled = 0
    while crawled < MOST_CRAWLS:
        rest = 0.0
        slope_rest = 0.0
        power = 1.0
        for k in range(1, degree + 1):
            if k > 1:
                slope_rest += k * abs(q[k]) * power
            power = power * width
            rest += abs(q[k]) * power
        clear = q[0] > rest
        if not clear and degree >= 1 and abs(q[1]) > slope_rest:
            if q[1] < 0.0 and _value(q, degree, width) <= 0.0:
                return start + _root(q, degree, width)
            clear = True
        if not clear and width <= SHORTEST:
            if _value(q, degree, width) < 0.0:
                return start + width
            clear = True
            crawled += 1
        if clear:
            start += width
            if start >= 1.0:
                return inf
            _shift(q, degree, width)
            width = 1.0 - start
        else:
            width *= 0.5
    return inf if _value(q, degree, 1.0 - start) >= 0.0 else start


@compiled
def _value(q: FloatArray, degree: int, at: float) -> float:
    value: float = q[degree]
    for k in range(degree - 1, -1, -1):
        value = value * at + q[k]
    return value


@compiled
def _root(q: FloatArray, degree: int, width: float) -> float:
    """Zero of q, falling on [0, width] from q(0) >= 0 to q(width) <= 0."""
    low, high = 0.0, width
    at: float = min(max(-q[0] / q[1], low), high)
    for _ in range(NEWTON_LIMIT):
        value = q[degree]
        slope = 0.0
        for k in range(degree - 1, -1, -1):
            slope = slope * at + value
            value = value * at + q[k]
        if value > 0.0:
            low = at
        elif value < 0.0:
            high = at
        else:
            return at
        after = at - value / slope if slope < 0.0 else 0.5 * (low + high)
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - at) <= SETTLED * at:
            return after
        at = after
    return at


@compiled
def _shift(q: FloatArray, degree: int, by: float) -> None:
    """q(x) becomes q(x + by): repeated synthetic division."""
    for i in range(degree):
        value = q[degree]
        for k in range(degree - 1, i - 1, -1):
            value = q[k] + by * value
            q[k] = value

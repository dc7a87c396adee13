r"""Which velocity estimates can a resting link hold? The roots behind the equilibrium sets, eqs (9)-(10).

While the link rests (v = 0) and the observer has settled on an estimate of size s = |x2| > 0, the controller
applies a torque of size a s + r g^(s): g^ is the compensator's friction magnitude in that direction, and
a = b^ + L J^ is what the observer's own equation leaves of the PD law. The link stays at rest as long as the
robot's static friction F_s of that direction holds that torque, that is where the excess

    h(s) = a s + r g^(s) - F_s,    g^(s) = F_c^ + dF^ exp(-(s / v_s^)^beta),

is not positive. This file finds all s > 0 with h(s) <= 0, as intervals.

Written with h(0+) = r F_s^ - F_s, h(s) = a s + h(0+) + r dF^ expm1(-(s / v_s^)^beta): near the critical gain
the set shrinks to 0, and this form loses nothing there.

* beta = 1: h is convex; with c = F_s - r F_c^ its roots are s = c/a + v_s W(-K e^{-c/(a v_s)}), K = r dF^/(a
  v_s), the principal branch of Lambert's W for the outer edge, branch -1 for the inner. The argument under-
  and overflows long before the roots do, so W is taken in logarithmic form.
* beta < 1: h is convex too, infinitely steep at 0: at most two roots, apart by its only minimum.
* beta > 1: g^ bends at s_i = v_s ((beta - 1)/beta)^(1/beta), so h' falls until s_i and rises after: at most
  two stationary points, one on each side of s_i, and at most three roots between and around them.

Between its stationary points h is monotone: one bracketed search in each piece misses nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from scipy.optimize import brentq

Interval = tuple[float, float]  # ends of a range of s [rad/s]; the upper may be infinite
_FAR = 1e60  # s/v_s beyond which everything has faded, for any shape; keeps the power finite


@dataclass(frozen=True)
class TorqueBalance:
    """h(s) of one direction: compensator and observer against the robot's static friction."""

    slope: float  # a = b^ + L J^ [N m s/rad], >= 0
    onset: float  # h(0+) = r F_s^ - F_s [N m]
    fading: float  # r dF^ [N m], >= 0
    stribeck_velocity: float  # v_s^ [rad/s]
    stribeck_shape: float  # beta^ [-]

    def excess(self, speed: float) -> float:
        """h(s) [N m] at s > 0 [rad/s]: the applied torque beyond the robot's static friction."""
        ratio = min(speed / self.stribeck_velocity, _FAR)
        faded = math.expm1(-(ratio**self.stribeck_shape))
        return self.slope * speed + (self.onset + self.fading * faded)

    @property
    def far_margin(self) -> float:
        """c = F_s - r F_c^ [N m]: static friction that the fully faded compensation leaves."""
        return self.fading - self.onset

    def resting(self) -> tuple[Interval, ...]:
        """All ranges of s > 0 with h(s) <= 0, rising; a range that begins at 0 touches the origin."""
        if self.slope == 0.0:
            return self._resting_without_slope()
        if self.far_margin <= 0.0:  # h(s) > a s: the compensation alone moves the link
            return ()
        crossings = [0.0, *self._roots()]
        ranges = []
        for low, high in pairwise(crossings):
            if high > low and self.excess(0.5 * (low + high)) < 0.0:
                ranges.append((low, high))
        return tuple(ranges)

    def _resting_without_slope(self) -> tuple[Interval, ...]:
        """No observer gain and no damping: h only falls, and where it ends below 0 the set has no end."""
        if self.far_margin <= 0.0:
            return ()
        if self.onset <= 0.0:
            return ((0.0, math.inf),)
        faded = math.log(self.fading / self.far_margin)
        return ((self.stribeck_velocity * faded ** (1.0 / self.stribeck_shape), math.inf),)

    def _roots(self) -> list[float]:
        """Positive roots of h in rising order, for a > 0 and c > 0; the last lies at or below c/a."""
        end = self.far_margin / self.slope
        if self.fading == 0.0:
            return [end]
        if self.stribeck_shape == 1.0:
            return self._roots_by_lambert(end)
        pieces = [0.0, *(s for s in self._stationary_speeds() if s < end), end]
        found = [self._root_between(low, high) for low, high in pairwise(pieces)]
        roots = [root for root in found if root is not None]
        if self.excess(end) <= 0.0 and (not roots or roots[-1] < end):  # all fading is below rounding at c/a
            roots.append(end)
        return roots

    def _roots_by_lambert(self, end: float) -> list[float]:
        """The closed form for beta = 1, each root refined on h itself."""
        steepness = self.fading / (self.slope * self.stribeck_velocity)  # K
        exponent = end / self.stribeck_velocity - math.log(steepness)
        if exponent < 1.0:  # the minimum of h is positive
            return []
        outer, inner = (end - self.stribeck_velocity * w for w in minus_lambert(exponent))
        if self.onset < 0.0:
            candidates = [outer]
        elif steepness <= 1.0:  # h rises from 0 on
            candidates = []
        else:
            candidates = [inner, outer] if self.onset > 0.0 else [outer]  # at h(0+) = 0 the inner root is 0
        return [self._refined(root) for root in candidates if root > 0.0]

    def _refined(self, root: float) -> float:
        """Two Newton steps, each kept only if it lowers |h|."""
        for _ in range(2):
            value = self.excess(root)
            fading = self.fading * math.exp(-root / self.stribeck_velocity)
            gradient = self.slope - fading / self.stribeck_velocity
            if value == 0.0 or gradient == 0.0:
                break
            better = root - value / gradient
            if not better > 0.0 or abs(self.excess(better)) >= abs(value):
                break
            root = better
        return root

    def _root_between(self, low: float, high: float) -> float | None:
        """The root of h in a piece where h is monotone, or None."""
        at_low = self.excess(low) if low > 0.0 else self.onset
        at_high = self.excess(high)
        if at_high == 0.0:
            return high
        if at_low * at_high >= 0.0:  # a piece that begins in a root holds no other
            return None
        return _bracketed(self.excess, low, high)

    def _stationary_speeds(self) -> list[float]:
        """The speeds where h' = 0, rising, for beta != 1.

        With p = ln y, y = (s/v_s)^beta: h' = 0 is ln(r dF beta/(a v_s)) + p (beta - 1)/beta - e^p = 0.
        """
        beta = self.stribeck_shape
        bend = (beta - 1.0) / beta
        level = math.log(self.fading * beta / (self.slope * self.stribeck_velocity))

        def steepness(p: float) -> float:
            return level + bend * p - math.exp(p)

        far = 1.0 + math.log(2.0 + 2.0 * max(level, 0.0))  # beyond every root
        if beta < 1.0:
            near = min(level / -bend, 0.0) - 1.0 + 1.0 / bend
            roots = [_bracketed(steepness, near, far)]
        else:
            inflection = math.log(bend)
            if steepness(inflection) <= 0.0:
                return []
            near = min(-level / bend, inflection) - 1.0
            roots = [_bracketed(steepness, near, inflection), _bracketed(steepness, inflection, far)]
        return [self.stribeck_velocity * math.exp(p / beta) for p in roots]


def minus_lambert(exponent: float) -> tuple[float, float]:
    """-W_0(-e^-u) and -W_-1(-e^-u), u = `exponent` >= 1: the w <= 1 and w >= 1 with w - ln w = u.

    With w = e^-t the equation is t + e^-t = u: t >= 0 is the principal branch, t <= 0 branch -1. The left
    side is convex, so Newton's method from outside converges from one side, and no exponent is too large.
    """
    if exponent <= 1.0:
        return 1.0, 1.0
    logarithm = -math.log(exponent + 2.0 * math.sqrt(exponent))  # -t is below ln(u + 2 sqrt(u))
    return math.exp(-_newton_from_outside(exponent, exponent)), math.exp(
        -_newton_from_outside(logarithm, exponent)
    )


def _newton_from_outside(t: float, exponent: float) -> float:
    for _ in range(100):
        fading = math.exp(-t)
        if fading == 1.0:
            break
        step = (t + fading - exponent) / (1.0 - fading)
        t -= step
        if abs(step) <= 4e-16 * (1.0 + abs(t)):
            break
    return t


def _bracketed(function: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(function, low, high, xtol=1e-300, rtol=1e-15, maxiter=5000))

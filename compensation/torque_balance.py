r"""Which velocity estimates can a resting link hold? The roots behind the equilibrium sets, eqs (9)-(10).

While the link rests (v = 0) and the observer has settled on an estimate of size s = |x2| > 0, the controller
applies a torque of size a s + r g^(s): g^ is the compensator's friction magnitude in that direction, and
a = b^ + L J^ is what the observer's own equation leaves of the PD law. The link stays at rest as long as the
robot's static friction F_s of that direction holds that torque, that is where the excess

    h(s) = a s + r g^(s) - F_s,    g^(s) = F_c^ + dF^ exp(-(s / v_s^)^beta),

is not positive. This file finds all s > 0 with h(s) <= 0, as intervals.

Written with h(0+) = r F_s^ - F_s, h(s) = a s + h(0+) + r dF^ expm1(-(s / v_s^)^beta): near the critical gain
the set shrinks to 0, and this form loses nothing there.

* beta = 1: h is convex, its roots are closed form (`lambert_roots`).
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

from compensation.lambert_roots import lambert_roots
from ident.model.friction import ModelError
from ident.model.numbers import is_number_or_inf, shown

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
        if not (is_number_or_inf(speed) and speed >= 0.0):
            raise ModelError(f"speed is {shown(speed)}: s >= 0 [rad/s] (eqs 9-10)")
        return self._excess(speed)

    def _excess(self, speed: float) -> float:
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
            if high > low and self._excess(0.5 * (low + high)) < 0.0:
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
        if self._excess(end) <= 0.0 and (not roots or roots[-1] < end):  # all fading is below rounding at c/a
            roots.append(end)
        return roots

    def _roots_by_lambert(self, end: float) -> list[float]:
        """The closed form for beta = 1, each root refined on h itself."""
        inner, outer = lambert_roots(self.slope, self.onset, self.fading, self.stribeck_velocity, end)
        return [root for root in (inner, outer) if root > 0.0]

    def _root_between(self, low: float, high: float) -> float | None:
        """The root of h in a piece where h is monotone, or None."""
        at_low = self._excess(low) if low > 0.0 else self.onset
        at_high = self._excess(high)
        if at_high == 0.0:
            return high
        if at_low * at_high >= 0.0:  # a piece that begins in a root holds no other
            return None
        return _bracketed(self._excess, low, high)

    def _stationary_speeds(self) -> list[float]:
        """The speeds where h' = 0, rising, for beta != 1.

        With p = ln y, y = (s/v_s)^beta: h' = 0 is ln(r dF beta/(a v_s)) + p (beta - 1)/beta - e^p = 0.
        """
        beta = self.stribeck_shape
        bend = (beta - 1.0) / beta
        level = math.log(self.fading) + math.log(beta / (self.slope * self.stribeck_velocity))

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


def _bracketed(function: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(function, low, high, xtol=1e-300, rtol=1e-15, maxiter=5000))

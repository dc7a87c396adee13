"""Limit cycles of a family of return maps as the solutions of an equation: P_p^k(z) - z = 0.

Its derivative by z is that of the map, less 1; by the parameter p it is a difference quotient, taken on
the side on which the map is smooth: within a difference of a graze the map jumps. Cycles meet their
*stability* events where a multiplier leaves the unit circle: through 1 at folds and branch points, which
the continuation knows by itself; through -1, and as a pair, here. Of a map that is half a turn followed
by a change of sign, a multiplier -1 breaks the symmetry; of a whole turn, it doubles the period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from compensation.orbits.periodic_orbits import ReturnMap, slope_of
from compensation.orbits.solution_curve import Lost
from ident.simulation.filippov_system import FloatArray

DIFFERENCE: Final = 1e-9  # of the parameter, relative
SCARCE: Final = 0.1  # of the parameter's range: a parameter below it is as good as 0
JUMPED: Final = 10.0  # ratio of the two one-sided differences
ROUNDING: Final = 1e-14
SAME: Final = 2e-5  # of its extent: so near points of a cycle are one
JOINED: Final = "joins a cycle of fewer returns"
MET_EQUILIBRIUM: Final = "meets the equilibrium"


@dataclass(frozen=True)
class CycleEquation:
    """Cycles of `returns` returns of the map that `family` gives for a parameter."""

    family: Callable[[float], ReturnMap]
    returns: int
    sequence: Callable[[FloatArray, float], str]  # the modes that a cycle goes through
    span: tuple[float, float]  # of the parameter, >= 0 [its unit]
    vanished: float  # [unit of x1] extent below which a cycle has become a point

    def residual(self, x: FloatArray, p: float) -> FloatArray | Lost:
        """P^k(x) - x, (d,)."""
        slack = ROUNDING * self.span[1]
        if not self.span[0] - slack <= p <= self.span[1] + slack:
            return Lost("the parameter is out of its range")
        done = self.family(p).follow(x, self.returns)
        return done.points[-1] - x if done.end_reason == "section reached" else Lost(done.end_reason)

    def jacobian(self, x: FloatArray, p: float) -> FloatArray | Lost:
        """Derivative (d, d + 1) of the residual."""
        slope = slope_of(self.family(p), x, self.returns)
        here = self.residual(x, p)
        if isinstance(here, Lost):
            return here
        if slope is None:
            return Lost("the return map has no derivative")
        return np.column_stack([slope - np.eye(x.size), self._by_parameter(x, p, here)])

    def _by_parameter(self, x: FloatArray, p: float, here: FloatArray) -> FloatArray:
        step = DIFFERENCE * max(abs(p), SCARCE * (self.span[1] - self.span[0]))
        quotients = []
        for at in (p + step, p - step):
            there = self.residual(x, at)
            if not isinstance(there, Lost):
                quotients.append((there - here) / (at - p))
        if not quotients:
            return np.zeros(x.size)
        quotients.sort(key=lambda quotient: float(np.max(np.abs(quotient))))
        small, large = (float(np.max(np.abs(quotient))) for quotient in (quotients[0], quotients[-1]))
        if large > JUMPED * small:
            return quotients[0]
        mean: FloatArray = 0.5 * (quotients[0] + quotients[-1])
        return mean

    def label(self, x: FloatArray, p: float) -> str:
        """The sequence of modes."""
        return self.sequence(x, p)

    def watch(self, x: FloatArray, p: float, jacobian: FloatArray) -> dict[str, float]:
        """det(M + 1), and det(M) - 1 where there are two multipliers; M is the derivative of the map."""
        slope = jacobian[:, :-1] + np.eye(x.size)
        breaks = self.family(p).symmetric and self.returns % 2 == 1
        name = "symmetry breaking" if breaks else "period doubling"
        watched = {name: float(np.linalg.det(slope + np.eye(x.size)))}
        if x.size == 2 and np.linalg.eigvals(slope)[0].imag != 0.0:
            watched["torus"] = float(np.linalg.det(slope)) - 1.0
        return watched

    def size(self, x: FloatArray, p: float) -> float:
        """Extent of the cycle in x1."""
        done = self.family(p).follow(x, self.returns)
        if not done.lows.size:
            return 0.0
        if self.family(p).symmetric and self.returns % 2 == 1:
            return float(max(np.max(np.abs(done.lows)), np.max(np.abs(done.highs))))
        return float(np.max(done.highs) - np.min(done.lows))

    def companions(self, x: FloatArray, p: float) -> FloatArray:
        """Durations (k,) of the returns [s]: where the map jumps, they do."""
        return self.family(p).follow(x, self.returns).durations

    def ending(self, x: FloatArray, p: float) -> str | None:
        """A cycle that has shrunk to a point ends its branch, and one that takes its returns twice over."""
        size = self.size(x, p)
        if size < self.vanished:
            return MET_EQUILIBRIUM
        points = self.family(p).follow(x, self.returns).points
        for fewer in range(1, self.returns):
            whole = self.returns % fewer == 0 and points.shape[0] == self.returns
            if whole and float(np.max(np.abs(points[fewer - 1] - x))) < SAME * size:
                return JOINED
        return None

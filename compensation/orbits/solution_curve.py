r"""A curve of solutions of F(x, p) = 0, F: R^n x R -> R^n, seen from one of its points.

Where the n x (n + 1) Jacobian [F_x F_p] has full rank the solutions form a curve, even where F_x is
singular and p turns back. Its direction is the *tangent* t, the null vector of the Jacobian; it is kept
pointing ahead by t . t_before > 0. A prediction u + h t is brought back to the curve by Newton's method
on

    F(u') = 0,    t . (u' - u) = h,

which is regular at folds too (Keller 1977; Allgower and Georg 1990, chapter 2). All of it is done in
scaled coordinates u = (x / s_x, p / s_p), so that one length serves quantities of any unit.

F may end somewhere: a problem then answers `Lost`, with the reason. F may jump: Newton's method tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from ident.simulation.filippov_system import FloatArray

NEWTON_STEPS: Final = 12
CONVERGED: Final = 1e-10  # last Newton step, relative to the solution
ROUGH: Final = 1e-7  # the same where rounding in F keeps it from shrinking
FARTHEST: Final = 4.0  # steps within which a neighbouring solution is looked for


@dataclass(frozen=True)
class Lost:
    """F has no value here."""

    why: str


class Problem(Protocol):
    """A family of equations F(x, p) = 0 and what else is to be known of its solutions."""

    def residual(self, x: FloatArray, p: float) -> FloatArray | Lost:
        """F (n,) at x (n,)."""

    def jacobian(self, x: FloatArray, p: float) -> FloatArray | Lost:
        """[F_x F_p], (n, n + 1)."""

    def label(self, x: FloatArray, p: float) -> str:
        """What kind of solution this is; a change along the curve is an event."""

    def watch(self, x: FloatArray, p: float, jacobian: FloatArray) -> dict[str, float]:
        """Functions of a solution whose changes of sign are events, by the event's name."""

    def size(self, x: FloatArray, p: float) -> float:
        """What a change of x is compared with [unit of x]; inf where it does not matter."""

    def companions(self, x: FloatArray, p: float) -> FloatArray:
        """Positive quantities (m,) that are continuous along a curve: their jump betrays another one."""

    def ending(self, x: FloatArray, p: float) -> str | None:
        """Why the curve ends at this solution, None where it does not."""


@dataclass(frozen=True)
class CurvePoint:
    """A solution, and where the curve goes from there."""

    x: FloatArray  # (n,) [units of the problem]
    p: float  # [unit of the problem]
    label: str
    tangent: FloatArray  # (n + 1,) of length 1 [scaled]
    signs: dict[str, float]  # watched functions [units of their own]
    companions: FloatArray  # (m,) [units of the problem]
    rank: float  # [scaled] least singular value of the Jacobian: 0 where another curve crosses


@dataclass(frozen=True)
class Scaled:
    """A problem in coordinates u = (x / s_x, p / s_p)."""

    problem: Problem
    scale: FloatArray  # (n + 1,) [units of the problem]

    def join(self, x: FloatArray, p: float) -> FloatArray:
        """u (n + 1,) of a solution."""
        return np.append(x, p) / self.scale

    def split(self, u: FloatArray) -> tuple[FloatArray, float]:
        """x (n,) and p."""
        y = u * self.scale
        return y[:-1], float(y[-1])

    def residual(self, u: FloatArray) -> FloatArray | Lost:
        """F (n,), scaled as x."""
        value = self.problem.residual(*self.split(u))
        return value if isinstance(value, Lost) else value / self.scale[:-1]

    def jacobian(self, u: FloatArray) -> FloatArray | Lost:
        """Its derivative (n, n + 1)."""
        slope = self.problem.jacobian(*self.split(u))
        if isinstance(slope, Lost):
            return slope
        scaled: FloatArray = slope * self.scale / self.scale[:-1, None]
        return scaled

    def point(self, u: FloatArray, ahead: FloatArray) -> CurvePoint | Lost:
        """What there is to know of a solution; its tangent points the way of `ahead` (n + 1,)."""
        slope = self.jacobian(u)
        if isinstance(slope, Lost):
            return slope
        tangent = tangent_of(slope, ahead)
        x, p = self.split(u)
        signs = {
            "fold": float(np.linalg.det(slope[:, :-1])),  # tangent[-1] but for the sign it is given
            "branch point": float(np.linalg.det(np.vstack([slope, tangent]))),
            **self.problem.watch(x, p, slope / self.scale * self.scale[:-1, None]),
        }
        return CurvePoint(
            x=x,
            p=p,
            label=self.problem.label(x, p),
            tangent=tangent,
            signs=signs,
            companions=self.problem.companions(x, p),
            rank=float(np.linalg.svd(slope, compute_uv=False)[-1]),
        )


def tangent_of(jacobian: FloatArray, ahead: FloatArray) -> FloatArray:
    """Null vector (n + 1,) of a Jacobian (n, n + 1), of length 1, pointing the way of `ahead`."""
    null: FloatArray = np.linalg.svd(jacobian)[2][-1]
    return null if float(null @ ahead) >= 0.0 else -null


def correct(
    scaled: Scaled, base: FloatArray, along: FloatArray, length: float, *, room: float = FARTHEST
) -> FloatArray | Lost:
    """The solution u with along . (u - base) = length, from the prediction base + length along.

    A solution further away than `room` times the length is another one.
    """
    u = base + length * along
    before = np.inf
    farthest = room * abs(length) if length != 0.0 else room
    for _ in range(NEWTON_STEPS):
        value, slope = scaled.residual(u), scaled.jacobian(u)
        if isinstance(value, Lost):
            return value
        if isinstance(slope, Lost):
            return slope
        try:
            step = np.linalg.solve(np.vstack([slope, along]), -np.append(value, along @ (u - base) - length))
        except np.linalg.LinAlgError:
            return Lost("the corrector met a singular point")
        u = u + step
        if not float(np.max(np.abs(u - base))) <= farthest:
            return Lost("the corrector ran away")
        size = max(float(np.max(np.abs(u[:-1]))), 1e-3 * abs(length))
        moved = float(np.max(np.abs(step[:-1])))
        if moved <= CONVERGED * size or (moved <= ROUGH * size and moved >= 0.5 * before):
            return u
        before = moved
    return Lost(f"the corrector did not converge in {NEWTON_STEPS} steps")

r"""Inverse-dynamics least squares: J, b, F_c and the offset from any motion under known torque.

    u = J a + b v + F_c sign(v) + c         one law for both directions with an offset c, or
    u = J a + b+ v+ + F_c+ [v > 0] - b- v- - F_c- [v < 0]     a law for each without,

is linear in what is sought. Ordinary least squares over the band in which the motion carries the torque is
used, not the weighting that the residuals' own spectrum would suggest: that is more efficient where the law
is exact, and on real friction, whose reversals are no jumps, it puts its weight on the reversals and loses
the rest. The price is an error that must be taken from the residuals as they are
(`ident.excitation.robust_errors`).

A rotary link that does not hang in its centre adds g_1 sin q + g_2 cos q. The Stribeck effect is not sought
here: a link passes its range in a moment at each reversal, which the band does not resolve
(`ident.excitation.output_error`).

Source: Gautier, IEEE ICRA (1997) 284; Janot, Vandanjon, Gautier, IEEE Trans. Control Systems Technology 22
(2014) 132, for the instruments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.excitation.filtering import Equation, Motion
from ident.excitation.robust_errors import cosines, long_run_covariance

Law = Literal["one", "each"]
NAMES: Final[dict[Law, tuple[str, ...]]] = {
    "one": ("inertia", "viscous_damping", "coulomb_torque", "torque_offset"),
    "each": (
        "inertia",
        "positive_viscous_damping",
        "negative_viscous_damping",
        "positive_coulomb_torque",
        "negative_coulomb_torque",
    ),
}
GRAVITY: Final = ("gravity_sine", "gravity_cosine")
SINGULAR: Final = 1e8  # condition number of the normalised moments


@dataclass(frozen=True)
class FrictionTerms:
    """Which terms stand beside the inertia."""

    law: Law
    gravity: bool = False  # a torque that goes like sin q and cos q

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters, the inertia first."""
        return NAMES[self.law] + (GRAVITY if self.gravity else ())

    def of(self, motion: Motion) -> list[FloatArray]:
        """What multiplies each parameter but the inertia, each (n,)."""
        direction = motion.direction
        if self.law == "one":
            terms = [motion.rate, direction, np.ones_like(direction)]
        else:
            terms = [
                term * way for term in (motion.rate, direction) for way in (direction > 0, direction < 0)
            ]
        return [*terms, np.sin(motion.position), np.cos(motion.position)] if self.gravity else terms


@dataclass(frozen=True)
class System:
    """The linear equations of all spans: torque (m,) = columns (m, p) @ parameters (p,)."""

    names: tuple[str, ...]
    columns: FloatArray  # (m, p) [N m over the parameter]
    torque: FloatArray  # (m,) [N m]
    span: NDArray[np.intp]  # (m,) number of the span

    def rows(self, chosen: NDArray[np.bool_]) -> System:
        """The equations at some instants only."""
        return System(self.names, self.columns[chosen], self.torque[chosen], self.span[chosen])


@dataclass(frozen=True)
class LinearFit:
    """Least squares of a `System`."""

    names: tuple[str, ...]
    values: FloatArray  # (p,) [SI]
    covariance: FloatArray  # (p, p) [SI], robust
    dof: int  # of Student's t for value over error
    residual: FloatArray  # (m,) [N m]
    relative_error: float  # [-] norm of the residual over that of the torque

    def value(self, name: str) -> float:
        """A parameter."""
        return float(self.values[self.names.index(name)])

    def stderr(self, name: str) -> float:
        """Its robust standard error."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))


def system(equations: Sequence[Equation], terms: FrictionTerms) -> System:
    """Every span's equation with the given friction."""
    blocks = [
        np.column_stack([one.acceleration, *map(one.filtered, terms.of(one.motion))]) for one in equations
    ]
    return System(
        terms.names,
        np.concatenate(blocks),
        np.concatenate([one.torque for one in equations]),
        np.repeat(np.arange(len(equations)), [one.kept.size for one in equations]),
    )


def least_squares(problem: System, *, instruments: FloatArray | None = None) -> LinearFit | None:
    """Ordinary least squares, or with instruments (m, p) in place of the columns; None where singular.

    The scores of the instruments are made zero by the estimate, so that its error follows from them.
    """
    used = problem.columns if instruments is None else instruments
    scale = np.linalg.norm(problem.columns, axis=0)
    if problem.torque.size < 3 * scale.size or np.any(scale == 0):
        return None
    size = np.linalg.norm(used, axis=0)
    if np.any(size == 0):
        return None
    moment = (used / size).T @ (problem.columns / scale)
    if not np.linalg.cond(moment) < SINGULAR:
        return None
    inverse = np.linalg.inv(moment)
    values = inverse @ ((used / size).T @ problem.torque) / scale
    residual = problem.torque - problem.columns @ values
    spread = long_run_covariance((used / size) * residual[:, None])
    covariance = inverse @ spread @ inverse.T / np.outer(scale, scale)
    n = residual.size
    return LinearFit(
        problem.names,
        np.asarray(values),
        covariance * n / (n - scale.size),
        cosines(n),
        residual,
        float(np.linalg.norm(residual) / np.linalg.norm(problem.torque)),
    )

r"""Whether noise in the loop bends least squares: the reference as an instrument.

In a closed loop the position's noise and every disturbance come back through the torque, so that the columns
and the residual know of each other and least squares is biased however long the log. The reference knows of
neither: its acceleration, speed and direction, filtered alike, are instruments. Both estimates agree within
the error of their difference unless something is bent. Which of the two is then nearer to the truth is not
said: instruments know nothing of noise, but a law that is not exact bends them further than least squares.

Source: Janot, Vandanjon, Gautier, IEEE Trans. Control Systems Technology 22 (2014) 132; the comparison is
Hausman's, Econometrica 46 (1978) 1251.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.excitation.direction import direction_of_motion, position_step
from ident.excitation.filtering import (
    Equation,
    Motion,
    Timing,
    difference,
    low_pass,
    second_difference,
    sharp_cutoff,
)
from ident.excitation.inverse_dynamics import FrictionTerms, LinearFit, System, least_squares
from ident.excitation.robust_errors import long_run_covariance

FOLLOWED: Final = 0.9  # correlation of the reference's columns with the motion's
BENT: Final = 4.0  # standard errors of the difference


@dataclass(frozen=True)
class Comparison:
    """The fit by instruments, and how far least squares lies from it, in errors of the difference (p,)."""

    fit: LinearFit
    distance: FloatArray  # (p,) in standard errors [-]

    @property
    def bent(self) -> bool:
        """Whether the two disagree."""
        return bool(np.max(np.abs(self.distance)) > BENT)


def compare_instruments(
    equations: Sequence[Equation], problem: System, plain: LinearFit, terms: FrictionTerms, *, timing: Timing
) -> Comparison | None:
    """Least squares against instruments from the reference; None without a reference that is followed."""
    blocks = [_instruments(one, terms, timing=timing) for one in equations]
    known = [block for block in blocks if block is not None]
    if len(known) < len(blocks):
        return None
    columns = np.concatenate(known)
    alike = np.sum(columns * problem.columns, axis=0)
    alike = alike / (np.linalg.norm(columns, axis=0) * np.linalg.norm(problem.columns, axis=0) + 1e-300)
    if not np.all(alike > FOLLOWED):
        return None
    fit = least_squares(problem, instruments=columns)
    if fit is None:
        return None
    apart = _influence(columns, problem.columns, fit.residual)
    apart = apart - _influence(problem.columns, problem.columns, plain.residual)
    error = np.sqrt(np.diag(long_run_covariance(apart)))
    return Comparison(fit, np.asarray((plain.values - fit.values) / np.where(error > 0, error, np.inf)))


def _influence(used: FloatArray, columns: FloatArray, residual: FloatArray) -> FloatArray:
    """What each instant (m, p) moves the estimate by."""
    return np.asarray((used * residual[:, None]) @ np.linalg.inv(used.T @ columns).T)


def _instruments(one: Equation, terms: FrictionTerms, *, timing: Timing) -> FloatArray | None:
    reference, h = one.span.reference, one.span.period
    if reference is None or not np.ptp(reference) > 0:
        return None
    speed = low_pass(difference(reference, h), sharp_cutoff(one.cutoff, h), h)
    direction, _ = direction_of_motion(reference, position_step(reference, None))
    columns = [second_difference(reference, h, timing=timing), *terms.of(Motion(reference, speed, direction))]
    return np.column_stack([one.filtered(column) for column in columns])

r"""When the torque of a log acts: held from its stamp, or measured at it, or later still.

Half a sample is enough to move b: the torque of an inertia that acts d later adds J d times the jerk, which
in a swing is in phase with the speed. To first order u(t) = (X p)(t + d) = X p + d (X p)', so that d is one
more linear parameter. Friction whose reversals are no jumps imitates a delay too, but another one in each
band. The log is therefore taken at its word, the torque of a row at the row's time, unless two bands, the
whole and its lower half, both lie nearer to the other convention; and a delay beyond the conventions is used
only where both bands say the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.excitation.filtering import (
    Equation,
    Timing,
    difference,
    equation,
    low_pass,
    second_difference,
)
from ident.excitation.inverse_dynamics import FrictionTerms, LinearFit, System, least_squares, system
from ident.excitation.spans import Span

CLEAR: Final = 3.0  # standard errors
BEYOND: Final = 0.5  # of a sample: a smaller delay is not told from what coarse sampling feigns


@dataclass(frozen=True)
class ActingTime:
    """The convention, the delay beyond it, and what the data said."""

    timing: Timing
    delay: float  # [s] beyond the convention, as used
    seen: float  # [s] beyond the stamp, as estimated
    stderr: float  # [s]
    consistent: bool  # with half the cut-off


MEASURED: Final = ActingTime("measured", 0.0, 0.0, float("inf"), True)


def acting_time(pieces: Sequence[Span], *, cutoff: float, terms: FrictionTerms) -> ActingTime:
    """Estimate the delay and choose."""
    full, half = (_delay(pieces, cutoff=c, terms=terms) for c in (cutoff, 0.5 * cutoff))
    if full is None:
        return MEASURED
    period = float(np.median([piece.period for piece in pieces]))
    seen, error = full
    same = half is not None and abs(half[0] - seen) <= CLEAR * float(np.hypot(half[1], error))
    later = min(seen, seen if half is None else half[0]) > 0.25 * period
    timing: Timing = "held" if later else "measured"
    rest = seen - (0.5 * period if timing == "held" else 0.0)
    free = same and abs(rest) > max(CLEAR * error, BEYOND * period)
    return ActingTime(timing, rest if free else 0.0, seen, error, same)


def _delay(pieces: Sequence[Span], *, cutoff: float, terms: FrictionTerms) -> tuple[float, float] | None:
    made = [equation(piece, cutoff=cutoff, timing="measured") for piece in pieces]
    equations = [one for one in made if one is not None]
    if not equations:
        return None
    plain = system(equations, terms)
    first = least_squares(plain)
    if first is None:
        return None
    rate = np.concatenate([_torque_rate(one, terms, first) for one in equations])
    fit = least_squares(
        System((*plain.names, "delay"), np.column_stack([plain.columns, rate]), plain.torque, plain.span)
    )
    # u(t) = X(t + d) p = X p + d (X p)'
    return None if fit is None else (fit.value("delay"), fit.stderr("delay"))


def _torque_rate(one: Equation, terms: FrictionTerms, fit: LinearFit) -> FloatArray:
    """The rate (m,) [N m/s] of the torque that the motion needed: the logged one is all noise at its end."""
    h = one.span.period
    second = second_difference(one.span.position, h, timing="measured")
    columns = np.column_stack([second, *terms.of(one.motion)])
    needed = low_pass(columns @ fit.values, one.cutoff, h)
    return one.filtered(difference(needed, h))

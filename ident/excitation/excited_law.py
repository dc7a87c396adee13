"""From excitation logs to a law: the steps in order.

1. Logs are cut into spans without gaps; the band, the timing and the terms are chosen from the data.
2. Inverse dynamics gives the linear law, with robust errors. Half the band gives it again: what an estimate
   moves by then is part of its error, since the law is never exact and the band a choice.
3. Where a reference is logged, instruments tell whether noise in the loop bends the estimate; the error is
   then widened by the distance.
4. Output error adds the Stribeck effect, where one is seen; then the whole law is its, and windows of half
   the length tell what that choice moves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from data.recording import Axis, FloatArray, Recording
from ident.excitation.band import cutoff_frequency
from ident.excitation.cross_validation import held_out_error
from ident.excitation.filtering import Equation, Timing, equation
from ident.excitation.instruments import Comparison, compare_instruments
from ident.excitation.inverse_dynamics import (
    GRAVITY,
    FrictionTerms,
    Law,
    LinearFit,
    least_squares,
    system,
)
from ident.excitation.output_error import LENGTH, OutputError, polish, refine, windows
from ident.excitation.spans import Span, spans
from ident.excitation.timing import ActingTime, acting_time

SAME_PERIOD: Final = 0.01  # relative: spans that are fitted together
TURNED: Final = np.pi  # [rad] travel above which gravity can be told from an offset
FELT: Final = 5.0  # standard errors of a gravity that is there
HEAVY: Final = 0.05  # of the torque's root mean square: a lesser gravity is none


@dataclass(frozen=True)
class ExcitedLaw:
    """The law behind a motion, and how it was found."""

    law: Law
    values: Mapping[str, float]  # by the names of `ident.excitation.inverse_dynamics`
    names: tuple[str, ...]  # of the covariance
    covariance: FloatArray  # (p, p) [product of the parameters' units]
    dof: int
    terms: FrictionTerms
    cutoff: float  # [Hz]
    timing: ActingTime
    linear: LinearFit
    comparison: Comparison | None
    held_out: float | None  # relative error of the torque on folds left out [-]
    left_out: float  # part of the logs in which the link may stick or the torque saturates [-]
    used: frozenset[str]  # logs
    unused: Mapping[str, str]  # log -> why
    refined: OutputError | None = None  # the linear law by output error; None: too few windows
    whole: OutputError | None = None  # with a Stribeck effect, where one is seen
    window: float | None = None  # [s] over which the refinement predicts
    motion: float = 0.0  # root mean square of the position over such a window, about its mean [rad]

    def stderr(self, name: str) -> float:
        """Standard error of a parameter."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))


def excited_law(recordings: Sequence[Recording], *, law: Law, axis: Axis) -> ExcitedLaw | str:
    """The law behind the motions of one rig; a sentence where none can be had."""
    pieces, unused = _alike(recordings)
    if not pieces:
        return "no log has an unbroken stretch of 64 samples"
    if not any(np.any(piece.torque) for piece in pieces):
        return "the torque is zero throughout: nothing was asked of the link, or another signal was read"
    terms = FrictionTerms(law)
    cutoff = cutoff_frequency(pieces, terms=terms, timing="measured")
    if axis == "rotary" and max(np.ptp(piece.position) for piece in pieces) > TURNED:
        terms = _with_gravity(pieces, terms, cutoff=cutoff)
    timing = acting_time(pieces, cutoff=cutoff, terms=terms)
    equations = equations_of(pieces, cutoff=cutoff, timing=timing)
    problem = system(equations, terms) if equations else None
    linear = least_squares(problem) if problem is not None else None
    if problem is None or linear is None:
        return _why_singular(pieces, equations)
    comparison = compare_instruments(equations, problem, linear, terms, timing=timing.timing)
    others = [_in_half_the_band(pieces, terms, cutoff=cutoff, timing=timing)]
    others += [comparison.fit] if comparison is not None and comparison.bent else []
    used = frozenset(one.span.log for one in equations)
    short = {piece.log: "too short for the filter" for piece in pieces if piece.log not in used}
    found = ExcitedLaw(
        law=law,
        values=dict(zip(linear.names, linear.values.tolist(), strict=True)),
        names=linear.names,
        covariance=_with_choices(linear, others),
        dof=linear.dof,
        terms=terms,
        cutoff=cutoff,
        timing=timing,
        linear=linear,
        comparison=comparison,
        held_out=held_out_error(problem),
        left_out=float(np.mean([one.left_out for one in equations])),
        used=used,
        unused={**unused, **short},
    )
    return _refined(found, equations)


def equations_of(pieces: Sequence[Span], *, cutoff: float, timing: ActingTime) -> list[Equation]:
    """The equation of motion of each span that is long enough."""
    made = (equation(p, cutoff=cutoff, timing=timing.timing, delay=timing.delay) for p in pieces)
    return [one for one in made if one is not None]


def _alike(recordings: Sequence[Recording]) -> tuple[list[Span], dict[str, str]]:
    """Spans of the commonest sample period, and why other logs are not used."""
    pieces = [piece for recording in recordings for piece in spans(recording)]
    unused = {
        recording.log: "no unbroken stretch of 64 samples"
        for recording in recordings
        if not any(piece.log == recording.log for piece in pieces)
    }
    if not pieces:
        return [], unused
    periods = np.array([piece.period for piece in pieces])
    near = np.abs(periods[:, None] - periods) < SAME_PERIOD * periods
    common = periods[int(np.argmax(near @ np.array([piece.duration for piece in pieces])))]
    kept = [piece for piece in pieces if abs(piece.period - common) < SAME_PERIOD * common]
    for piece in pieces:
        if not any(other.log == piece.log for other in kept):
            unused[piece.log] = (
                f"sampled every {piece.period:.3g} s, the other logs every {common:.3g} s: identify it alone"
            )
    return kept, unused


def _with_gravity(pieces: Sequence[Span], terms: FrictionTerms, *, cutoff: float) -> FrictionTerms:
    """The terms, with gravity where it is felt."""
    heavy = replace(terms, gravity=True)
    timing = acting_time(pieces, cutoff=cutoff, terms=terms)
    equations = equations_of(pieces, cutoff=cutoff, timing=timing)
    fit = least_squares(system(equations, heavy)) if equations else None
    if fit is None:
        return terms
    felt = any(abs(fit.value(name)) > FELT * fit.stderr(name) for name in GRAVITY)
    size = float(np.linalg.norm([fit.value(name) for name in GRAVITY]))
    torque = np.concatenate([one.torque for one in equations])
    return heavy if felt and size > HEAVY * float(np.sqrt(np.mean(torque**2))) else terms


def _in_half_the_band(
    pieces: Sequence[Span], terms: FrictionTerms, *, cutoff: float, timing: ActingTime
) -> LinearFit | None:
    equations = equations_of(pieces, cutoff=0.5 * cutoff, timing=timing)
    return least_squares(system(equations, terms)) if equations else None


def _with_choices(
    fit: LinearFit | OutputError, others: Sequence[LinearFit | OutputError | None]
) -> FloatArray:
    """The covariance (p, p), widened by what other choices move each parameter by."""
    known = [other for other in others if other is not None]
    moved = np.array([sum((other.value(n) - fit.value(n)) ** 2 for other in known) for n in fit.names])
    variance = np.diag(fit.covariance)
    wider = np.sqrt(1.0 + moved / np.where(variance > 0, variance, np.inf))
    return np.asarray(fit.covariance * np.outer(wider, wider))


def _refined(found: ExcitedLaw, equations: Sequence[Equation]) -> ExcitedLaw:
    """With the output error, whose whole law stands where a Stribeck effect is seen."""
    timing = found.timing
    data = windows(equations, timing=timing.timing, delay=timing.delay)
    if data is None:
        return found
    fastest = float(max(np.max(np.abs(one.motion.rate)) for one in equations))
    refined, whole = refine(data, found.linear, found.law, fastest=fastest)
    motion = float(np.sqrt(np.mean(np.var(data.position, axis=1))))
    found = replace(found, refined=refined, window=data.duration, motion=motion)
    if whole is None:
        return found
    conventions: tuple[Timing, ...] = ("held", "measured")
    for convention in conventions:  # a Stribeck effect bends the timing that the linear law sees
        if convention == timing.timing and not timing.delay:
            continue
        other = windows(equations, timing=convention, delay=0.0)
        again = None if other is None else polish(other, whole, found.law)
        if again is not None and again.error < whole.error:
            whole, timing = again, replace(timing, timing=convention, delay=0.0)
    half = windows(equations, timing=timing.timing, delay=timing.delay, length=0.5 * LENGTH)
    halved = None if half is None else polish(half, whole, found.law)
    whole = replace(whole, covariance=_with_choices(whole, [halved]))
    return replace(
        found,
        whole=whole,
        timing=timing,
        values=whole.values,
        names=whole.names,
        covariance=whole.covariance,
        dof=whole.dof,
    )


def _why_singular(pieces: Sequence[Span], equations: Sequence[Equation]) -> str:
    if not equations:
        return (
            "nothing is left of the logs once the filter's ends, rest and saturation are cut off: record a "
            "longer motion, or a faster one"
        )
    directions = np.unique(np.concatenate([one.motion.direction[one.weight > 0] for one in equations]))
    if directions.size < 2:
        way = "positive" if directions[0] > 0 else "negative"
        return (
            f"E-DIRECTION: the link moves with {way} velocity only: F_c cannot be told from an offset, nor "
            "the other direction at all. Record a motion that goes both ways"
        )
    return (
        f"the motion of {pieces[0].log} does not tell its terms apart (one speed, or no acceleration): "
        "record speeds and accelerations that change"
    )

"""Recordings in, a robot out: the whole identification, in order.

1. Each log is segmented by its protocol: steady runs, breakaways and the motion after them, frequency
responses (`ident.evidence`).
2. A missing direction, a torque of the wrong sign, or as many parameters as data end it here.
3. The law is fitted in one stage (`ident.fit`): values get intervals, or are withheld with a reason.
4. Excitation logs (`ident.excitation`) give the law where nothing else does, else an inertia to compare.
5. What was fitted is predicted from the rest (`ident.validation`).
6. Every log is listed with its use.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis, Recording
from ident.estimate import IdentifiedRobot
from ident.evidence.gathering import (
    Evidence,
    IdentificationError,
    gather,
    log_findings,
    require_evidence,
    run_findings,
    run_uses,
)
from ident.evidence.ripple_correction import ripple_findings
from ident.excitation.excited_law import excited_law
from ident.excitation.inverse_dynamics import Law
from ident.fit.assumptions import DEFAULT, Assumptions
from ident.fit.breakaway_summary import breakaway_summaries
from ident.fit.circumstances import circumstances
from ident.fit.cross_check import bootstrap_table
from ident.fit.gravity import without_gravity
from ident.fit.law_model import DIRECTIONS, SIGN
from ident.fit.map_points import friction_map
from ident.fit.one_stage import explain
from ident.fit.residual_findings import residual_findings
from ident.from_excitation import from_excitation, with_excitation
from ident.identified import Identification
from ident.validation.summary import validate


def identify(
    recordings: Sequence[Recording],
    *,
    assumptions: Assumptions = DEFAULT,
    generator: np.random.Generator | None = None,
) -> Identification:
    """Fit the friction law and the inertia to the recordings of one rig.

    With a generator, the report holds the intervals of a bootstrap over runs beside those of the profiles.
    A direction without usable steady runs is withheld. Raises `IdentificationError` where no law can be had:
    no usable run in either direction (E-DIRECTION), a torque of the wrong sign (E-SIGN), too few data
    (E-FEW).
    """
    if not recordings:
        raise IdentificationError("no recordings: nothing to identify. List logs under [[experiment]].")
    axis = _axis(recordings)
    evidence = gather(recordings)
    excitations = [recording for recording in recordings if recording.protocol == "excitation"]
    alone = bool(excitations) and not evidence.runs and not evidence.starts
    law: Law = "each" if assumptions.laws == "each" else "one"
    excited = excited_law(excitations, law=law, axis=axis) if excitations else "no excitation log"
    if alone:
        return from_excitation(recordings, evidence, excited, assumptions)
    found = _from_evidence(recordings, evidence, assumptions=assumptions, generator=generator)
    return with_excitation(found, excited) if excitations else found


def _from_evidence(
    recordings: Sequence[Recording],
    evidence: Evidence,
    *,
    assumptions: Assumptions,
    generator: np.random.Generator | None,
) -> Identification:
    """The law from constant speeds, breakaways and frequency responses."""
    axis = recordings[0].axis
    require_evidence(recordings, evidence)
    explanation = partial(explain, axis=axis, assumptions=assumptions)
    if axis == "rotary":
        evidence, explained = without_gravity(recordings, evidence, explanation)
    else:
        explained = explanation(evidence)
    values = explained.values
    notes = [
        *log_findings(recordings),
        *run_findings(evidence),
        *ripple_findings(evidence.waves, axis),
        *_missing_tests(evidence),
        *explained.findings,
        *residual_findings(
            explained.evidence,
            explained.weighted,
            circumstances(recordings, explained.evidence),
            axis,
        ),
    ]
    robot = IdentifiedRobot(
        inertia=values.inertia,
        positive=values.curves["positive"],
        negative=values.curves["negative"],
        mean=values.mean,
        torque_offset=values.torque_offset,
        runs=run_uses(recordings, explained.evidence),
        notes=tuple(notes),
        covariance=values.covariance,
        inertia_sources=explained.inertia_sources,
        profiles=values.profiles,
        axis=axis,
        simulated=any(recording.simulated for recording in recordings),
    )
    weighted = explained.weighted
    evidence = explained.evidence
    fit_report = explained.report
    if generator is not None:
        fit_report = f"{fit_report}\n\n{bootstrap_table(weighted.data, values, generator)}"
    return Identification(
        robot=robot,
        friction_map=friction_map(evidence, weighted),
        fit_report=fit_report,
        evidence=evidence,
        weighted=weighted,
        breakaways=breakaway_summaries(evidence, weighted),
        validation=validate(recordings, evidence, weighted),
    )


def _axis(recordings: Sequence[Recording]) -> Axis:
    axes = {recording.axis for recording in recordings}
    if len(axes) > 1:
        raise IdentificationError("the logs mix a rotary and a linear axis: they are not of one rig")
    return recordings[0].axis


def _missing_tests(evidence: Evidence) -> list[Finding]:
    found = []
    for direction in DIRECTIONS:
        starts = [start for start in evidence.starts if start.direction == SIGN[direction]]
        if not any(start.why is None or start.is_censored for start in starts):
            none = "none of the starts can be used" if starts else "no breakaway was recorded"
            text = (
                f"{direction} direction: {none}: F_s rests on the slowest speeds alone. Ramps from rest "
                "would measure it, and the inertia from the motion after."
            )
            found.append(Finding("E-TESTS", Severity.WARN, text))
    if evidence.response is None:
        reasons = sorted(set(evidence.response_reasons.values()))
        none = f"can be used ({'; '.join(reasons)})" if reasons else "was recorded"
        text = f"no frequency response {none}: the inertia rests on the motion after breakaway, if any."
        found.append(Finding("E-TESTS", Severity.WARN, text))
    return found

"""Recordings in, a robot out: the whole identification, in order.

1. Each log is segmented by its protocol: steady runs, breakaways and the motion after them, frequency
responses (`ident.evidence`).
2. A missing direction, a torque of the wrong sign, or as many parameters as data end it here.
3. The law is fitted in one stage (`ident.fit`): values get intervals, or are withheld with a reason.
4. Every log is listed with its use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from data.findings import Finding, Severity
from data.recording import Axis, Recording
from ident.estimate import IdentifiedRobot
from ident.evidence.friction_map import MapPoint
from ident.evidence.gathering import (
    Evidence,
    IdentificationError,
    gather,
    require_evidence,
    run_findings,
    run_uses,
)
from ident.evidence.ripple_correction import ripple_findings
from ident.fit.assumptions import DEFAULT, Assumptions
from ident.fit.law_model import DIRECTIONS, SIGN
from ident.fit.one_stage import explain
from ident.fit.weighting import Weighted


@dataclass(frozen=True)
class Identification:
    """The identified robot with what it rests on."""

    robot: IdentifiedRobot
    friction_map: tuple[MapPoint, ...]
    fit_report: str  # lmfit's own
    evidence: Evidence  # used or not
    weighted: Weighted


def identify(recordings: Sequence[Recording], *, assumptions: Assumptions = DEFAULT) -> Identification:
    """Fit the friction law of each direction and the inertia to the recordings of one rig.

    A direction without usable steady runs is withheld. Raises `IdentificationError` where no law can be had:
    no usable run in either direction (E-DIRECTION), a torque of the wrong sign (E-SIGN), too few data
    (E-FEW).
    """
    if not recordings:
        raise IdentificationError("no recordings: nothing to identify. List logs under [[experiment]].")
    axis = _axis(recordings)
    evidence = gather(recordings)
    require_evidence(recordings, evidence)
    explained = explain(evidence, axis=axis, assumptions=assumptions)
    values = explained.values
    notes = [
        *_log_findings(recordings),
        *run_findings(evidence),
        *ripple_findings(evidence.waves, axis),
        *_missing_tests(evidence),
        *explained.findings,
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
    points = friction_map(explained.evidence, weighted)
    return Identification(robot, points, explained.report, explained.evidence, weighted)


def friction_map(evidence: Evidence, weighted: Weighted) -> tuple[MapPoint, ...]:
    """Every steady run and then every breakaway as a point, used or not, in the order of the logs."""
    points = []
    data, used = weighted.data, iter(range(weighted.data.torque.size))
    inertia = weighted.fit.values["inertia"] if data.has_inertia else 0.0
    for run in evidence.runs:
        number = next(used) if run.why is None else None
        points.append(
            MapPoint(
                log=run.log,
                protocol="constant_velocity",
                direction=run.direction,
                velocity=run.velocity,
                torque=run.torque - inertia * run.acceleration,
                stderr=None if number is None else float(data.run_stderr[number]),
                velocity_stderr=run.velocity_stderr,
                ramp_rate=None,
                start_time=run.start_time,
                end_time=run.end_time,
                used=run.why is None,
                why=run.why,
            )
        )
    used = iter(range(data.start_torque.size))
    for start in evidence.starts:
        number = next(used) if start.why is None else None
        torque = start.torque if number is None else start.direction * float(data.start_torque[number])
        points.append(
            MapPoint(
                log=start.log,
                protocol="breakaway",
                direction=start.direction,
                velocity=0.0,
                torque=torque,
                stderr=None if number is None else float(data.start_stderr[number]),
                velocity_stderr=None,
                ramp_rate=start.line.rate,
                start_time=start.line.start_time,
                end_time=start.onset_time,
                used=start.why is None,
                why=start.why,
            )
        )
    return tuple(points)


def _axis(recordings: Sequence[Recording]) -> Axis:
    axes = {recording.axis for recording in recordings}
    if len(axes) > 1:
        raise IdentificationError("the logs mix a rotary and a linear axis: they are not of one rig")
    return recordings[0].axis


def _log_findings(recordings: Sequence[Recording]) -> list[Finding]:
    return [finding for recording in recordings for finding in recording.findings]


def _missing_tests(evidence: Evidence) -> list[Finding]:
    found = []
    for direction in DIRECTIONS:
        if not any(start.direction == SIGN[direction] for start in evidence.used_starts):
            text = (
                f"{direction} direction: no breakaway was recorded: F_s rests on the slowest speeds alone. "
                "Ramps from "
                "rest would measure it, and the inertia from the motion after."
            )
            found.append(Finding("E-TESTS", Severity.WARN, text))
    if evidence.response is None:
        text = "no frequency response was recorded: the inertia rests on the motion after breakaway, if any."
        found.append(Finding("E-TESTS", Severity.WARN, text))
    return found

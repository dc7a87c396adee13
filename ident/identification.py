"""Recordings in, a robot out: the whole identification, in order.

1. Each log is segmented by its protocol: steady runs, breakaways and the motion after them, frequency
responses (`ident.evidence`).
2. A missing direction, a torque of the wrong sign, or as many parameters as data end it here.
3. The law is fitted in one stage (`ident.fit`): values get intervals, or are withheld with a reason.
4. Excitation logs (`ident.excitation`) give the law where nothing else does, else an inertia to compare.
5. Every log is listed with its use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis, Recording
from ident.estimate import Covariance, Estimate, IdentifiedRobot, RunUse
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
from ident.excitation.excited_law import ExcitedLaw, excited_law
from ident.excitation.inverse_dynamics import Law
from ident.excitation.report import report
from ident.fit.assumptions import DEFAULT, Assumptions
from ident.fit.cross_check import bootstrap_table
from ident.fit.excitation_parameters import (
    compare_inertia,
    excitation_parameters,
    excited_inertia,
)
from ident.fit.law_model import DIRECTIONS, SIGN
from ident.fit.one_stage import explain
from ident.fit.parameters import UNITS
from ident.fit.weighting import Weighted


@dataclass(frozen=True)
class Identification:
    """The identified robot with what it rests on."""

    robot: IdentifiedRobot
    friction_map: tuple[MapPoint, ...]
    fit_report: str  # lmfit's own, the shapes that were compared, the bootstrap, the excitation
    evidence: Evidence  # used or not
    weighted: Weighted | None  # None where the law rests on excitation alone


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
        return _from_excitation(recordings, evidence, excited)
    found = _from_evidence(recordings, evidence, assumptions=assumptions, generator=generator)
    return _with_excitation(found, excited) if excitations else found


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
    fit_report = explained.report
    if generator is not None:
        fit_report = f"{fit_report}\n\n{bootstrap_table(weighted.data, values, generator)}"
    return Identification(robot, points, fit_report, explained.evidence, weighted)


def _from_excitation(
    recordings: Sequence[Recording], evidence: Evidence, excited: ExcitedLaw | str
) -> Identification:
    """The law from excitation alone; raises `IdentificationError` where it holds none."""
    axis = recordings[0].axis
    if isinstance(excited, str):
        raise IdentificationError(excited)
    if excited.values["inertia"] < 0 and all(
        value < 0 for name, value in excited.values.items() if name.endswith("coulomb_torque")
    ):
        raise IdentificationError(
            "E-SIGN: inertia and friction both come out negative: the torque acts against the motion. Set "
            "`sign = -1` for torque or for position in [signals]."
        )
    values = excitation_parameters(excited, axis=axis)
    sources = {"excitation": values.inertia}
    notes = [*_log_findings(recordings), *values.findings]
    if evidence.response is not None:
        unit = UNITS[axis]["inertia"]
        sources["frequency_response"] = Estimate(evidence.response.inertia, unit, evidence.response.stderr)
        notes += compare_inertia(values.inertia, sources["frequency_response"], "frequency response", unit)
    held_out = (
        "" if excited.held_out is None else f" It predicts held-out torque to {100 * excited.held_out:.2f} %."
    )
    text = (
        f"neither constant speeds nor breakaways were recorded: the law rests on excitation alone.{held_out} "
        "Torque ramps from rest would measure F_s, constant speeds from slow to fast v_s and beta."
    )
    notes.append(Finding("E-TESTS", Severity.WARN, text))
    robot = IdentifiedRobot(
        inertia=values.inertia,
        positive=values.curves["positive"],
        negative=values.curves["negative"],
        mean=values.mean,
        torque_offset=values.torque_offset,
        runs=_with_excited_runs(run_uses(recordings, evidence), excited),
        notes=tuple(notes),
        covariance=values.covariance,
        inertia_sources=sources,
        axis=axis,
        simulated=any(recording.simulated for recording in recordings),
    )
    return Identification(robot, (), report(excited), evidence, None)


def _with_excitation(found: Identification, excited: ExcitedLaw | str) -> Identification:
    """The inertia of the excitation beside the others; it stands where there is no other."""
    robot = found.robot
    runs = _with_excited_runs(robot.runs, excited)
    if isinstance(excited, str):
        return replace(found, robot=replace(robot, runs=runs))
    unit = robot.inertia.unit
    inertia, notes = excited_inertia(excited, unit=unit)
    sources = {**robot.inertia_sources, "excitation": inertia}
    covariance = robot.covariance
    chosen = robot.inertia
    if robot.inertia.value is None and inertia.stderr is not None:
        chosen = inertia
        size = len(covariance.names)
        matrix = np.zeros((size + 1, size + 1))
        matrix[0, 0], matrix[1:, 1:] = inertia.stderr**2, covariance.matrix
        covariance = Covariance(("inertia", *covariance.names), matrix)
    else:
        notes += compare_inertia(inertia, robot.inertia, "the other logs", unit)
    robot = replace(
        robot,
        inertia=chosen,
        inertia_sources=sources,
        covariance=covariance,
        runs=runs,
        notes=(*robot.notes, *notes),
    )
    return replace(found, robot=robot, fit_report=f"{found.fit_report}\n\n{report(excited)}")


def _with_excited_runs(runs: Sequence[RunUse], excited: ExcitedLaw | str) -> tuple[RunUse, ...]:
    """The uses of all logs, those of excitation as they turned out."""
    uses = []
    for use in runs:
        if use.protocol != "excitation":
            uses.append(use)
        elif isinstance(excited, str):
            uses.append(replace(use, used=False, why=excited))
        else:
            why = excited.unused.get(use.log)
            uses.append(replace(use, used=use.log in excited.used, why=why))
    return tuple(uses)


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

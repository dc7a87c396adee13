"""Identification from excitation: the law where nothing else was recorded, else an inertia to compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from data.findings import Finding, Severity
from data.recording import Recording
from ident.estimate import Covariance, IdentifiedRobot, RunUse
from ident.evidence.gathering import (
    Evidence,
    IdentificationError,
    log_findings,
    require_possible_inertia,
    run_uses,
)
from ident.excitation.excited_law import ExcitedLaw
from ident.excitation.report import report
from ident.fit.assumptions import Assumptions
from ident.fit.disagreement import inertia_disagreement
from ident.fit.excitation_parameters import excitation_parameters, excited_inertia
from ident.fit.one_stage import response_inertia
from ident.fit.parameters import UNITS
from ident.identified import Identification

_CAUSE = (
    "a delay, a flexible link or friction that varies with place would do it. Both stand in inertia_sources."
)


def from_excitation(
    recordings: Sequence[Recording], evidence: Evidence, excited: ExcitedLaw | str, assumptions: Assumptions
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
    coulomb = [value for name, value in excited.values.items() if name.endswith("coulomb_torque")]
    require_possible_inertia(excited.values["inertia"], max(coulomb))
    sources = {"excitation": values.inertia}
    notes = [*log_findings(recordings), *values.findings]
    if evidence.response is not None:
        unit = UNITS[axis]["inertia"]
        sources["frequency_response"] = response_inertia(evidence.response, unit=unit)
        response = ("frequency response", sources["frequency_response"])
        notes += inertia_disagreement(("excitation", values.inertia), response, unit=unit, cause=_CAUSE)
    held_out = (
        "" if excited.held_out is None else f" It predicts held-out torque to {100 * excited.held_out:.2f} %."
    )
    text = (
        f"neither constant speeds nor breakaways were recorded: the law rests on excitation alone.{held_out} "
        "Torque ramps from rest would measure F_s, constant speeds from slow to fast v_s and beta."
    )
    if assumptions.shape != "fixed":
        text += " beta stays 1, though it was to be free: motion alone does not tell it."
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
    return Identification(robot, (), report(excited), evidence, None, (), None)


def with_excitation(found: Identification, excited: ExcitedLaw | str) -> Identification:
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
        others = ("the other logs", robot.inertia)
        notes += inertia_disagreement(("excitation", inertia), others, unit=unit, cause=_CAUSE)
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

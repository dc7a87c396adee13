"""Recordings in, a robot out: the whole identification, in order.

1. Each log is segmented by its protocol: steady runs, breakaways and the motion after them, frequency
responses.
2. A missing direction, a torque of the wrong sign, or as many parameters as data end it here.
3. The joint fit is settled without the frequency response; it gives v_s, against which the bias speed of the
   frequency response is judged, and an inertia of its own.
4. The frequency response's inertia, as the better source, joins the fit as one datum.
5. Values get intervals, or are withheld with a reason; every log is listed with its use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis, Recording
from ident.estimate import Estimate, IdentifiedRobot
from ident.evidence.frequency_response import LEAST_SPEED_RATIO, FrequencyInertia
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
from ident.fit.confidence import quantile
from ident.fit.friction_fit import DIRECTIONS, SIGN
from ident.fit.law_shape import shape_findings
from ident.fit.parameters import UNITS, Parameters, parameters
from ident.fit.stribeck_effect import where_it_shows
from ident.fit.weighting import Weighted, settle, with_inertia
from ident.fit.withholding import require_enough

COMPATIBLE = 3.0  # standard errors between two sources of the inertia


@dataclass(frozen=True)
class Identification:
    """The identified robot with what it rests on."""

    robot: IdentifiedRobot
    friction_map: tuple[MapPoint, ...]
    fit_report: str  # lmfit's own
    response: FrequencyInertia | None  # for figures, whether the fit used it or not


def identify(recordings: Sequence[Recording], *, free_beta: bool = False) -> Identification:
    """Fit the friction law of each direction and the inertia to the recordings of one rig.

    beta is 1 unless `free_beta`. Raises `IdentificationError` where no law can be had: a direction without
    usable runs (E-DIRECTION), a torque of the wrong sign (E-SIGN), too few data (E-FEW).
    """
    if not recordings:
        raise IdentificationError("no recordings: nothing to identify. List logs under [[experiment]].")
    axis = _axis(recordings)
    evidence = gather(recordings)
    require_evidence(recordings, evidence)
    weighted = where_it_shows(evidence, settle(evidence, free_beta=free_beta), free_beta=free_beta)
    per_direction = 5 if free_beta else 4
    for direction in DIRECTIONS:
        require_enough(weighted.data, direction, parameters=per_direction)
    unit = UNITS[axis]["inertia"]
    dof = _degrees(weighted)
    sources: dict[str, Estimate] = {}
    notes = [
        *_log_findings(recordings),
        *run_findings(evidence),
        *ripple_findings(evidence.waves, axis),
        *_missing_tests(evidence),
    ]
    if evidence.momenta:
        sources["breakaway"] = parameters(weighted.data, weighted.fit, axis=axis, dof=dof).inertia
    if evidence.response is not None:
        response, refusal = _response_source(evidence.response, weighted, unit=unit)
        sources["frequency_response"] = response
        if refusal is not None:
            notes.append(refusal)
        else:
            datum = (evidence.response.inertia, evidence.response.stderr)
            weighted = with_inertia(evidence, weighted, datum, free_beta=free_beta)
            dof = _degrees(weighted)
        notes += _disagreement(sources, unit)
    values = parameters(weighted.data, weighted.fit, axis=axis, dof=dof)
    notes += [] if free_beta else shape_findings(weighted)
    notes += [*values.findings, *_fit_findings(weighted), *_offset_finding(values, axis)]
    robot = IdentifiedRobot(
        inertia=values.inertia,
        positive=values.curves["positive"],
        negative=values.curves["negative"],
        mean=values.mean,
        torque_offset=Estimate(
            None,
            UNITS[axis]["torque_offset"],
            withheld="E-OFFSET: no torque-driven experiment separates a constant offset from an asymmetry of "
            "friction; the laws are those of the torque as logged. A zero-torque reference would tell.",
        ),
        runs=run_uses(recordings, evidence),
        notes=tuple(notes),
        covariance=values.covariance,
        inertia_sources=sources,
        axis=axis,
        simulated=any(recording.simulated for recording in recordings),
    )
    return Identification(robot, friction_map(evidence, weighted), weighted.fit.report, evidence.response)


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


def _degrees(weighted: Weighted) -> int:
    """Data beyond the free parameters: runs, breakaways, and one datum a ramp's motion."""
    data = weighted.data
    friction = sum(name != "inertia" for name in weighted.fit.free)
    return max(data.torque.size + data.start_torque.size - friction, 1)


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


def _response_source(
    response: FrequencyInertia, weighted: Weighted, *, unit: str
) -> tuple[Estimate, Finding | None]:
    """The inertia of the frequency response; withheld where its lowest speed lies in the Stribeck range."""
    for fit in response.fits:
        direction = "positive" if fit.bias_speed > 0 else "negative"
        velocity = weighted.fit.values[f"{direction}_stribeck_velocity"]
        effect = weighted.fit.values[f"{direction}_stribeck_torque"] > 0
        if not effect or fit.lowest_speed >= LEAST_SPEED_RATIO * velocity:
            continue
        text = (
            f"{fit.log}: the speed falls to {fit.lowest_speed:.3g}, under {LEAST_SPEED_RATIO:g} v_s = "
            f"{LEAST_SPEED_RATIO * velocity:.3g}: friction there is no damping and the inertia may be wrong "
            "by tens "
            "of percent. Raise the bias speed or lower the excitation."
        )
        return Estimate(None, unit, withheld=f"E-LOWSPEED: {text}"), Finding(
            "E-LOWSPEED", Severity.WITHHOLD, text, fit.log
        )
    reach = quantile(response.dof) * response.stderr
    interval = (response.inertia - reach, response.inertia + reach)
    return Estimate(response.inertia, unit, response.stderr, interval), None


def _disagreement(sources: dict[str, Estimate], unit: str) -> list[Finding]:
    values = [(name, source.value, source.stderr) for name, source in sources.items()]
    known = [(name, value, error) for name, value, error in values if value is not None and error is not None]
    if len(known) < 2:
        return []
    (one, first, first_error), (two, second, second_error) = known
    distance = abs(first - second) / float(np.hypot(first_error, second_error))
    if distance <= COMPATIBLE:
        return []
    text = (
        f"the inertia from {one} is {first:.4g} and from {two} {second:.4g} {unit}, {distance:.1f} standard "
        "errors "
        "apart: a scale of the torque that changes, a flexible link or friction that varies with place "
        "would do it. "
        "The frequency response is the one reported."
    )
    return [Finding("E-LACKOFFIT", Severity.WARN, text)]


def _fit_findings(weighted: Weighted) -> list[Finding]:
    other = weighted.fit.other_minimum
    if other is None:
        return []
    pairs = ", ".join(
        f"{direction} v_s = {weighted.fit.values[f'{direction}_stribeck_velocity']:.3g} or "
        f"{other[f'{direction}_stribeck_velocity']:.3g}"
        for direction in DIRECTIONS
    )
    return [
        Finding(
            "E-LOCAL", Severity.WARN, f"two minima fit equally well: {pairs}. More speeds around v_s tell."
        )
    ]


def _offset_finding(values: Parameters, axis: Axis) -> list[Finding]:
    pair = [values.curves[direction]["coulomb_torque"] for direction in DIRECTIONS]
    if any(estimate.value is None or estimate.stderr is None for estimate in pair):
        return []
    forward, backward = ((e.value or 0.0, e.stderr or 0.0) for e in pair)
    difference, error = forward[0] - backward[0], float(np.hypot(forward[1], backward[1]))
    if abs(difference) <= COMPATIBLE * error:
        return []
    text = (
        f"F_c differs by {difference:.3g} {UNITS[axis]['torque_offset']} between the directions: an "
        "asymmetry of "
        f"friction, or an actuator offset of {0.5 * difference:.3g}; no torque-driven experiment separates "
        "them. "
        "The laws are those of the torque as logged."
    )
    return [Finding("E-OFFSET", Severity.WARN, text)]

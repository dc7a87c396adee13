"""The one stage: evidence in, the parameters of the law out, with what has to be said of them.

1. The joint fit is settled without the frequency response; it gives v_s, against which the bias speed of the
   frequency response is judged, and an inertia of its own.
2. The frequency response's inertia, as the better source, joins the fit as one datum.
3. Values get intervals, or are withheld with a reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis
from ident.estimate import Estimate
from ident.evidence.frequency_response import LEAST_SPEED_RATIO, FrequencyInertia
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import Assumptions
from ident.fit.confidence import quantile
from ident.fit.friction_fit import DIRECTIONS
from ident.fit.law_shape import shape_findings
from ident.fit.parameters import UNITS, Parameters, parameters
from ident.fit.stribeck_effect import where_it_shows
from ident.fit.weighting import Weighted, settle, with_inertia
from ident.fit.withholding import require_enough

COMPATIBLE = 3.0  # standard errors between two sources of one value


@dataclass(frozen=True)
class Explained:
    """The law behind the evidence."""

    weighted: Weighted  # the settled fit and its data
    values: Parameters
    inertia_sources: Mapping[str, Estimate]  # by protocol
    findings: tuple[Finding, ...]


def explain(evidence: Evidence, *, axis: Axis, assumptions: Assumptions) -> Explained:
    """Fit the law of each direction and the inertia to the evidence.

    Raises `IdentificationError` (E-FEW) where a direction has too few data.
    """
    free_beta = assumptions.shape == "free"
    weighted = where_it_shows(evidence, settle(evidence, free_beta=free_beta), free_beta=free_beta)
    for direction in DIRECTIONS:
        require_enough(weighted.data, direction, parameters=5 if free_beta else 4)
    unit = UNITS[axis]["inertia"]
    sources: dict[str, Estimate] = {}
    findings: list[Finding] = []
    if evidence.momenta:
        sources["breakaway"] = parameters(weighted.data, weighted.fit, axis=axis).inertia
    if evidence.response is not None:
        response, refusal = _response_source(evidence.response, weighted, unit=unit)
        sources["frequency_response"] = response
        if refusal is not None:
            findings.append(refusal)
        else:
            datum = (evidence.response.inertia, evidence.response.stderr)
            dof = evidence.response.dof
            weighted = with_inertia(evidence, weighted, datum, dof=dof, free_beta=free_beta)
        findings += _disagreement(sources, unit)
    values = parameters(weighted.data, weighted.fit, axis=axis)
    findings += [] if free_beta else shape_findings(weighted)
    findings += [*values.findings, *_fit_findings(weighted), *_offset_finding(values, axis)]
    return Explained(weighted, values, sources, tuple(findings))


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

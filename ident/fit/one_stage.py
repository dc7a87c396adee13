"""The one stage: evidence in, the parameters of the law out, with what has to be said of them.

1. The model: a law for each direction that has steady runs, or one for both; beta fixed, free or chosen.
2. The joint fit is settled without the frequency response; it gives v_s, against which the bias speed of the
   frequency response is judged, and an inertia of its own.
3. The frequency response's inertia, as the better source, joins the fit as one datum.
4. Values get intervals, or are withheld with a reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis
from ident.estimate import Estimate
from ident.evidence.frequency_response import LEAST_SPEED_RATIO, FrequencyInertia
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import Assumptions
from ident.fit.censoring import with_bounds
from ident.fit.confidence import quantile
from ident.fit.disagreement import asymmetry, inertia_disagreement
from ident.fit.friction_fit import polished
from ident.fit.law_model import DIRECTIONS, Direction, LawModel, LawName, direction_of
from ident.fit.law_shape import chosen_shape, shape_findings
from ident.fit.missing_direction import Missing, missing_directions, of_directions
from ident.fit.one_law import one_law_findings
from ident.fit.parameters import NO_INERTIA, UNITS, Parameters, parameters
from ident.fit.ramp_rates import trend_finding
from ident.fit.second_minimum import minimum_findings, without_disputed
from ident.fit.small_samples import certainty
from ident.fit.stribeck_effect import where_it_shows
from ident.fit.weighting import Weighted, settle, with_inertia
from ident.fit.withholding import require_enough

_CAUSE = (
    "a torque that acts later than it is logged, a flexible link or friction that varies with place would do "
    "it. The frequency response is the one reported."
)


@dataclass(frozen=True)
class Explained:
    """The law behind the evidence."""

    evidence: Evidence  # with what a missing direction left unused
    weighted: Weighted  # the settled fit and its data
    values: Parameters
    inertia_sources: Mapping[str, Estimate]  # by protocol
    report: str  # lmfit's own, and what was compared
    findings: tuple[Finding, ...]


def explain(evidence: Evidence, *, axis: Axis, assumptions: Assumptions) -> Explained:
    """Fit the law of each direction, or one for both, and the inertia to the evidence.

    A direction without steady runs is withheld. Raises `IdentificationError` where there is neither
    (E-DIRECTION), and where a law has too few data (E-FEW).
    """
    missing = missing_directions(evidence)
    evidence = of_directions(evidence, missing)
    model = _model(assumptions, missing)
    require_enough(evidence, model)
    choice = chosen_shape(evidence, model) if assumptions.shape == "chosen" else None
    model = model if choice is None else choice.model
    weighted = where_it_shows(evidence, settle(evidence, model))
    unit = UNITS[axis]["inertia"]
    sources: dict[str, Estimate] = {}
    findings: list[Finding] = list(missing.findings)
    if "inertia" in weighted.fit.free:  # the motion may have told none
        sources["breakaway"] = _inertia_of(weighted, unit)
    if evidence.response is not None:
        response, refusal = _response_source(evidence.response, weighted, unit=unit)
        sources["frequency_response"] = response
        if refusal is not None:
            findings.append(refusal)
        else:
            datum = (evidence.response.inertia, evidence.response.stderr)
            weighted = with_inertia(evidence, weighted, datum, dof=evidence.response.dof)
        if "breakaway" in sources:
            findings += inertia_disagreement(
                ("breakaway", sources["breakaway"]), ("frequency_response", response), unit=unit, cause=_CAUSE
            )
    fit, report = polished(weighted.data, weighted.fit)
    values = parameters(weighted.data, fit, axis=axis, missing=missing.reasons)
    weighted = replace(weighted, fit=values.fit)
    values = with_bounds(without_disputed(values), evidence)
    findings += shape_findings(weighted) if assumptions.shape == "fixed" else []
    findings += [] if choice is None else [choice.finding]
    findings += one_law_findings(evidence, model)
    if weighted.data.trend is not None:
        findings.append(trend_finding(weighted.data.trend, unit=UNITS[axis]["static_torque"]))
    findings += [*values.findings, *minimum_findings(values), *_asymmetry(values, axis)]
    report = report if choice is None else f"{report}\n\n{choice.table}"
    return Explained(evidence, weighted, values, sources, report, tuple(findings))


def _model(assumptions: Assumptions, missing: Missing) -> LawModel:
    """One law has an offset only where both directions were recorded: else they cannot be told apart."""
    laws: tuple[LawName, ...] = tuple(way for way in DIRECTIONS if way not in missing.reasons)
    if assumptions.laws == "one" and not missing.reasons:
        laws = ("mean",)
    return LawModel(laws, free_shape=laws if assumptions.shape == "free" else ())


def _inertia_of(weighted: Weighted, unit: str) -> Estimate:
    """The inertia of a fit with the interval of its standard error."""
    value = weighted.fit.values["inertia"]
    found = certainty(weighted.data, weighted.fit)
    own = np.array([float(name == "inertia") for name in weighted.fit.free])
    place = weighted.fit.free.index("inertia")
    error = float(np.sqrt(found.covariance[place, place]))
    if not (value > 0 and np.isfinite(error)):
        return Estimate(None, unit, withheld=NO_INERTIA)
    reach = quantile(found.dof(own)) * error
    return Estimate(value, unit, error, (max(value - reach, 0.0), value + reach))


def _response_source(
    response: FrequencyInertia, weighted: Weighted, *, unit: str
) -> tuple[Estimate, Finding | None]:
    """The inertia of the frequency response; withheld where its lowest speed lies in the Stribeck range."""
    for fit in response.fits:
        velocity = _stribeck_range(weighted, direction_of(fit.bias_speed))
        if fit.lowest_speed >= LEAST_SPEED_RATIO * velocity:
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
    return response_inertia(response, unit=unit), None


def response_inertia(response: FrequencyInertia, *, unit: str) -> Estimate:
    """The inertia of the frequency response with its 95 % interval."""
    reach = quantile(response.dof) * response.stderr
    interval = (response.inertia - reach, response.inertia + reach)
    return Estimate(response.inertia, unit, response.stderr, interval)


def _stribeck_range(weighted: Weighted, direction: Direction) -> float:
    """The v_s under which the friction of a direction is no damping; 0 where it has no Stribeck effect.

    Where that direction has no law, the largest that is known.
    """
    fit = weighted.fit
    own = fit.model.law_of(direction)
    laws = fit.model.laws if own is None else (own,)
    return max(
        fit.values[f"{law}_stribeck_velocity"] if fit.values[f"{law}_stribeck_torque"] > 0 else 0.0
        for law in laws
    )


def _asymmetry(values: Parameters, axis: Axis) -> list[Finding]:
    positive, negative = (values.curves[direction]["coulomb_torque"] for direction in DIRECTIONS)
    return asymmetry(positive, negative, unit=UNITS[axis]["torque_offset"])

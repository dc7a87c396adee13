"""Whether one law with an offset holds for both directions, where one was asked for.

Weights that were settled under one law hide its misfit: it is taken for spread between runs. The data are
therefore weighed under a law for each direction, and both are fitted with these weights. The F ratio of what
the further parameters take off chi-square to what is then left of it does not depend on how large the spread
was taken to be.
"""

from __future__ import annotations

from dataclasses import replace

from data.findings import Finding, Severity
from ident.evidence.gathering import Evidence
from ident.fit.friction_fit import FrictionFit, fit_friction, residuals
from ident.fit.law_model import DIRECTIONS, LawModel
from ident.fit.law_shape import FAR_BETTER
from ident.fit.weighting import settle

_COMPARED = {"dF": "stribeck_torque", "v_s": "stribeck_velocity", "b": "viscous_damping"}


def one_law_findings(evidence: Evidence, model: LawModel) -> tuple[Finding, ...]:
    """E-LACKOFFIT where a law for each direction fits far better than one for both and an offset."""
    if not model.has_offset:
        return ()
    apart = settle(evidence, LawModel(free_shape=DIRECTIONS if model.free_shape else ()))
    one = fit_friction(replace(apart.data, model=model))
    more = len(apart.fit.free) - len(one.free)
    spare = residuals(apart.data, apart.fit.values).size - len(apart.fit.free)
    fall = one.chi_square - apart.fit.chi_square
    if more < 1 or spare < 1 or fall / more <= FAR_BETTER * apart.fit.chi_square / spare:
        return ()
    text = (
        "one law for both directions does not fit: with a law for each, chi-square falls from "
        f"{one.chi_square:.3g} to {apart.fit.chi_square:.3g}, with {_pairs(apart.fit)} for positive and "
        "negative velocity. The law is a compromise between the two, and its offset takes up what is an "
        "asymmetry of friction. Identify without --one-law."
    )
    return (Finding("E-LACKOFFIT", Severity.WARN, text),)


def _pairs(fit: FrictionFit) -> str:
    return ", ".join(
        f"{name} {fit.values[f'positive_{key}']:.3g} and {fit.values[f'negative_{key}']:.3g}"
        for name, key in _COMPARED.items()
    )

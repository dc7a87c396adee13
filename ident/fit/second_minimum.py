"""Two minima that fit equally well: both are told, and what they disagree about is withheld."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from data.findings import Finding, Severity
from ident.estimate import CURVE_PARAMETERS, Estimate
from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import LawName
from ident.fit.parameters import Parameters, law_values
from ident.fit.withholding import where

APART = 0.1  # of v_s: the two minima differ in a law


def without_disputed(values: Parameters) -> Parameters:
    """The parameters, those withheld in which the other minimum lies outside the interval (E-LOCAL)."""
    fit, other = values.fit, values.fit.other_minimum
    if other is None:
        return values
    ours: dict[LawName, Mapping[str, Estimate]] = {
        law: values.mean if law == "mean" else values.curves[law] for law in fit.model.laws
    }
    kept: dict[LawName, Mapping[str, Estimate]] = {
        law: _kept(own, law_values(other, law), law) for law, own in ours.items()
    }
    mean = kept.get("mean", values.mean)
    if len(kept) == 2:
        mean = {
            name: values.mean[name]
            if all(own[name].value is not None for own in kept.values())
            else _lost(values.mean[name], "; ".join(_lacking(kept, name)))
            for name in CURVE_PARAMETERS
        }
    curves = {direction: kept.get(direction, own) for direction, own in values.curves.items()}
    return replace(values, curves=curves, mean=mean)


def _kept(own: Mapping[str, Estimate], other: Mapping[str, float], law: LawName) -> dict[str, Estimate]:
    return {
        name: _lost(estimate, _reason(name, estimate, other[name], law))
        if _disputed(estimate, other[name])
        else estimate
        for name, estimate in own.items()
    }


def _disputed(estimate: Estimate, other: float) -> bool:
    if estimate.value is None or estimate.interval95 is None:
        return False
    low, high = estimate.interval95
    return (low is not None and other < low) or (high is not None and other > high)


def _reason(name: str, estimate: Estimate, other: float, law: LawName) -> str:
    return (
        f"E-LOCAL: {where(law)}: two minima fit about equally well, with {name} = {estimate.value:.3g} or "
        f"{other:.3g}, further apart than the interval of either. More speeds around v_s tell."
    )


def _lost(estimate: Estimate, why: str) -> Estimate:
    return estimate if estimate.value is None else Estimate(None, estimate.unit, withheld=why)


def _lacking(kept: Mapping[LawName, Mapping[str, Estimate]], name: str) -> list[str]:
    return [own[name].withheld or "" for own in kept.values() if own[name].value is None]


def minimum_findings(values: Parameters) -> tuple[Finding, ...]:
    """E-LOCAL: both minima, with what they make of each law; a withholding where they disagree."""
    fit, other = values.fit, values.fit.other_minimum
    if other is None:
        return ()
    pairs = "; ".join(
        f"{where(law)}: {_both(fit, other, law)}" for law in fit.model.laws if _differ(fit, other, law)
    )
    laws = [*values.curves.values(), values.mean]
    disputed = any((own[name].withheld or "").startswith("E-LOCAL") for own in laws for name in own)
    text = f"two minima fit about equally well: {pairs}. More speeds around v_s tell."
    return (Finding("E-LOCAL", Severity.WITHHOLD if disputed else Severity.WARN, text),)


def _differ(fit: FrictionFit, other: Mapping[str, float], law: LawName) -> bool:
    first, second = (law_values(values, law)["stribeck_velocity"] for values in (fit.values, other))
    return abs(second - first) > APART * first


def _both(fit: FrictionFit, other: Mapping[str, float], law: LawName) -> str:
    first, second = law_values(fit.values, law), law_values(other, law)
    names = (name for name in CURVE_PARAMETERS if first[name] != second[name])
    return ", ".join(f"{name} = {first[name]:.3g} or {second[name]:.3g}" for name in names)

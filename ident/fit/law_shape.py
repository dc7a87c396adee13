r"""The shape of the Stribeck curve: whether beta = 1 fits, and which beta AICc prefers.

Weights that the data have settled themselves hide a wrong law: the misfit is taken for spread between runs,
and chi-square is what it should be. A fit with beta free tells: as an F ratio, of what more parameters take
off chi-square to what is then left of it, which does not depend on how large the spread was taken to be.

To choose, the data are weighed under beta free in every law, so that no misfit stands in the standard errors,
and beta = 1 or free in each law are compared on these weights by

    AICc = chi^2 + 2 k + 2 k (k + 1) / (n - k - 1),

k the free parameters, n the data, each ramp's motion as one (Hurvich and Tsai 1989). The weight of a model is
exp(-(AICc - least)/2), normalised (Burnham and Anderson 2002).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from data.findings import Finding, Severity
from ident.evidence.gathering import Evidence
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, fit_friction, residuals
from ident.fit.law_model import LawModel, LawName
from ident.fit.stribeck_effect import where_it_shows
from ident.fit.weighting import Weighted, settle
from ident.fit.withholding import SPARE, counted, where

FAR_BETTER = 12.0  # F ratio; by chance under once in ten thousand with 20 data to spare


@dataclass(frozen=True)
class ShapeChoice:
    """The model that AICc prefers, and what it was compared with."""

    model: LawModel
    table: str
    finding: Finding


def shape_findings(weighted: Weighted) -> tuple[Finding, ...]:
    """E-LACKOFFIT where freeing beta would pay."""
    model = weighted.data.model
    bent = tuple(law for law in model.laws if law not in model.lines)
    if not bent:
        return ()
    data = replace(weighted.data, model=replace(model, free_shape=bent))
    freed = fit_friction(data)
    spare = residuals(data, freed.values).size - len(freed.free)
    if spare < 1:
        return ()
    fall = (weighted.fit.chi_square - freed.chi_square) / len(bent)
    if fall <= FAR_BETTER * freed.chi_square / spare:
        return ()
    shapes = " and ".join(f"{freed.values[f'{law}_stribeck_shape']:.2g} ({where(law)})" for law in bent)
    text = (
        f"the law with beta = 1 does not fit: with beta free it becomes {shapes} and chi-square falls from "
        f"{weighted.fit.chi_square:.3g} to {freed.chi_square:.3g}. Values and intervals are conditional on "
        "beta = 1, v_s most of all. Identify with --free-beta, or with --choose-beta."
    )
    return (Finding("E-LACKOFFIT", Severity.WARN, text),)


def chosen_shape(evidence: Evidence, model: LawModel) -> ShapeChoice:
    """The model with beta = 1 or free in each law, whichever combination AICc prefers.

    Beta is offered where a law has three data more than parameters with it, and a Stribeck effect.
    """
    offered = tuple(law for law in model.laws if _affords(evidence, model, law))
    weighted = where_it_shows(evidence, settle(evidence, replace(model, free_shape=offered)))
    data = weighted.data
    bent = [law for law in offered if law not in data.model.lines]
    subsets = [some for count in range(len(bent) + 1) for some in itertools.combinations(bent, count)]
    tried = [_try(data, subset) for subset in subsets]
    score = np.array([_aicc(data, fit) for fit in tried])
    best = tried[int(np.argmin(score))]
    weight = np.exp(-0.5 * (score - score.min()))
    weight /= weight.sum()
    table = _table(tried, score, weight)
    text = (
        f"by AICc, {_named(best)} (chi-square, parameters, AICc, weight): "
        + "; ".join(
            f"{_named(fit)}: {fit.chi_square:.4g}, {len(fit.free)}, {own:.4g}, {share:.2g}"
            for fit, own, share in zip(tried, score, weight, strict=True)
        )
        + ". Values and intervals are conditional on the choice."
    )
    chosen = replace(model, free_shape=best.model.free_shape)
    return ShapeChoice(chosen, table, Finding("E-SHAPE", Severity.WARN, text))


def _affords(evidence: Evidence, model: LawModel, law: LawName) -> bool:
    runs, starts, parameters = counted(evidence, replace(model, free_shape=(law,)), law)
    return runs + starts - parameters >= SPARE


def _try(data: FitData, free: tuple[LawName, ...]) -> FrictionFit:
    return fit_friction(replace(data, model=replace(data.model, free_shape=free)))


def _aicc(data: FitData, fit: FrictionFit) -> float:
    known = int(data.inertia is not None)
    n, k = data.torque.size + data.start_torque.size + len(data.momenta) + known, len(fit.free)
    return fit.chi_square + 2 * k + 2 * k * (k + 1) / (n - k - 1)


def _named(fit: FrictionFit) -> str:
    shapes = [
        f"beta = {fit.values[f'{law}_stribeck_shape']:.3g} fitted ({where(law)})"
        if law in fit.model.free_shape
        else f"beta = 1 ({where(law)})"
        for law in fit.model.laws
        if law not in fit.model.lines
    ]
    return ", ".join(shapes) or "a line, which has no beta"


def _table(tried: list[FrictionFit], score: np.ndarray, weight: np.ndarray) -> str:
    head = f"{'chi-square':>12} {'parameters':>10} {'AICc':>10} {'difference':>10} {'weight':>8}  model"
    lines = [
        f"{fit.chi_square:12.4f} {len(fit.free):10d} {own:10.3f} {own - score.min():10.3f} {share:8.4f}  "
        f"{_named(fit)}"
        for fit, own, share in zip(tried, score, weight, strict=True)
    ]
    return "\n".join(["[[Shape of the Stribeck curve, by AICc]]", head, *lines])

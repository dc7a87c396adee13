"""Whether the data show a Stribeck effect at all; where they do not, the law is a line.

Without an effect v_s has no meaning, and a fit that keeps it wanders off: to a v_s so long that the fading
torque imitates damping, or so short that it touches nothing. Each law is therefore held against a line
F_c + b v with a breakaway torque of its own. The line stays where two things are so:

- the curve fits no better: chi-square falls by less than 6 (v_s vanishes from the model at dF = 0, so that
  the threshold is not the 3.84 of one more parameter: the best of all v_s is compared);
- the breakaways lie no higher than the line by more than their errors.

The second is judged with the onset of a link without Stribeck effect, which starts more slowly: with the
wrong delay a fast ramp alone would look like an effect.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ident.evidence.gathering import Evidence
from ident.fit.confidence import quantile
from ident.fit.friction_fit import fit_friction
from ident.fit.law_model import LawName
from ident.fit.small_samples import certainty
from ident.fit.weighting import Weighted, reweighted

EARNED = 6.0  # fall of chi-square by which a curve has to beat the line
CLEAR = 8.0  # standard errors of dF and of v_s from zero: nothing to ask then


def where_it_shows(evidence: Evidence, weighted: Weighted) -> Weighted:
    """The fit as it is, or with a line for each law without a Stribeck effect."""
    for law in weighted.data.model.laws:
        if not _is_clear(weighted, law):
            weighted = _line_if_as_good(evidence, weighted, law)
    return weighted


def _is_clear(weighted: Weighted, law: LawName) -> bool:
    fit = weighted.fit
    for name in (f"{law}_stribeck_torque", f"{law}_stribeck_velocity"):
        where = fit.free.index(name)
        if not fit.values[name] ** 2 > CLEAR**2 * float(fit.covariance[where, where]):
            return False
    return True


def _line_if_as_good(evidence: Evidence, weighted: Weighted, law: LawName) -> Weighted:
    model = weighted.data.model
    data = replace(weighted.data, model=replace(model, lines=(*model.lines, law)))
    fit = fit_friction(data, start=weighted.fit)
    if fit.chi_square - weighted.fit.chi_square > EARNED:
        return weighted
    for _ in range(2):
        data = reweighted(evidence, data, fit, weighted.spread)
        fit = fit_friction(data, start=fit)
    where = fit.free.index(f"{law}_stribeck_torque")
    found, own = certainty(data, fit), np.eye(len(fit.free))[where]
    reach = quantile(found.dof(own)) * float(np.sqrt(found.covariance[where, where]))
    seen = np.isfinite(reach) and fit.values[f"{law}_stribeck_torque"] > reach
    return weighted if seen else Weighted(data, fit, weighted.spread)

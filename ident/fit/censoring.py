"""What a ramp that ended at the torque limit says of F_s: a bound, and no number.

Where a law has no other breakaway, its F_s is withheld with the interval [limit, open). The rest of the law
stands: it was fitted to the steady runs, whose extrapolation to rest no torque has confirmed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ident.estimate import Estimate
from ident.evidence.gathering import Evidence
from ident.fit.law_model import LawModel, LawName
from ident.fit.parameters import Parameters
from ident.fit.withholding import where


def least_static_torques(evidence: Evidence, model: LawModel) -> Mapping[LawName, float]:
    """The bound on F_s [N m] of each law that has no breakaway but censored ones."""
    bounds: dict[LawName, float] = {}
    for law in model.laws:
        ways = model.signs(law)
        censored = [s for s in evidence.starts if s.direction in ways and s.is_censored]
        if censored and not any(start.direction in ways for start in evidence.used_starts):
            bounds[law] = max(abs(start.torque) for start in censored)
    return bounds


def with_bounds(values: Parameters, evidence: Evidence) -> Parameters:
    """The parameters with F_s withheld, and bounded from below, where only censored breakaways tell it."""
    bounds = least_static_torques(evidence, values.fit.model)
    if not bounds:
        return values
    unit = values.mean["static_torque"].unit
    known = {law: _bounded(law, bound, unit) for law, bound in bounds.items()}
    curves = {
        way: {**curve, "static_torque": known[way]} if way in known else curve
        for way, curve in values.curves.items()
    }
    reasons = "; ".join(estimate.withheld or "" for estimate in known.values())
    mean = known.get("mean", Estimate(None, unit, withheld=reasons))
    lost = {f"{law}.static_torque" for law in known} | {"mean.static_torque"}
    return replace(
        values,
        curves=curves,
        mean={**values.mean, "static_torque": mean},
        profiles={name: points for name, points in values.profiles.items() if name not in lost},
    )


def _bounded(law: LawName, bound: float, unit: str) -> Estimate:
    text = (
        f"E-SAT: {where(law)}: every ramp ended at the torque limit: F_s >= {bound:.4g} {unit}, not a "
        "number. Raise the limit, or ramp where there is less friction."
    )
    return Estimate(None, unit, interval95=(bound, None), withheld=text)

"""What a ramp that ended at the torque limit says of F_s: a bound, and no number.

Where a direction has no other breakaway, F_s is withheld with the interval [limit, open). The law of its
steady runs stands: it was fitted without the ramp, and extrapolates to a rest that no torque has left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ident.estimate import Estimate
from ident.evidence.gathering import Evidence
from ident.fit.friction_fit import DIRECTIONS, SIGN, Direction
from ident.fit.parameters import Parameters


def least_static_torques(evidence: Evidence) -> Mapping[Direction, float]:
    """The bound on F_s [N m] of each direction that has no breakaway but censored ones."""
    bounds: dict[Direction, float] = {}
    for direction in DIRECTIONS:
        if any(start.direction == SIGN[direction] for start in evidence.used_starts):
            continue
        own = [start for start in evidence.starts if start.direction == SIGN[direction]]
        if any(start.is_censored for start in own):
            bounds[direction] = max(abs(start.torque) for start in own if start.is_censored)
    return bounds


def with_bounds(values: Parameters, evidence: Evidence) -> Parameters:
    """The parameters with F_s withheld, and bounded from below, where only censored breakaways tell it."""
    bounds = least_static_torques(evidence)
    if not bounds:
        return values
    unit = values.mean["static_torque"].unit
    curves = dict(values.curves)
    for direction, bound in bounds.items():
        known = f"{direction} direction: every ramp ended at the torque limit: F_s >= {bound:.4g} {unit}"
        text = f"E-SAT: {known}, not a number. Raise the limit, or ramp where there is less friction."
        estimate = Estimate(None, unit, interval95=(bound, None), withheld=text)
        curves[direction] = {**values.curves[direction], "static_torque": estimate}
    reasons = "; ".join(
        curves[direction]["static_torque"].withheld or "" for direction in DIRECTIONS if direction in bounds
    )
    mean = {**values.mean, "static_torque": Estimate(None, unit, withheld=reasons)}
    return replace(values, curves=curves, mean=mean)

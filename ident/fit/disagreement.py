"""Two values that ought to be one: a finding where they lie further apart than their errors allow."""

from __future__ import annotations

import numpy as np

from data.findings import Finding, Severity
from ident.estimate import Estimate

COMPATIBLE = 2.0  # 95 % half-widths of the difference of two values that are one; about 4 standard errors


def inertia_disagreement(
    one: tuple[str, Estimate], two: tuple[str, Estimate], *, unit: str, cause: str
) -> list[Finding]:
    """E-LACKOFFIT where the inertias [kg m^2] of two named sources disagree; `cause` ends the sentence."""
    distance = _distance(one[1], two[1])
    if distance is None or distance <= COMPATIBLE:
        return []
    text = (
        f"the inertia from {one[0]} is {one[1].value:.4g} and from {two[0]} {two[1].value:.4g} {unit}, "
        f"{distance:.1f} times as far apart as their 95 % intervals allow: a scale of the torque that "
        f"changes, {cause}"
    )
    return [Finding("E-LACKOFFIT", Severity.WARN, text)]


def asymmetry(positive: Estimate, negative: Estimate, *, unit: str) -> list[Finding]:
    """E-OFFSET where F_c [N m] differs between the directions."""
    distance = _distance(positive, negative)
    if distance is None or distance <= COMPATIBLE:
        return []
    difference = (positive.value or 0.0) - (negative.value or 0.0)
    text = (
        f"F_c differs by {difference:.3g} {unit} between the directions: an asymmetry of friction, or an "
        f"actuator offset of {0.5 * difference:.3g}; no torque-driven experiment separates them. The laws "
        "are those of the torque as logged."
    )
    return [Finding("E-OFFSET", Severity.WARN, text)]


def _distance(one: Estimate, two: Estimate) -> float | None:
    """Between two values, in 95 % half-widths of the difference; None where one of them has no interval."""
    first, second = _half_width(one), _half_width(two)
    if one.value is None or two.value is None or not (first and second):
        return None
    return abs(one.value - two.value) / float(np.hypot(first, second))


def _half_width(estimate: Estimate) -> float:
    """Half of the 95 % interval; 0 where it is open or unknown."""
    low, high = estimate.interval95 or (None, None)
    return 0.0 if low is None or high is None else 0.5 * (high - low)

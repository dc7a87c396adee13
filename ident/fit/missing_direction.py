"""A direction without steady runs: withheld with the reason, never copied from the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from data.findings import Finding, Severity
from data.protocols import IDENTIFIES
from ident.evidence.gathering import Evidence
from ident.fit.law_model import DIRECTIONS, SIGN, Direction


@dataclass(frozen=True)
class Missing:
    """Why each direction that has no law has none, and the findings that say so."""

    reasons: Mapping[Direction, str]
    findings: tuple[Finding, ...]


def missing_directions(evidence: Evidence) -> Missing:
    """The directions without a usable steady run."""
    reasons: dict[Direction, str] = {}
    for direction in DIRECTIONS:
        if not any(run.direction == SIGN[direction] for run in evidence.used_runs):
            reasons[direction] = _reason(evidence, direction)
    findings = (Finding("E-DIRECTION", Severity.WITHHOLD, text) for text in reasons.values())
    return Missing({way: f"E-DIRECTION: {text}" for way, text in reasons.items()}, tuple(findings))


def of_directions(evidence: Evidence, missing: Missing) -> Evidence:
    """The evidence with the breakaways of a missing direction left out for its reason."""
    if not missing.reasons:
        return evidence
    why = {SIGN[direction]: reason for direction, reason in missing.reasons.items()}
    return replace(
        evidence,
        starts=tuple(replace(start, why=start.why or why.get(start.direction)) for start in evidence.starts),
        momenta=tuple(motion for motion in evidence.momenta if motion.direction not in why),
    )


def _reason(evidence: Evidence, direction: Direction) -> str:
    sign = SIGN[direction]
    left_out = [run for run in evidence.runs if run.why is not None and run.velocity * sign > 0]
    also = f" {len(left_out)} run(s) that way were left out; the first: {left_out[0].why}" if left_out else ""
    ramps = sum(start.direction == sign for start in evidence.used_starts)
    also += f" {ramps} breakaway(s) that way are not enough for a law and were not used." if ramps else ""
    return (
        f"no usable constant-velocity run with {direction} velocity.{also} F_c, v_s and b of that direction "
        "cannot be told, and the other direction's law is never copied. Record constant speeds with "
        f"{direction} velocity, in ratio from slow to fast; they give {IDENTIFIES['constant_velocity']}."
    )

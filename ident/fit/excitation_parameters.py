"""From the law behind an excitation to the parameters of a robot, and what has to be said of them.

One law for both directions stands in the mean with the offset beside it, and neither direction has a law of
its own; a law for each leaves the offset withheld, as everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis
from ident.estimate import CURVE_PARAMETERS, Covariance, Estimate
from ident.excitation.excited_law import ExcitedLaw
from ident.fit.confidence import quantile, symmetric
from ident.fit.disagreement import asymmetry
from ident.fit.law_model import DIRECTIONS, Direction
from ident.fit.parameters import NO_OFFSET, ONE_LAW, UNITS

POOR: Final = 0.1  # relative error of the torque above which the law does not explain the motion
STRIBECK_PART: Final = ("static_torque", "stribeck_velocity", "stribeck_shape")


@dataclass(frozen=True)
class ExcitationParameters:
    """The parameters of a robot behind an excitation."""

    inertia: Estimate
    curves: Mapping[Direction, Mapping[str, Estimate]]
    mean: Mapping[str, Estimate]
    torque_offset: Estimate
    covariance: Covariance
    findings: tuple[Finding, ...]


def excitation_parameters(found: ExcitedLaw, *, axis: Axis) -> ExcitationParameters:
    """Values with intervals, or why they are withheld."""
    units = UNITS[axis]
    covariance = _covariance(found)
    inertia, findings = excited_inertia(found, unit=units["inertia"])
    if found.law == "one":
        mean, own = _curve(found, "", "mean", covariance, units=units)
        findings += own
        absent = {name: Estimate(None, units[name], withheld=ONE_LAW) for name in CURVE_PARAMETERS}
        curves: dict[Direction, Mapping[str, Estimate]] = dict.fromkeys(DIRECTIONS, absent)
        offset = _estimate(found, "torque_offset", units["torque_offset"], least=None)
    else:
        curves = {}
        for direction in DIRECTIONS:
            curves[direction], own = _curve(found, f"{direction}_", direction, covariance, units=units)
            findings += own
        mean = {name: _mean(name, curves, covariance, found.dof, units[name]) for name in CURVE_PARAMETERS}
        offset = Estimate(None, units["torque_offset"], withheld=NO_OFFSET)
        pair = [curves[direction]["coulomb_torque"] for direction in DIRECTIONS]
        findings += asymmetry(pair[0], pair[1], unit=units["torque_offset"])
    laws: dict[str, Mapping[str, Estimate]] = {"mean": mean, **{key: curves[key] for key in DIRECTIONS}}
    kept = _kept(covariance, inertia, laws)
    return ExcitationParameters(inertia, curves, mean, offset, kept, (*findings, *_findings(found)))


def excited_inertia(found: ExcitedLaw, *, unit: str) -> tuple[Estimate, list[Finding]]:
    """The inertia alone, for comparison with other sources."""
    value, stderr = found.values["inertia"], found.stderr("inertia")
    if value > quantile(found.dof) * stderr:
        return _estimate(found, "inertia", unit), []
    text = (
        f"the inertia from excitation, {value:.3g} +- {stderr:.2g} {unit}, is not told from 0: the motion "
        "hardly accelerates. Record one that does."
    )
    finding = Finding("E-BOUND", Severity.WITHHOLD, text)
    return Estimate(None, unit, withheld=f"E-BOUND: {text}"), [finding]


def _estimate(found: ExcitedLaw, name: str, unit: str, *, least: float | None = 0.0) -> Estimate:
    value, stderr = found.values[name], found.stderr(name)
    interval = symmetric(value, stderr, found.dof, least=least)
    return Estimate(value, unit, stderr, (interval.low, interval.high))


def _covariance(found: ExcitedLaw) -> Covariance:
    """Joint covariance by the names of robot.json, F_s = F_c + dF; the terms that no robot has left out."""
    names, rows = [], []
    for k, name in enumerate(found.names):
        if name.startswith("gravity"):
            continue
        row = np.zeros(len(found.names))
        row[k] = 1.0
        prefix, _, parameter = name.partition("_") if found.law == "each" else ("mean", "", name)
        if name in {"inertia", "torque_offset"}:
            names.append(name)
        else:
            if parameter == "stribeck_torque":
                row[found.names.index(name.replace("stribeck", "coulomb"))] = 1.0
                parameter = "static_torque"
            names.append(f"{prefix}.{parameter}")
        rows.append(row)
    transform = np.array(rows)
    return Covariance(tuple(names), np.asarray(transform @ found.covariance @ transform.T))


def _curve(
    found: ExcitedLaw, prefix: str, key: str, covariance: Covariance, *, units: Mapping[str, str]
) -> tuple[dict[str, Estimate], list[Finding]]:
    estimates: dict[str, Estimate] = {}
    findings: list[Finding] = []
    for name in ("coulomb_torque", "viscous_damping"):
        estimates[name] = _estimate(found, prefix + name, units[name])
        if not found.values[prefix + name] > 0:
            text = (
                f"{key}: {name} came out at {found.values[prefix + name]:.3g}: friction would drive the "
                "link. Record more and faster speeds, and look for drift."
            )
            estimates[name] = Estimate(None, units[name], withheld=f"E-BOUND: {text}")
            findings.append(Finding("E-BOUND", Severity.WITHHOLD, text))
    if found.whole is None:
        code, text = why_no_stribeck(found, key)
        for name in STRIBECK_PART:
            estimates[name] = Estimate(None, units[name], withheld=f"{code}: {text}")
        return estimates, [*findings, Finding(code, Severity.WITHHOLD, text)]
    static = found.values[f"{prefix}coulomb_torque"] + found.values[f"{prefix}stribeck_torque"]
    k = covariance.names.index(f"{key}.static_torque")
    stderr = float(np.sqrt(covariance.matrix[k, k]))
    ends = symmetric(static, stderr, found.dof, least=0.0)
    estimates["static_torque"] = Estimate(static, units["static_torque"], stderr, (ends.low, ends.high))
    estimates["stribeck_velocity"] = _estimate(
        found, f"{prefix}stribeck_velocity", units["stribeck_velocity"]
    )
    estimates["stribeck_shape"] = Estimate(1.0, units["stribeck_shape"], fixed=True)
    return estimates, findings


def why_no_stribeck(found: ExcitedLaw, key: str) -> tuple[str, str]:
    """Code and sentence for a Stribeck effect that the motion does not identify."""
    remedy = (
        "Record constant speeds in ratio from slow to fast and torque ramps from rest if one is expected."
    )
    if found.refined is None:
        return (
            "E-LOWSPEED",
            f"{key}: the motion is too short to look for a Stribeck effect, so F_s, v_s and beta have no "
            f"basis. {remedy}",
        )
    return (
        "E-NOSTRIBECK",
        f"{key}: no Stribeck effect is identifiable in this motion: F_s - F_c is not told from 0 together "
        f"with a velocity over which it fades, so F_s, v_s and beta have no basis. {remedy}",
    )


def _mean(
    name: str,
    curves: Mapping[Direction, Mapping[str, Estimate]],
    covariance: Covariance,
    dof: int,
    unit: str,
) -> Estimate:
    pair = [curves[direction][name] for direction in DIRECTIONS]
    values = [estimate.value for estimate in pair if estimate.value is not None]
    if len(values) < 2:
        return Estimate(None, unit, withheld="; ".join(e.withheld for e in pair if e.withheld))
    value = 0.5 * sum(values)
    if any(estimate.fixed for estimate in pair):
        return Estimate(value, unit, fixed=True)
    where = [covariance.names.index(f"{direction}.{name}") for direction in DIRECTIONS]
    stderr = 0.5 * float(np.sqrt(covariance.matrix[np.ix_(where, where)].sum()))
    ends = symmetric(value, stderr, dof, least=0.0)
    return Estimate(value, unit, stderr, (ends.low, ends.high))


def _kept(
    covariance: Covariance, inertia: Estimate, curves: Mapping[str, Mapping[str, Estimate]]
) -> Covariance:
    """The covariance of what is not withheld."""
    there = []
    for name in covariance.names:
        key, _, parameter = name.partition(".")
        own = curves[key][parameter].value if parameter else None
        there.append(name == "torque_offset" or (own if parameter else inertia.value) is not None)
    where = np.flatnonzero(there)
    names = tuple(covariance.names[k] for k in where.tolist())
    return Covariance(names, covariance.matrix[np.ix_(where, where)])


def _findings(found: ExcitedLaw) -> list[Finding]:
    findings = [*_law_findings(found), *_bend_findings(found)]
    timing = found.timing
    if not timing.consistent and np.isfinite(timing.stderr):
        text = (
            f"the torque seems to act {1e3 * timing.seen:.3g} ms after its stamp in the whole band and "
            f"otherwise in its lower half, which no delay does: it is taken as {timing.timing}. A delay "
            "unknown by half a sample bends the viscous damping; log the torque with its own stamp."
        )
        findings.append(Finding("E-LACKOFFIT", Severity.WARN, text))
    if timing.delay:
        text = (
            f"the torque acts {1e3 * timing.seen:.3g} +- {1e3 * timing.stderr:.2g} ms after its stamp, which "
            "is neither at it nor held from it; the fit takes the delay into account. A delay that is not "
            "the same throughout bends the viscous damping."
        )
        findings.append(Finding("E-CLOCK", Severity.WARN, text))
    if found.terms.gravity:
        size = float(np.hypot(found.values["gravity_sine"], found.values["gravity_cosine"]))
        text = (
            f"a torque of {size:.3g} goes with the sine of the position: gravity, or an unbalance. The fit "
            "takes it into account; the law of the robot does not hold it."
        )
        findings.append(Finding("E-POSITION", Severity.WARN, text))
    return findings


def _law_findings(found: ExcitedLaw) -> list[Finding]:
    findings = []
    if found.linear.relative_error > POOR and found.whole is None:
        text = (
            f"the law leaves {100 * found.linear.relative_error:.0f} % of the torque unexplained: intervals "
            "are conditional on the law. Try --per-direction where friction may differ between the "
            "directions, and look for a flexible joint, a changing load, or friction that goes with position "
            "or temperature."
        )
        findings.append(Finding("E-LACKOFFIT", Severity.WARN, text))
    return findings


def _bend_findings(found: ExcitedLaw) -> list[Finding]:
    comparison = found.comparison
    if comparison is None or not comparison.bent:
        return []
    worst = int(np.argmax(np.abs(comparison.distance)))
    text = (
        f"least squares and instruments from the reference differ by {abs(comparison.distance[worst]):.1f} "
        f"errors of the difference in {comparison.fit.names[worst]}: noise comes back through the loop, or "
        "the reference is not what the link follows. The interval holds both. Use a finer encoder or a "
        "larger motion."
    )
    return [Finding("E-SPEEDERR", Severity.WARN, text)]

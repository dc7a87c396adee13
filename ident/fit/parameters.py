"""From the fit's own parameters to those of the law, with intervals, covariance, and what is withheld."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from data.findings import Finding
from data.recording import Axis, FloatArray
from ident.estimate import CURVE_PARAMETERS, Covariance, Estimate, ProfilePoints
from ident.fit.confidence import Interval, quantile
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import COMMON, DIRECTIONS, Direction, LawName
from ident.fit.profiles import Combination, Profile, law_combinations, profiles
from ident.fit.small_samples import certainty
from ident.fit.unseen_effect import with_unseen_effect
from ident.fit.withholding import withheld

UNITS: Mapping[Axis, Mapping[str, str]] = {
    "rotary": {
        "inertia": "kg m^2",
        "static_torque": "N m",
        "coulomb_torque": "N m",
        "stribeck_velocity": "rad/s",
        "stribeck_shape": "-",
        "viscous_damping": "N m s/rad",
        "torque_offset": "N m",
    },
    "linear": {
        "inertia": "kg",
        "static_torque": "N",
        "coulomb_torque": "N",
        "stribeck_velocity": "m/s",
        "stribeck_shape": "-",
        "viscous_damping": "N s/m",
        "torque_offset": "N",
    },
}
ONE_LAW = "one law for both directions was fitted: see mean"
NO_OFFSET = (
    "E-OFFSET: no torque-driven experiment separates a constant offset from an asymmetry of friction; the "
    "laws are those of the torque as logged. A zero-torque reference would tell, or --one-law, if one law "
    "holds for both directions."
)
NO_INERTIA = "E-BOUND: the inertia ended at its bound 0; record a multisine."
_ONE_WAY = "E-DIRECTION: a torque offset shows only as a difference between two directions."


@dataclass(frozen=True)
class Parameters:
    """The parameters of the law of both directions and their mean."""

    fit: FrictionFit  # whose they are
    inertia: Estimate
    curves: Mapping[Direction, Mapping[str, Estimate]]
    mean: Mapping[str, Estimate]
    torque_offset: Estimate
    covariance: Covariance
    profiles: Mapping[str, ProfilePoints]  # 'inertia', 'positive.static_torque', ..., those of `mean` too
    findings: tuple[Finding, ...]


def parameters(
    data: FitData,
    fit: FrictionFit,
    *,
    axis: Axis,
    missing: Mapping[Direction, str] | None = None,
) -> Parameters:
    """Values, errors and intervals in the law's own parameters; `missing`: why a direction has no law."""
    known = certainty(data, fit)

    def height(combination: Combination) -> float:
        own = np.array([combination.get(name, 0.0) for name in fit.free])
        return quantile(known.dof(own)) ** 2 * known.inflation(own)

    wanted = combinations(fit)
    better, found = profiles(data, fit, wanted, height=height)
    found = with_unseen_effect(data, found, wanted, height=height)
    if better is not fit:
        fit, known = better, certainty(data, better)
    names, matrix, stderr = _physical_covariance(fit, known.covariance)
    units = UNITS[axis]
    findings: list[Finding] = []
    laws: dict[LawName, Mapping[str, Estimate]] = {}
    for law in data.model.laws:
        laws[law], own = _curve(data, fit, law, stderr=stderr, found=found, units=units)
        findings += own
    curves: dict[Direction, Mapping[str, Estimate]] = {}
    for direction in DIRECTIONS:
        why = ONE_LAW if data.model.has_offset else (missing or {}).get(direction, "")
        lacking = {name: Estimate(None, units[name], withheld=why) for name in CURVE_PARAMETERS}
        curves[direction] = laws.get(direction, lacking)
    mean = laws.get("mean") or {
        name: _mean(name, curves, (names, matrix), found, unit=units[name]) for name in CURVE_PARAMETERS
    }
    return Parameters(
        fit=fit,
        inertia=_inertia(data, fit, stderr, found, unit=units["inertia"]),
        curves=curves,
        mean=mean,
        torque_offset=_offset(fit, stderr, found, unit=units["torque_offset"]),
        covariance=Covariance(names, matrix),
        profiles={name: own.points for name, own in found.items() if not name.endswith("stribeck_torque")},
        findings=tuple(findings),
    )


def combinations(fit: FrictionFit) -> dict[str, Combination]:
    """Every parameter that has a finite error, and the means of two directions, as the fit has them."""
    felt = {name for name, gone in zip(fit.free, np.isinf(np.diag(fit.covariance)), strict=True) if not gone}
    wanted: dict[str, Combination] = {name: {name: 1.0} for name in COMMON}
    own = {law: law_combinations(law) for law in fit.model.laws}
    for law, parts in own.items():
        wanted |= {f"{law}.{name}": combination for name, combination in parts.items()}
    if set(own) == set(DIRECTIONS):
        for name in CURVE_PARAMETERS:
            both = {**own["positive"][name], **own["negative"][name]}
            wanted[f"mean.{name}"] = dict.fromkeys(both, 0.5)
    return {name: combination for name, combination in wanted.items() if felt.issuperset(combination)}


def _physical_covariance(
    fit: FrictionFit, covariance: FloatArray
) -> tuple[tuple[str, ...], FloatArray, dict[str, float]]:
    """Names 'inertia', 'positive.static_torque', ..., their covariance with F_s = F_c + dF, and standard
    errors, from the covariance of the free parameters.

    A parameter that the data do not feel has an infinite error and no place in the covariance.
    """
    names = []
    transform = np.eye(len(fit.free))
    for row, name in enumerate(fit.free):
        if name in COMMON:
            names.append(name)
            continue
        law, _, parameter = name.partition("_")
        if parameter == "stribeck_torque":
            transform[row, fit.free.index(f"{law}_coulomb_torque")] = 1.0
            parameter = "static_torque"
        names.append(f"{law}.{parameter}")
    lost = np.isinf(np.diag(covariance))
    matrix = np.asarray(transform @ np.where(np.isinf(covariance), 0.0, covariance) @ transform.T)
    spread = np.where(lost, np.inf, np.sqrt(np.diag(matrix)))
    kept = tuple(name for name, gone in zip(names, lost, strict=True) if not gone)
    return kept, matrix[np.ix_(~lost, ~lost)], dict(zip(names, map(float, spread), strict=True))


def _curve(
    data: FitData,
    fit: FrictionFit,
    law: LawName,
    *,
    stderr: Mapping[str, float],
    found: Mapping[str, Profile],
    units: Mapping[str, str],
) -> tuple[Mapping[str, Estimate], tuple[Finding, ...]]:
    values = law_values(fit.values, law)
    own = {name: stderr[f"{law}.{name}"] for name in values if f"{law}.{name}" in stderr}
    interval = {name: _interval(found, f"{law}.{name}") for name in (*own, "stribeck_torque")}
    kept = withheld(data, fit, law, stderr=own, interval=interval)
    estimates = {}
    for name in CURVE_PARAMETERS:
        if name in kept.reasons:
            estimates[name] = Estimate(None, units[name], withheld=kept.reasons[name])
        elif name not in own:
            estimates[name] = Estimate(values[name], units[name], fixed=True)
        else:
            ends = (interval[name].low, interval[name].high)
            estimates[name] = Estimate(values[name], units[name], float(own[name]), ends)
    return estimates, kept.findings


def law_values(values: Mapping[str, float], law: LawName) -> dict[str, float]:
    """The parameters of a law by name of `CURVE_PARAMETERS`, without a torque offset."""
    own = {name: values[f"{law}_{name}"] for name in CURVE_PARAMETERS if name != "static_torque"}
    return {"static_torque": values[f"{law}_coulomb_torque"] + values[f"{law}_stribeck_torque"], **own}


def _interval(found: Mapping[str, Profile], name: str) -> Interval:
    """The interval of a profile; open both ways where there is none."""
    return found[name].interval if name in found else Interval(None, None)


def _mean(
    name: str,
    curves: Mapping[Direction, Mapping[str, Estimate]],
    covariance: tuple[tuple[str, ...], FloatArray],
    found: Mapping[str, Profile],
    *,
    unit: str,
) -> Estimate:
    """Mean of the two directions: of what Table 1 calls the symmetric model."""
    pair = [curves[direction][name] for direction in DIRECTIONS]
    values = [estimate.value for estimate in pair if estimate.value is not None]
    if len(values) < 2:
        lacking = "; ".join(estimate.withheld for estimate in pair if estimate.withheld)
        return Estimate(None, unit, withheld=lacking)
    value = 0.5 * sum(values)
    if all(estimate.fixed for estimate in pair):
        return Estimate(value, unit, fixed=True)
    names, matrix = covariance
    where = [names.index(own) for d in DIRECTIONS if (own := f"{d}.{name}") in names]
    stderr = 0.5 * float(np.sqrt(matrix[np.ix_(where, where)].sum()))
    ends = _interval(found, f"mean.{name}")
    if any(estimate.fixed for estimate in pair):
        (free,) = (estimate for estimate in pair if not estimate.fixed)
        ends = _shifted(free, value)
    return Estimate(value, unit, stderr, (ends.low, ends.high))


def _shifted(free: Estimate, mean: float) -> Interval:
    """The interval of the mean of a free value and one that is fixed."""
    low, high = free.interval95 or (None, None)
    ends = [None if end is None else mean + 0.5 * (end - (free.value or 0.0)) for end in (low, high)]
    return Interval(ends[0], ends[1])


def _inertia(
    data: FitData,
    fit: FrictionFit,
    stderr: Mapping[str, float],
    found: Mapping[str, Profile],
    *,
    unit: str,
) -> Estimate:
    if not data.has_inertia:
        return Estimate(
            None,
            unit,
            withheld="E-TESTS: neither motion after a breakaway nor a frequency response was recorded, and "
            "steady "
            "runs do not hold the inertia. Record ramps until the link runs, or a multisine about a bias "
            "speed.",
        )
    value, error = fit.values["inertia"], float(stderr["inertia"])
    if not (value > 0 and np.isfinite(error)):
        return Estimate(None, unit, withheld=NO_INERTIA)
    ends = _interval(found, "inertia")
    return Estimate(value, unit, error, (ends.low, ends.high))


def _offset(
    fit: FrictionFit, stderr: Mapping[str, float], found: Mapping[str, Profile], *, unit: str
) -> Estimate:
    if not fit.model.has_offset:
        both = len(fit.model.laws) == len(DIRECTIONS)
        return Estimate(None, unit, withheld=NO_OFFSET if both else _ONE_WAY)
    ends = _interval(found, "torque_offset")
    return Estimate(fit.values["torque_offset"], unit, stderr["torque_offset"], (ends.low, ends.high))

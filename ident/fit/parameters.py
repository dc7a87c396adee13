"""From the fit's own parameters to those of the law, with intervals, covariance, and what is withheld."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from data.findings import Finding
from data.recording import Axis, FloatArray
from ident.estimate import CURVE_PARAMETERS, Covariance, Estimate
from ident.fit.confidence import Interval, profiled, quantile, symmetric
from ident.fit.friction_fit import DIRECTIONS, Direction, FitData, FrictionFit, residuals
from ident.fit.small_samples import certainty
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
PROFILED = (
    "static_torque",
    "coulomb_torque",
    "viscous_damping",
    "stribeck_velocity",
    "stribeck_shape",
)  # chi-square is a poor parabola in these


@dataclass(frozen=True)
class Parameters:
    """The parameters of the law of both directions and their mean."""

    inertia: Estimate
    curves: Mapping[Direction, Mapping[str, Estimate]]
    mean: Mapping[str, Estimate]
    covariance: Covariance
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class _Physical:
    """Errors in the law's own parameters 'inertia', 'positive.static_torque', ... with F_s = F_c + dF.

    A parameter that the data do not feel has an infinite error and no place in the covariance.
    """

    stderr: Mapping[str, float]
    dof: Mapping[str, float]
    inflation: Mapping[str, float]  # of the variance, over what chi-square says
    kept: tuple[str, ...]
    covariance: FloatArray  # (k, k) of those kept


def parameters(data: FitData, fit: FrictionFit, *, axis: Axis) -> Parameters:
    """Values, errors and intervals in the law's own parameters."""
    errors = _physical(data, fit)
    units = UNITS[axis]
    findings: list[Finding] = []
    curves: dict[Direction, Mapping[str, Estimate]] = {}
    for direction in DIRECTIONS:
        curve, own = _curve(data, fit, direction, errors=errors, units=units)
        curves[direction] = curve
        findings += own
    mean = {name: _mean(name, curves, errors, unit=units[name]) for name in CURVE_PARAMETERS}
    return Parameters(
        inertia=_inertia(data, fit, errors, unit=units["inertia"]),
        curves=curves,
        mean=mean,
        covariance=Covariance(errors.kept, errors.covariance),
        findings=tuple(findings),
    )


def _physical(data: FitData, fit: FrictionFit) -> _Physical:
    names = []
    transform = np.eye(len(fit.free))
    for row, name in enumerate(fit.free):
        direction, _, parameter = name.partition("_")
        if parameter == "stribeck_torque":
            transform[row, fit.free.index(f"{direction}_coulomb_torque")] = 1.0
            parameter = "static_torque"
        names.append(f"{direction}.{parameter}" if parameter else name)
    lost = np.isinf(np.diag(fit.covariance))
    found = certainty(data, fit)
    matrix = np.asarray(transform @ np.where(np.isinf(found.covariance), 0.0, found.covariance) @ transform.T)
    spread = np.where(lost, np.inf, np.sqrt(np.diag(matrix)))
    dof = [1.0 if gone else found.dof(row) for row, gone in zip(transform, lost, strict=True)]
    inflation = [1.0 if gone else found.inflation(row) for row, gone in zip(transform, lost, strict=True)]
    return _Physical(
        dict(zip(names, spread.tolist(), strict=True)),
        dict(zip(names, dof, strict=True)),
        dict(zip(names, inflation, strict=True)),
        tuple(name for name, gone in zip(names, lost, strict=True) if not gone),
        matrix[np.ix_(~lost, ~lost)],
    )


def _curve(
    data: FitData,
    fit: FrictionFit,
    direction: Direction,
    *,
    errors: _Physical,
    units: Mapping[str, str],
) -> tuple[Mapping[str, Estimate], tuple[Finding, ...]]:
    coulomb, stribeck, velocity, damping, shape = fit.law(direction)
    values = {
        "static_torque": coulomb + stribeck,
        "coulomb_torque": coulomb,
        "stribeck_velocity": velocity,
        "stribeck_shape": shape,
        "viscous_damping": damping,
    }
    known = {name: f"{direction}.{name}" for name in values if f"{direction}.{name}" in errors.stderr}
    own = {name: errors.stderr[key] for name, key in known.items()}
    dof = {name: errors.dof[key] for name, key in known.items()}
    interval = {name: symmetric(values[name], error, dof[name], least=0.0) for name, error in own.items()}
    position = fit.free.index(f"{direction}_stribeck_torque")
    interval["stribeck_torque"] = symmetric(
        stribeck, float(np.sqrt(fit.covariance[position, position])), dof["static_torque"]
    )
    height = {name: quantile(dof[name]) ** 2 * errors.inflation[key] for name, key in known.items()}
    for name in PROFILED:
        if name in own and np.isfinite(own[name]) and stribeck > 0:
            interval[name] = _profile(data, fit, direction, name, stderr=own[name], height=height[name])
    kept = withheld(data, fit, direction, stderr=own, interval=interval)
    estimates = {}
    for name, value in values.items():
        if name in kept.reasons:
            estimates[name] = Estimate(None, units[name], withheld=kept.reasons[name])
        elif name not in own:
            estimates[name] = Estimate(value, units[name], fixed=True)
        else:
            ends = (interval[name].low, interval[name].high)
            estimates[name] = Estimate(value, units[name], float(own[name]), ends)
    return estimates, kept.findings


def _profile(
    data: FitData, fit: FrictionFit, direction: Direction, name: str, *, stderr: float, height: float
) -> Interval:
    """Profile of one parameter; for F_s the fit is written in F_c and F_s - F_c all the same."""
    free = list(fit.free)
    static = name == "static_torque"
    index = free.index(f"{direction}_{'stribeck_torque' if static else name}")
    coulomb = free.index(f"{direction}_coulomb_torque")

    def own(x: FloatArray) -> FloatArray:
        values = dict(fit.values) | dict(zip(free, x, strict=True))
        if static:
            values[free[index]] = max(x[index] - x[coulomb], 0.0)
        return residuals(data, values)

    best = np.array([fit.values[key] for key in free])
    if static:
        best[index] += best[coulomb]
    least = np.array([0.05 if key.endswith("shape") else 0.0 for key in free])
    least = np.where([key.endswith("velocity") for key in free], 1e-9 * best, least)
    return profiled(own, best, index, stderr=stderr, height=height, least=least)


def _mean(
    name: str,
    curves: Mapping[Direction, Mapping[str, Estimate]],
    errors: _Physical,
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
    if any(estimate.fixed for estimate in pair):
        return Estimate(value, unit, fixed=True)
    keys = [f"{direction}.{name}" for direction in DIRECTIONS]
    where = [errors.kept.index(key) for key in keys]
    stderr = 0.5 * float(np.sqrt(errors.covariance[np.ix_(where, where)].sum()))
    # Each direction's variance has its own degrees of freedom (Satterthwaite 1946).
    parts = np.array([0.25 * errors.stderr[key] ** 2 for key in keys])
    dof = float(parts.sum() ** 2 / np.sum(parts**2 / np.array([errors.dof[key] for key in keys])))
    ends = symmetric(value, stderr, dof, least=0.0)
    ends = _opened(ends, pair)
    return Estimate(value, unit, stderr, (ends.low, ends.high))


def _opened(ends: Interval, pair: list[Estimate]) -> Interval:
    """An end that either direction leaves open is open in the mean."""
    for estimate in pair:
        low, high = estimate.interval95 or (None, None)
        ends = replace(
            ends, low=ends.low if low is not None else None, high=ends.high if high is not None else None
        )
    return ends


def _inertia(data: FitData, fit: FrictionFit, errors: _Physical, *, unit: str) -> Estimate:
    if not data.has_inertia:
        return Estimate(
            None,
            unit,
            withheld="E-TESTS: neither motion after a breakaway nor a frequency response was recorded, and "
            "steady "
            "runs do not hold the inertia. Record ramps until the link runs, or a multisine about a bias "
            "speed.",
        )
    value, error = fit.values["inertia"], errors.stderr["inertia"]
    if not (value > 0 and np.isfinite(error)):
        return Estimate(None, unit, withheld="E-BOUND: the inertia ended at its bound 0; record a multisine.")
    reach = quantile(errors.dof["inertia"]) * error
    return Estimate(value, unit, error, (max(value - reach, 0.0), value + reach))

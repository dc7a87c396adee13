"""Bootstrap refits of a friction map, compiled, beside lmfit on the same resamples.

A map of 40 points, 20 speeds a direction, with a law for each direction. lmfit refits some of the resamples,
from the same start and with a residual in numpy, by its fastest method (`leastsq`, MINPACK); its time is per
refit. The difference is the largest of any parameter, in standard errors, where lmfit has converged.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import lmfit
import numpy as np
from numpy.typing import NDArray

from benchmarks.rows import Row, against, figure, in_turns
from data.recording import FloatArray
from ident.fit.bootstrap import bootstrap, resample
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, fit_friction, friction_torque
from ident.fit.law_model import EACH, SIGN
from ident.model.published import asymmetric_robot

REFITS: Final = 1000
BY_LMFIT: Final = 50  # of them
SPEEDS: Final = 20  # a direction
ERROR: Final = 2e-3  # [N m]
ROUNDS: Final = 5
TARGET: Final = 100.0  # times faster


def rows(quick: bool) -> list[Row]:
    """Time of 1000 bootstrap refits, and how far they lie from lmfit's."""
    data = _map(np.random.default_rng(1))
    fit = fit_friction(data)
    some = BY_LMFIT // 5 if quick else BY_LMFIT
    counts = resample(data, REFITS, np.random.default_rng(2)).steady

    def ours() -> FloatArray:
        return bootstrap(data, fit, REFITS, np.random.default_rng(2)).values

    def peer() -> FloatArray:
        return np.array([_by_lmfit(data, fit, counts[draw]) for draw in range(some)])

    taken = in_turns((ours, peer), rounds=1 if quick else ROUNDS, repeats=(3, 1))
    theirs = taken[1] * REFITS / some
    error = np.sqrt(np.diag(fit.covariance))
    apart = np.max(np.abs(ours()[:some] - peer()) / error, axis=1)
    row = against(
        f"bootstrap, {REFITS} refits of a {2 * SPEEDS}-point map",
        "lmfit",
        1e3 * taken[0],
        1e3 * theirs,
        error_ours=float(np.max(apart)),
        error_peer=0.0,
        unit="ms",
    )
    return [row, figure("bootstrap, times faster than lmfit", theirs / taken[0], TARGET, "x")]


def _map(generator: np.random.Generator) -> FitData:
    friction = asymmetric_robot().friction
    once = np.geomspace(0.005, 2.0, SPEEDS)
    torque = np.concatenate(
        [np.asarray(curve.total(once)) for curve in (friction.positive, friction.negative)]
    )
    nothing = np.zeros(0)
    return FitData(
        model=EACH,
        run_direction=np.repeat([SIGN["positive"], SIGN["negative"]], SPEEDS),
        speed=np.tile(once, 2),
        torque=torque + ERROR * generator.standard_normal(torque.size),
        acceleration=np.zeros(torque.size),
        run_stderr=np.full(torque.size, ERROR),
        start_direction=np.zeros(0, dtype=np.int64),
        start_torque=nothing,
        start_stderr=nothing,
        momenta=(),
        whitening=(),
        inertia=None,
    )


def _by_lmfit(data: FitData, fit: FrictionFit, counts: NDArray[np.int64]) -> FloatArray:
    """The free parameters (p,) of one resample."""
    drawn = np.repeat(np.arange(data.torque.size), counts)
    parameters = lmfit.Parameters()
    for name in fit.free:
        parameters.add(name, value=fit.values[name], min=0.0)
    objective = _objective(data, drawn)
    result = lmfit.minimize(
        objective, parameters, method="leastsq", scale_covar=False, xtol=1e-10, ftol=1e-10
    )
    return np.array([float(result.params[name].value) for name in fit.free])


def _objective(data: FitData, drawn: NDArray[np.int64]) -> Callable[[lmfit.Parameters], FloatArray]:
    """Residuals of a resample, in standard errors."""
    parts = []
    for direction, sign in SIGN.items():
        own = drawn[data.run_direction[drawn] == sign]
        parts.append((direction, data.speed[own], data.torque[own], data.run_stderr[own]))

    def residual(current: lmfit.Parameters) -> FloatArray:
        values = current.valuesdict()
        found = []
        for direction, speed, torque, stderr in parts:
            names = ("coulomb_torque", "stribeck_torque", "stribeck_velocity", "viscous_damping")
            coulomb, stribeck, velocity, damping = (values[f"{direction}_{name}"] for name in names)
            predicted = friction_torque((coulomb, stribeck, velocity, damping, 1.0), speed)
            found.append((torque - predicted) / stderr)
        return np.concatenate(found)

    return residual

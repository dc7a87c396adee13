r"""Output-error refinement: the whole law from simulated motion against measured motion.

The simulated link under the logged torque drifts away from the measured one whatever its law, since errors
of the torque are integrated twice. It is therefore started afresh many times: windows of a few periods of
the band's cut-off, each from its own position and speed, which are free (multiple shooting with the initial
conditions projected out: to first order they shift the window's positions by 1 and by dq/dv_0). Within a
window the response is exact between samples, rest included, so that reversals, sticking and what happens at
speeds of the Stribeck range count as they are.

The start is the inverse dynamics' linear law; lmfit does the fit. Positions within a window err together
(the torque's noise is integrated), so that a window's score, and not a sample's, is the datum behind the
errors (`ident.excitation.robust_errors`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import lmfit
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

from data.recording import FloatArray
from ident.excitation.filtering import Equation, Timing, acting
from ident.excitation.inverse_dynamics import Law, LinearFit
from ident.excitation.robust_errors import long_run_covariance
from ident.response import advance_with_ripple
from ident.simulation.compiled import owning

LENGTH: Final = 4.0  # of a window, in periods of the cut-off
MOST: Final = 20_000  # samples simulated in all
POINTS: Final = 24  # positions compared in a window
FEWEST: Final = 12  # windows
PARTS: Final = ("viscous_damping", "coulomb_torque", "stribeck_torque", "stribeck_velocity")
SLOWEST: Final = (0.01, 0.04, 0.15)  # Stribeck velocities tried as starts, in parts of the fastest speed
SEEN: Final = 3.5  # standard errors of dF above zero: the best of many v_s reaches 2.5 by chance
LOOSE: Final = 0.25  # relative standard error beyond which v_s is not told
TRIAL: Final = 60  # evaluations of a start


@dataclass(frozen=True)
class Windows:
    """w windows of k samples, c of which are compared."""

    start: FloatArray  # (w, 2) position [rad] and speed [rad/s]
    torque: FloatArray  # (w, k) held from sample to sample [N m]
    position: FloatArray  # (w, c) measured [rad]
    compared: NDArray[np.int64]  # (c,) sample numbers
    period: float  # [s]
    nudge: float  # [rad/s] change of the initial speed that gives dq/dv_0

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.torque.shape[1] * self.period)


@dataclass(frozen=True)
class OutputError:
    """The refined law: names as of the inverse dynamics, with stribeck_torque (dF) and stribeck_velocity."""

    values: Mapping[str, float]
    names: tuple[str, ...]  # free parameters
    covariance: FloatArray  # (p, p) [SI], from the windows' scores
    dof: int
    error: float  # root mean square of position, predicted over a window [rad]
    report: str

    def value(self, name: str) -> float:
        """A parameter."""
        return self.values[name]

    def stderr(self, name: str) -> float:
        """Robust standard error of a free parameter."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))


def windows(
    equations: Sequence[Equation], *, timing: Timing, delay: float, length: float = LENGTH
) -> Windows | None:
    """Windows over all spans, evenly spread where there are too many; None where there are too few."""
    first = equations[0]
    h = first.span.period
    size = max(int(length / (first.cutoff * h)), 8)
    begins = [
        (one, k)
        for one in equations
        for k in range(0, one.span.position.size - size, size)
        if not one.span.saturated[k : k + size].any()
    ]
    begins = begins[:: max(1, -(-len(begins) * size // MOST))]
    if len(begins) < FEWEST:
        return None
    compared = np.unique(np.linspace(0, size, min(POINTS, size + 1)).astype(int))
    torques = {id(one): _held(one.span.torque, h, timing=timing, delay=delay) for one in equations}
    speeds = np.concatenate([one.motion.rate for one in equations])
    return Windows(
        start=np.array([(one.span.position[k], one.motion.rate[k]) for one, k in begins]),
        torque=np.array([torques[id(one)][k : k + size] for one, k in begins]),
        position=np.array([one.span.position[k + compared] for one, k in begins]),
        compared=compared.astype(np.int64),
        period=h,
        nudge=1e-3 * float(np.std(speeds)),
    )


def _held(torque: FloatArray, period: float, *, timing: Timing, delay: float) -> FloatArray:
    """What acts from each sample to the next (n,)."""
    if timing == "held":
        return acting(torque, period, timing="measured", delay=delay)
    later = acting(torque, period, timing="measured", delay=delay)
    return np.asarray(0.5 * (later + np.append(later[1:], later[-1])))


def plant_of(values: Mapping[str, float], law: Law) -> tuple[FloatArray, float]:
    """The plant as kernels see it (14,), and the offset [N m]."""
    plant = np.zeros(14)
    plant[0] = values["inertia"]
    for k, direction in ((1, "positive_"), (6, "negative_")):
        prefix = "" if law == "one" else direction
        damping, coulomb, stribeck, velocity = (values.get(prefix + part, 0.0) for part in PARTS)
        plant[k : k + 5] = (coulomb + stribeck, coulomb, velocity or 1.0, damping, 1.0)
    sine, cosine = values.get("gravity_sine", 0.0), values.get("gravity_cosine", 0.0)
    plant[11:] = (float(np.hypot(sine, cosine)), 1.0, float(np.arctan2(-cosine, -sine)))
    return plant, values.get("torque_offset", 0.0)


def starting_slope(data: Windows, values: Mapping[str, float], law: Law) -> FloatArray:
    """dq/dv_0 at the positions compared (w, c) [s], less its mean over each window, of unit norm or zero."""
    plant, offset = plant_of(values, law)
    pair = [
        _simulated(
            data.start + np.array([0.0, nudge]), data.torque - offset, data.period, plant, data.compared
        )
        for nudge in (0.0, data.nudge)
    ]
    slope = pair[1] - pair[0]
    slope = slope - slope.mean(axis=1, keepdims=True)
    norm = np.linalg.norm(slope, axis=1, keepdims=True)
    return np.asarray(np.divide(slope, norm, out=np.zeros_like(slope), where=norm > 0))


def residual(data: Windows, values: Mapping[str, float], law: Law, slope: FloatArray) -> FloatArray:
    """Measured less simulated positions (w, c) [rad], the initial conditions projected out along `slope`."""
    plant, offset = plant_of(values, law)
    left = data.position - _simulated(data.start, data.torque - offset, data.period, plant, data.compared)
    left = left - left.mean(axis=1, keepdims=True)
    return np.asarray(left - np.sum(slope * left, axis=1, keepdims=True) * slope)


@owning
def _simulated(
    start: FloatArray, torque: FloatArray, period: float, plant: FloatArray, compared: NDArray[np.int64]
) -> FloatArray:
    positions = np.empty((start.shape[0], compared.size))
    for w in range(start.shape[0]):
        q, v = start[w, 0], start[w, 1]
        c = 0
        for k in range(torque.shape[1] + 1):
            if k == compared[c]:
                positions[w, c] = q
                c += 1
            if k < torque.shape[1]:
                q, v = advance_with_ripple(q, v, torque[w, k], period, plant)
    return positions


def refine(
    data: Windows, begun: LinearFit, law: Law, *, fastest: float
) -> tuple[OutputError, OutputError | None]:
    """The linear law refined, and the law with a Stribeck effect where one is seen.

    `fastest` is the largest speed [rad/s] of the motion.
    """
    linear = _fit(data, _parameters(begun), law)
    prefixes = ("",) if law == "one" else ("positive_", "negative_")
    trials = []
    for part in SLOWEST:
        start = lmfit.Parameters()
        for name, value in linear.values.items():
            start.add(name, value=value, min=_least(name))
        for prefix in prefixes:
            coulomb = linear.values[f"{prefix}coulomb_torque"]
            start.add(f"{prefix}stribeck_torque", value=0.2 * coulomb, min=0.0)
            start.add(f"{prefix}stribeck_velocity", value=part * fastest, min=1e-4 * fastest, max=fastest)
        trials.append(_minimised(data, start, law, evaluations=TRIAL))
    best = min(trials, key=lambda trial: float(trial.chisqr))
    whole = _fit(data, best.params, law)
    return linear, whole if _is_seen(whole, prefixes) else None


def polish(data: Windows, begun: OutputError, law: Law) -> OutputError:
    """The same law fitted to other windows."""
    start = lmfit.Parameters()
    for name, value in begun.values.items():
        start.add(name, value=value, min=_least(name))
    return _fit(data, start, law)


def _is_seen(whole: OutputError, prefixes: Sequence[str]) -> bool:
    for prefix in prefixes:
        torque, velocity = f"{prefix}stribeck_torque", f"{prefix}stribeck_velocity"
        if not whole.values[torque] > SEEN * whole.stderr(torque):
            return False
        if not whole.stderr(velocity) < LOOSE * whole.values[velocity]:
            return False
    return True


def _least(name: str) -> float:
    signed = name == "torque_offset" or name.startswith("gravity")
    return -np.inf if signed else 0.0


def _parameters(begun: LinearFit) -> lmfit.Parameters:
    parameters = lmfit.Parameters()
    for name, value in zip(begun.names, begun.values.tolist(), strict=True):
        least = _least(name)
        parameters.add(name, value=max(value, 1e-6 * abs(value)) if least == 0.0 else value, min=least)
    return parameters


def _minimised(
    data: Windows, parameters: lmfit.Parameters, law: Law, *, evaluations: int | None = None
) -> lmfit.minimizer.MinimizerResult:
    begun = parameters.valuesdict()
    slope = starting_slope(data, begun, law)
    scale = float(np.sqrt(np.mean(residual(data, begun, law, slope) ** 2))) or 1.0

    def objective(current: lmfit.Parameters) -> FloatArray:
        return residual(data, current.valuesdict(), law, slope).ravel() / scale

    # lmfit's own covariance takes samples for independent; only its report makes use of it.
    with np.errstate(invalid="ignore", over="ignore"):
        return lmfit.minimize(
            objective, parameters, method="least_squares", x_scale="jac", max_nfev=evaluations, diff_step=1e-4
        )


def _fit(data: Windows, start: lmfit.Parameters, law: Law) -> OutputError:
    result = _minimised(data, start, law)
    values = {name: float(value) for name, value in result.params.valuesdict().items()}
    names = tuple(result.var_names)
    slope = starting_slope(data, values, law)
    left = residual(data, values, law, slope)
    jacobian = np.stack([_derivative(data, values, name, law, slope) for name in names], axis=-1)  # (w, c, p)
    flat = jacobian.reshape(-1, len(names))
    norm = np.linalg.norm(flat, axis=0)
    felt = np.where(norm > 0, norm, 1.0)
    scores = np.einsum("wcp,wc->wp", jacobian / felt, left)
    inverse = lstsq(((flat / felt).T @ (flat / felt)), np.eye(len(names)))[0]
    covariance = inverse @ _score_covariance(scores) @ inverse.T / np.outer(felt, felt)
    covariance[norm == 0, norm == 0] = np.inf
    return OutputError(
        values,
        names,
        np.asarray(covariance),
        left.shape[0] - len(names),
        float(np.sqrt(np.mean(left**2))),
        str(lmfit.fit_report(result, show_correl=False)),
    )


def _score_covariance(scores: FloatArray) -> FloatArray:
    """Covariance (p, p) of the sum of the windows' scores (w, p).

    Windows are independent but for slow disturbances; where their long-run variance is larger it stands.
    """
    number, free = scores.shape
    own = scores.T @ scores * number / max(number - free, 1)
    slow = np.diag(long_run_covariance(scores))
    wider = np.sqrt(np.maximum(1.0, slow / np.where(np.diag(own) > 0, np.diag(own), np.inf)))
    return np.asarray(own * np.outer(wider, wider))


def _derivative(
    data: Windows, values: Mapping[str, float], name: str, law: Law, slope: FloatArray
) -> FloatArray:
    step = 1e-4 * (abs(values[name]) or max(abs(value) for value in values.values()))
    ahead, behind = (
        residual(data, {**values, name: values[name] + off}, law, slope) for off in (step, -step)
    )
    return np.asarray((behind - ahead) / (2.0 * step))

r"""The one stage: both directions' laws and the common inertia from all data at once, with lmfit.

The data are magnitudes along the motion:

- steady runs:      u_i - J a_i = F_c + dF exp(-(v_i/v_s)^beta) + b v_i,
- breakaways:       u_i - u' d  = F_c + dF,           d the time from onset to detection,
- momentum:         each window of the motion after breakaway,
- the inertia of the frequency response, as one datum with its error.

All are weighted by real standard errors, so chi-square is what it says and lmfit must not rescale the
covariance (`scale_covar=False`). F_s is fitted as F_c + dF with dF >= 0; F_c >= 0, b >= 0, v_s > 0. For given
v_s and beta the law is linear: a grid of v_s over all speeds, solved by non-negative least squares in each
direction, gives the starts, so that no second minimum goes unseen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

import lmfit
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from data.recording import FloatArray
from ident.evidence.momentum import Momentum

Direction = Literal["positive", "negative"]
DIRECTIONS: Final[tuple[Direction, Direction]] = ("positive", "negative")
SIGN: Final[Mapping[Direction, int]] = {"positive": 1, "negative": -1}

GRID = 40  # Stribeck velocities tried as starts in each direction
STARTS = 8  # polished by the full fit
UNFELT = 1e-3  # of the slowest speed: a Stribeck velocity that no run feels
FELT = 0.1  # change of the residuals, in standard errors, under a parameter's own size: less is not felt
SAME = 1.0  # chi-square above the least, below which another minimum is as good


@dataclass(frozen=True)
class FitData:
    """All that is fitted, as magnitudes along the motion. n steady runs, m breakaways."""

    run_direction: NDArray[np.int64]  # (n,) +1 or -1
    speed: FloatArray  # (n,) [rad/s]
    torque: FloatArray  # (n,) [N m]
    acceleration: FloatArray  # (n,) along the motion [rad/s^2]
    run_stderr: FloatArray  # (n,) [N m]
    start_direction: NDArray[np.int64]  # (m,)
    start_torque: FloatArray  # (m,) less the ramp's rise up to the detection [N m]
    start_stderr: FloatArray  # (m,) [N m]
    momenta: tuple[Momentum, ...]
    whitening: tuple[FloatArray, ...]  # (k, k) for each momentum: the inverse square root of its covariance
    inertia: tuple[float, float] | None  # from the frequency response, with its standard error
    lines: tuple[Direction, ...] = ()  # directions without Stribeck effect: dF raises their breakaways alone
    # (g, n + m): of the variance of each run, then each breakaway, the part that each estimated spread makes
    shares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    motion_dof: float = np.inf  # behind the scale of the momenta's covariance
    inertia_dof: float = np.inf  # behind the standard error of the frequency response's inertia

    @property
    def has_inertia(self) -> bool:
        """Whether anything in the data knows J."""
        return self.inertia is not None or bool(self.momenta)


@dataclass(frozen=True)
class FrictionFit:
    """The best fit. Names are lmfit's: 'inertia', 'positive_stribeck_torque' (dF), ..."""

    values: Mapping[str, float]
    free: tuple[str, ...]  # names of the free parameters, in the order of the covariance
    covariance: FloatArray  # (p, p); infinite variance where the data do not feel a parameter [SI]
    chi_square: float  # [-]
    report: str
    other_minimum: Mapping[str, float] | None  # a second one that fits as well

    def law(self, direction: Direction) -> tuple[float, float, float, float, float]:
        """F_c, dF, v_s, b, beta of a direction."""
        return law_of(self.values, direction)


def law_of(values: Mapping[str, float], direction: Direction) -> tuple[float, float, float, float, float]:
    """F_c, dF, v_s, b, beta of a direction, from parameters by name."""
    return (
        values[f"{direction}_coulomb_torque"],
        values[f"{direction}_stribeck_torque"],
        values[f"{direction}_stribeck_velocity"],
        values[f"{direction}_viscous_damping"],
        values[f"{direction}_stribeck_shape"],
    )


def friction_torque(law: tuple[float, float, float, float, float], speed: FloatArray) -> FloatArray:
    """F(v) + b v [N m] at speeds (n,) >= 0 [rad/s]; law: F_c, dF, v_s, b, beta."""
    coulomb, stribeck, velocity, damping, shape = law
    return np.asarray(coulomb + stribeck * np.exp(-((speed / velocity) ** shape)) + damping * speed)


def residuals(data: FitData, values: Mapping[str, float]) -> FloatArray:
    """Every datum less its prediction, in standard errors."""
    inertia = values["inertia"]
    parts: list[FloatArray] = []
    for direction in DIRECTIONS:
        law = law_of(values, direction)
        own = data.run_direction == SIGN[direction]
        predicted = friction_torque(law, data.speed[own]) + inertia * data.acceleration[own]
        parts.append((data.torque[own] - predicted) / data.run_stderr[own])
        own = data.start_direction == SIGN[direction]
        parts.append((data.start_torque[own] - law[0] - law[1]) / data.start_stderr[own])
        parts += [
            whitening @ motion.residual(inertia, law)
            for motion, whitening in zip(data.momenta, data.whitening, strict=True)
            if motion.direction == SIGN[direction]
        ]
    if data.inertia is not None:
        parts.append(np.array([(inertia - data.inertia[0]) / data.inertia[1]]))
    return np.concatenate(parts)


def in_order(
    data: FitData, *, runs: FloatArray, starts: FloatArray, motion: float = 0.0, inertia: float = 0.0
) -> FloatArray:
    """What belongs to each run (n,) and each breakaway (m,), in the order of `residuals`."""
    parts: list[FloatArray] = []
    for direction in DIRECTIONS:
        parts.append(runs[data.run_direction == SIGN[direction]])
        parts.append(starts[data.start_direction == SIGN[direction]])
        parts += [np.full(one.gain.size, motion) for one in data.momenta if one.direction == SIGN[direction]]
    if data.inertia is not None:
        parts.append(np.array([inertia]))
    return np.concatenate(parts)


def fit_friction(data: FitData, *, free_beta: bool, start: FrictionFit | None = None) -> FrictionFit:
    """Fit everything; from an earlier fit where there is one, else from several starts."""
    starts: Sequence[Mapping[str, float]]
    starts = _starts(data) if start is None else [start.values]
    if free_beta and start is None:
        first = _polish(data, starts[0], free_beta=False)
        starts = [{**dict(first.params.valuesdict()), **beta} for beta in _SHAPES] + list(starts[1:])
    results = [_polish(data, values, free_beta=free_beta) for values in starts]
    results.sort(key=lambda result: float(result.chisqr))
    best = results[0]
    values = {name: float(value) for name, value in best.params.valuesdict().items()}
    free = tuple(best.var_names)
    return FrictionFit(
        values=values,
        free=free,
        covariance=_covariance(data, values, free),
        chi_square=float(best.chisqr),
        report=str(lmfit.fit_report(best, show_correl=True, min_correl=0.3)),
        other_minimum=_other_minimum(results),
    )


_SHAPES: Final = tuple(
    {"positive_stribeck_shape": beta, "negative_stribeck_shape": beta} for beta in (1.0, 0.6, 1.8)
)


def _polish(data: FitData, start: Mapping[str, float], *, free_beta: bool) -> lmfit.minimizer.MinimizerResult:
    """One least-squares fit from one start."""
    parameters = lmfit.Parameters()
    straight = {f"{d}_stribeck_{name}" for d in data.lines for name in ("velocity", "shape")}
    for name, begun in start.items():
        shape = name.endswith("stribeck_shape")
        known = (shape and not free_beta) or (name == "inertia" and not data.has_inertia)
        known = known or name in straight
        value = begun
        if name in straight:
            value = 1.0 if shape else UNFELT * float(np.min(data.speed))
        parameters.add(
            name, value=value, min=0.05 if shape else 0.0, max=8.0 if shape else np.inf, vary=not known
        )

    def objective(current: lmfit.Parameters) -> FloatArray:
        return residuals(data, current.valuesdict())

    # lmfit's own covariance, of which only the report makes use, has no roots where a parameter is not felt.
    with np.errstate(invalid="ignore", over="ignore"):
        return lmfit.minimize(
            objective,
            parameters,
            method="least_squares",
            scale_covar=False,
            x_scale="jac",
            ftol=1e-12,
            xtol=1e-12,
            gtol=1e-12,
        )


def jacobian(data: FitData, values: Mapping[str, float], free: Sequence[str]) -> FloatArray:
    """Slope of the residuals with the free parameters (N, p) [1/SI]."""
    columns = []
    for name in free:
        step = 1e-6 * max(abs(values[name]), 1e-9 * max(values.values()))
        if name.endswith("stribeck_velocity"):
            step = 1e-6 * values[name]
        ahead, behind = (residuals(data, {**values, name: values[name] + off}) for off in (step, -step))
        columns.append((ahead - behind) / (2 * step))
    return np.column_stack(columns)


def _covariance(data: FitData, values: Mapping[str, float], free: Sequence[str]) -> FloatArray:
    """Inverse of the information of the free parameters (p, p).

    lmfit gives up the errors of all where one parameter is not felt by the data (a Stribeck velocity without
    a Stribeck effect); here that one alone has none.
    """
    slopes = jacobian(data, values, free)
    # A Stribeck torque that ended at 0 is felt as F_s is, in parts of F_c.
    size = np.array(
        [
            max(abs(values[name]), values.get(name.replace("stribeck", "coulomb"), 0.0))
            if name.endswith("stribeck_torque")
            else abs(values[name])
            for name in free
        ]
    )
    norm = np.linalg.norm(slopes, axis=0)
    felt = (norm * size > FELT) | ((size == 0) & (norm > 0))
    covariance = np.diag(np.where(felt, 0.0, np.inf))
    scaled = slopes[:, felt] / norm[felt]
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-14, hermitian=True)
    covariance[np.ix_(felt, felt)] = inverse / np.outer(norm[felt], norm[felt])
    return covariance


def _starts(data: FitData) -> list[dict[str, float]]:
    """Starts from the linear problem on a grid of v_s: the local minima first, then the rest spread out."""
    ranked = {direction: _ranked(data, direction) for direction in DIRECTIONS}
    inertia = start_inertia(data) or 0.0
    starts = []
    for number in range(STARTS):
        values = {"inertia": inertia}
        for direction in DIRECTIONS:
            choice = ranked[direction][number % len(ranked[direction])]
            values |= {f"{direction}_{name}": value for name, value in choice.items()}
        starts.append(values)
    return starts


def _ranked(data: FitData, direction: Direction) -> list[dict[str, float]]:
    """The law of one direction by non-negative least squares for each v_s of the grid, best minima first."""
    own = data.run_direction == SIGN[direction]
    begun = data.start_direction == SIGN[direction]
    speed = np.concatenate([data.speed[own], np.zeros(int(begun.sum()))])
    torque = np.concatenate([data.torque[own], data.start_torque[begun]])
    weight = 1.0 / np.concatenate([data.run_stderr[own], data.start_stderr[begun]])
    moving = speed[speed > 0]
    grid = np.geomspace(0.3 * moving.min(), 2.0 * moving.max(), GRID)
    found = []
    for velocity in grid:
        basis = np.column_stack([np.ones_like(speed), np.exp(-speed / velocity), speed])
        scale = np.linalg.norm(basis * weight[:, None], axis=0)
        coefficient, norm = nnls(basis * (weight[:, None] / scale), torque * weight)
        found.append((norm, coefficient / scale, velocity))
    norms = np.array([norm for norm, _, _ in found])
    padded = np.concatenate([[np.inf], norms, [np.inf]])
    minima = (norms <= padded[:-2]) & (norms <= padded[2:])
    order = sorted(range(GRID), key=lambda k: (not minima[k], norms[k]))
    spread = [k for k in order if minima[k]] + list(range(GRID // 16, GRID, GRID // 8))
    least = 1e-3 * float(np.max(np.abs(torque)))
    return [
        {
            "coulomb_torque": max(float(found[k][1][0]), least),
            "stribeck_torque": max(float(found[k][1][1]), least),
            "stribeck_velocity": float(found[k][2]),
            "viscous_damping": max(float(found[k][1][2]), least / float(moving.max())),
            "stribeck_shape": 1.0,
        }
        for k in spread
    ]


def start_inertia(data: FitData) -> float | None:
    """J from the frequency response, else from the momenta with the friction read off the steady runs.

    None where nothing knows it.
    """
    if data.inertia is not None:
        return data.inertia[0]
    guesses = []
    for motion in data.momenta:
        own = data.run_direction == motion.direction
        order = np.argsort(data.speed[own])
        middle = motion.nodes.mean(axis=1)
        friction = np.interp(middle, data.speed[own][order], data.torque[own][order]) * motion.duration
        gained = float(np.sum(motion.gain))
        guesses.append(float(np.sum(motion.impulse - friction)) / gained if gained > 0 else 0.0)
    sound = [guess for guess in guesses if guess > 0]
    return float(np.median(sound)) if sound else None


def _other_minimum(results: Sequence[lmfit.minimizer.MinimizerResult]) -> Mapping[str, float] | None:
    """A result that fits as well as the best with another v_s."""
    best = results[0]
    for other in results[1:]:
        if float(other.chisqr) > float(best.chisqr) + SAME:
            continue
        for direction in DIRECTIONS:
            name = f"{direction}_stribeck_velocity"
            ratio = float(other.params[name].value) / float(best.params[name].value)
            flat = float(best.params[f"{direction}_stribeck_torque"].value) == 0.0
            if abs(np.log(ratio)) > 0.5 and not flat:
                return {key: float(value) for key, value in other.params.valuesdict().items()}
    return None

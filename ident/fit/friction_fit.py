r"""The one stage: the laws of all directions and the common inertia from all data at once.

The data are magnitudes along the motion, with s the direction and o the offset (0 but for one law for both):

- steady runs:      u_i - J a_i = F_c + dF exp(-(v_i/v_s)^beta) + b v_i + s o,
- breakaways:       u_i - u' d  = F_c + dF + s o,     d the time from onset to detection,
- momentum:         each window of the motion after breakaway,
- the inertia of the frequency response, as one datum with its error.

All are weighted by real standard errors, so chi-square is what it says. F_s is fitted as F_c + dF with
dF >= 0; F_c >= 0, b >= 0, v_s > 0. For given v_s and beta the law is linear: a grid of v_s over all speeds,
each with the best linear law, gives the starts, so that no second minimum goes unseen.

The fits run compiled (`bounded_least_squares`); lmfit polishes the last one, with derivatives of its own, and
writes the report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import lmfit
import numpy as np

from data.recording import FloatArray
from ident.fit.fit_data import LARGEST_SHAPE, LEAST_SHAPE, FitData
from ident.fit.law_model import BLOCK, SIGN, Direction, LawModel, LawName
from ident.fit.normal_equations import OFFSET, chi_square
from ident.fit.refits import refit_each
from ident.fit.slopes import slopes

GRID = 40  # Stribeck velocities tried as starts in each law
STARTS = 8  # polished by the full fit
SHAPES = (1.0, 0.6, 1.8)  # of beta, where it is free
FELT = 0.1  # change of the residuals, in standard errors, under a parameter's own size: less is not felt
SAME = 4.0  # chi-square above the least, below which another minimum lies in the 95 % region
APART = 0.5  # of ln v_s, beyond which two minima are two


Law = tuple[float, float, float, float, float]  # F_c, dF, v_s, b, beta of a direction, the offset in its F_c


@dataclass(frozen=True)
class FrictionFit:
    """The best fit. Names are those of `LawModel.names`: 'inertia', 'positive_stribeck_torque' (dF), ..."""

    model: LawModel
    values: Mapping[str, float]
    free: tuple[str, ...]  # names of the free parameters, in the order of the covariance
    covariance: FloatArray  # (p, p); infinite variance where the data do not feel a parameter [SI]
    chi_square: float  # [-]
    other_minimum: Mapping[str, float] | None  # a second one that fits as well

    def law(self, direction: Direction) -> Law:
        """F_c, dF, v_s, b, beta of a direction as its torque was logged: with the offset in F_c."""
        return law_of(self.values, direction)


def law_of(values: Mapping[str, float], direction: Direction) -> Law:
    """F_c (with the offset), dF, v_s, b, beta of a direction, from parameters by name."""
    law = direction if f"{direction}_coulomb_torque" in values else "mean"
    coulomb, stribeck, velocity, damping, shape = (values[f"{law}_{name}"] for name in BLOCK)
    return coulomb + SIGN[direction] * values["torque_offset"], stribeck, velocity, damping, shape


def friction_torque(law: Law, speed: FloatArray) -> FloatArray:
    """F(v) + b v [N m] at speeds (n,) >= 0 [rad/s]; law: F_c, dF, v_s, b, beta."""
    coulomb, stribeck, velocity, damping, shape = law
    return np.asarray(coulomb + stribeck * np.exp(-((speed / velocity) ** shape)) + damping * speed)


def residuals(data: FitData, values: Mapping[str, float]) -> FloatArray:
    """Every datum less its prediction, in standard errors."""
    inertia = values["inertia"]
    parts: list[FloatArray] = []
    for direction in data.model.directions:
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
    for direction in data.model.directions:
        parts.append(runs[data.run_direction == SIGN[direction]])
        parts.append(starts[data.start_direction == SIGN[direction]])
        parts += [np.full(one.gain.size, motion) for one in data.momenta if one.direction == SIGN[direction]]
    if data.inertia is not None:
        parts.append(np.array([inertia]))
    return np.concatenate(parts)


def jacobian(data: FitData, values: Mapping[str, float], free: Sequence[str]) -> FloatArray:
    """Slope of the residuals with the free parameters (N, p) [1/SI]."""
    return slopes(lambda changed: residuals(data, changed), values, free)


def fit_friction(data: FitData, *, start: FrictionFit | None = None) -> FrictionFit:
    """Fit everything; from an earlier fit where there is one, else from several starts."""
    begun = _starts(data) if start is None else vector(data, start.values)[None, :]
    points, cost = _refitted(data, _straightened(data, begun))
    if start is None and data.model.free_shape:
        shaped = np.repeat(points, len(SHAPES), axis=0)
        for law in data.model.free_shape:
            place = data.model.place(law) + BLOCK.index("stribeck_shape")
            shaped[:, place] = np.tile(SHAPES, len(points))
        points, cost = _refitted(data, shaped)
    order = np.argsort(cost, kind="stable")
    points, cost = points[order], cost[order]
    values = named(data, points[0])
    return FrictionFit(
        model=data.model,
        values=values,
        free=data.free,
        covariance=_covariance(data, points[0]),
        chi_square=float(cost[0]),
        other_minimum=_other_minimum(data, points, cost),
    )


def polished(data: FitData, fit: FrictionFit) -> tuple[FrictionFit, str]:
    """The fit polished by lmfit, and lmfit's report.

    Parameters that ended at a bound, or that the data do not feel, stay where they are: lmfit moves away from
    a bound, and gives up all standard errors for one that it cannot tell.
    """
    parameters = lmfit.Parameters()
    places = {name: place for place, name in enumerate(data.model.names)}
    x = vector(data, fit.values)
    lost = dict(zip(fit.free, np.isinf(np.diag(fit.covariance)), strict=True))
    for name, value in fit.values.items():
        place = places[name]
        at_bound = not data.box.low[place] < x[place] < data.box.high[place]
        shape = name.endswith("stribeck_shape")
        parameters.add(
            name,
            value=value,
            min=-np.inf if name == "torque_offset" else LEAST_SHAPE if shape else 0.0,
            max=LARGEST_SHAPE if shape else np.inf,
            vary=name in lost and not lost[name] and not at_bound,
        )

    def objective(current: lmfit.Parameters) -> FloatArray:
        return residuals(data, current.valuesdict())

    # Real standard errors: the covariance must not be rescaled. lmfit takes roots of it for the report, which
    # are none where two parameters cannot be told apart.
    with np.errstate(invalid="ignore", over="ignore"):
        result = lmfit.minimize(
            objective,
            parameters,
            method="least_squares",
            scale_covar=False,
            x_scale="jac",
            ftol=1e-12,
            xtol=1e-12,
            gtol=1e-12,
        )
        report = str(lmfit.fit_report(result, show_correl=True, min_correl=0.3))
    values = {name: float(value) for name, value in result.params.valuesdict().items()}
    covariance = _covariance(data, vector(data, values))
    return replace(fit, values=values, covariance=covariance, chi_square=float(result.chisqr)), report


def vector(data: FitData, values: Mapping[str, float]) -> FloatArray:
    """Parameters by name as the compiled fits have them (p,), straight where the model has lines."""
    x = np.array([values[name] for name in data.model.names])
    for law in data.model.laws:
        velocity = data.model.place(law) + BLOCK.index("stribeck_velocity")
        x[velocity] = np.log(x[velocity])
    return np.asarray(_straightened(data, x[None, :])[0])


def _straightened(data: FitData, points: FloatArray) -> FloatArray:
    """Points (s, p), the v_s of every line where no run feels it."""
    straight = points.copy()
    for law in data.model.lines:
        velocity = data.model.place(law) + BLOCK.index("stribeck_velocity")
        straight[:, velocity] = data.box.low[velocity]
        straight[:, data.model.place(law) + BLOCK.index("stribeck_shape")] = 1.0
    return straight


def named(data: FitData, x: FloatArray) -> dict[str, float]:
    """The values by name of compiled parameters (p,), in which v_s is a logarithm."""
    return {
        name: float(np.exp(value) if name.endswith("stribeck_velocity") else value)
        for name, value in zip(data.model.names, x, strict=True)
    }


def _refitted(data: FitData, begun: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The minimum near each start (s, p), and its chi-square (s,)."""
    points, cost = np.array(begun), np.zeros(len(begun))
    refit_each(data.problem, points, data.box, data.work, cost)
    return points, cost


def _covariance(data: FitData, x: FloatArray) -> FloatArray:
    """Inverse of the information of the free parameters (p, p).

    Where one parameter is not felt by the data (a Stribeck velocity without a Stribeck effect), it alone has
    no finite error.
    """
    chi_square(data.problem, x, data.work.h, data.work.g, 0)
    lower = np.tril(data.work.h[0])
    free = data.box.free
    values = named(data, x)
    slope = np.array(
        [values[name] if name.endswith("stribeck_velocity") else 1.0 for name in data.model.names]
    )
    information = ((lower + np.tril(lower, -1).T) / np.outer(slope, slope))[np.ix_(free, free)]
    # A Stribeck torque that ended at 0 is felt as F_s is, in parts of F_c.
    size = np.array(
        [
            max(abs(values[name]), values.get(name.replace("stribeck", "coulomb"), 0.0))
            if name.endswith("stribeck_torque")
            else abs(values[name])
            for name in data.free
        ]
    )
    norm = np.sqrt(np.diag(information))
    felt = (norm * size > FELT) | ((size == 0) & (norm > 0))
    felt |= np.array([name == "torque_offset" for name in data.free])
    covariance = np.diag(np.where(felt, 0.0, np.inf))
    scale = np.outer(norm[felt], norm[felt])
    inverse = np.linalg.pinv(information[np.ix_(felt, felt)] / scale, rcond=1e-14, hermitian=True)
    covariance[np.ix_(felt, felt)] = inverse / scale
    return covariance


def _starts(data: FitData) -> FloatArray:
    """Starts from the linear problem on a grid of v_s: the local minima first, then the rest spread out."""
    blank = _blank(data)
    ranked = [_ranked(data, law, blank) for law in data.model.laws]
    starts = []
    for number in range(STARTS):
        x = blank.copy()
        for law, choices in zip(data.model.laws, ranked, strict=True):
            place = data.model.place(law)
            x[place : place + len(BLOCK)] = choices[number % len(choices)]
        starts.append(x)
    return np.array(starts)


def _blank(data: FitData) -> FloatArray:
    """A start that knows the inertia alone (p,)."""
    x = np.zeros(len(data.model.names))
    x[0] = start_inertia(data) or 0.0
    for law in data.model.laws:
        place = data.model.place(law)
        x[place : place + len(BLOCK)] = (0.0, 0.0, np.log(float(np.min(data.speed))), 0.0, 1.0)
    return x


def _ranked(data: FitData, law: LawName, blank: FloatArray) -> list[FloatArray]:
    """Blocks of one law: the best linear law of runs and breakaways for each v_s, best minima first."""
    place = data.model.place(law)
    velocity = place + BLOCK.index("stribeck_velocity")
    own = np.isin(data.run_direction, data.model.signs(law))
    moving = data.speed[own]
    steady = replace(data, momenta=(), whitening=())
    largest = float(np.max(np.abs(data.torque[own])))
    points = np.tile(blank, (GRID, 1))
    points[:, place] = points[:, place + 1] = 0.5 * largest
    points[:, velocity] = np.linspace(np.log(0.3 * moving.min()), np.log(2.0 * moving.max()), GRID)
    free = np.zeros(points.shape[1], dtype=np.bool_)
    free[[place, place + 1, place + BLOCK.index("viscous_damping")]] = True
    free[OFFSET] = data.model.has_offset
    cost = np.zeros(GRID)
    refit_each(steady.problem, points, data.box._replace(free=free), data.work, cost)
    padded = np.concatenate([[np.inf], cost, [np.inf]])
    minima = (cost <= padded[:-2]) & (cost <= padded[2:])
    order = sorted(range(GRID), key=lambda k: (not minima[k], cost[k]))
    spread = [k for k in order if minima[k]] + list(range(GRID // 16, GRID, GRID // 8))
    least = np.array([1e-3 * largest, 1e-3 * largest, -np.inf, 1e-3 * largest / float(moving.max()), 1.0])
    return [np.maximum(points[k, place : place + len(BLOCK)], least) for k in spread]


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


def fit_from(data: FitData, begun: FrictionFit, earlier: FrictionFit) -> FrictionFit:
    """The minimum near a start that is better than an earlier fit's, which is then the other one."""
    fit = fit_friction(data, start=begun)
    others = [(earlier.values, earlier.chi_square)]
    if earlier.other_minimum is not None:
        square = float(np.sum(residuals(data, earlier.other_minimum) ** 2))
        others.append((earlier.other_minimum, square))
    points = np.array([vector(data, values) for values in (fit.values, *(own for own, _ in others))])
    cost = np.array([fit.chi_square, *(square for _, square in others)])
    return replace(fit, other_minimum=_other_minimum(data, points, cost))


def _other_minimum(data: FitData, points: FloatArray, cost: FloatArray) -> Mapping[str, float] | None:
    """A minimum that fits as well as the best with another v_s; points (s, p) and cost (s,) best first."""
    for other in points[1:][cost[1:] <= cost[0] + SAME]:
        for law in data.model.laws:
            place = data.model.place(law)
            velocity = place + BLOCK.index("stribeck_velocity")
            flat = points[0, place + BLOCK.index("stribeck_torque")] == 0.0
            if abs(other[velocity] - points[0, velocity]) > APART and not flat:
                return named(data, other)
    return None

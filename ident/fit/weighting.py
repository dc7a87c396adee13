"""The evidence as data for the fit: corrected, and weighted by what the last fit has shown of its errors.

Everything that depends on the law is taken from the fit before: the ramp's rise between onset and detection,
the torque error that a speed error amounts to (slope of the law times the speed's error), the spread between
runs, places and ramps. A few rounds settle it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.recording import FloatArray
from ident.evidence.breakaway import Breakaway
from ident.evidence.gathering import Evidence
from ident.evidence.momentum import Momentum
from ident.fit.censored_mean import bounded_shift
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import (
    FrictionFit,
    fit_friction,
    friction_torque,
    start_inertia,
)
from ident.fit.law_model import SIGN, LawModel, direction_of
from ident.fit.one_way_robot import robot_one_way
from ident.fit.predictions import gradient, measured, predicted
from ident.fit.ramp_rates import rate_trend
from ident.fit.variance_model import Spread, averaged_out, members, spread_of, white_variance
from ident.response import breakaway_delay

# Of what a swing of the torque alone would do to the mean: friction takes its share of the momentum. The
# doubt grows with the swing, of which only the second order is reckoned with.
SWAY_TAKEN, SWAY_DOUBT = 0.7, 0.3
ROUNDS = 5  # of the steady runs alone
MOST_ROUNDS = 12  # with the motion
SETTLED = 0.02  # standard errors by which a round may still move the fit
FIRST_SPREAD = 0.01  # of the torque, before anything is known


@dataclass(frozen=True)
class Weighted:
    """The settled fit and the data as it was weighted."""

    data: FitData
    fit: FrictionFit
    spread: Spread


def settle(evidence: Evidence, model: LawModel) -> Weighted:
    """Fit a model, weigh anew, and fit again until the weights have settled; from many starts first and last.

    The steady runs and breakaways settle alone first, and theirs is the spread between runs. The motion joins
    afterwards, with a misfit of its own as seen from their law: however wrong it is, it can neither bend the
    steady runs nor make them look worse than they are.
    """
    first = _first_data(evidence, model)
    inertia = _known_inertia(evidence, first)
    alone = _settle_steady(evidence, first, inertia=inertia)
    if not evidence.momenta or inertia is None:
        return alone
    spread = alone.spread
    fit = replace(alone.fit, values={**alone.fit.values, "inertia": inertia})
    fit = replace(fit, values={**fit.values, "inertia": _balanced_inertia(evidence.momenta, fit, spread)})
    data = first
    for number in range(MOST_ROUNDS):
        data = reweighted(evidence, data, fit, spread)
        again = fit_friction(data, start=fit)
        change = _change(fit, again)
        fit = again
        if number >= 1 and change < SETTLED:
            break
    fit = fit_friction(data)
    return Weighted(data, fit, spread)


def with_inertia(
    evidence: Evidence, weighted: Weighted, inertia: tuple[float, float], *, dof: int
) -> Weighted:
    """The settled fit with one datum more: an inertia and its standard error, known to `dof` degrees."""
    torque = _first_data(evidence, weighted.data.model)
    data = replace(
        weighted.data,
        inertia=inertia,
        inertia_dof=dof,
        torque=torque.torque,
        sway=torque.sway,
        acceleration=torque.acceleration,
    )
    fit = replace(weighted.fit, values={**weighted.fit.values, "inertia": inertia[0]})
    fit = fit_friction(data, start=fit)
    for _ in range(2):
        data = reweighted(evidence, data, fit, weighted.spread)
        fit = fit_friction(data, start=fit)
    return Weighted(data, replace(fit, other_minimum=weighted.fit.other_minimum), weighted.spread)


def _settle_steady(evidence: Evidence, first: FitData, *, inertia: float | None) -> Weighted:
    """The fit of steady runs and breakaways; what their speed still changes is taken off with `inertia`.

    Where no inertia is known, that small term stays in.
    """
    torque = first.torque - (inertia or 0.0) * first.acceleration
    data = replace(first, torque=torque, acceleration=np.zeros_like(torque), momenta=(), whitening=())
    fit = fit_friction(replace(data, model=replace(data.model, free_shape=())))
    for number in range(ROUNDS):
        seen = replace(fit, values={**fit.values, "inertia": inertia or 0.0})
        spread = _spread_of(evidence, data, seen)
        data = reweighted(evidence, data, seen, spread)
        fit = fit_friction(data, start=None if number == ROUNDS - 1 else fit)
    return Weighted(data, fit, spread)


def _known_inertia(evidence: Evidence, data: FitData) -> float | None:
    """J from the frequency response, else roughly from the motion; None where neither tells."""
    return evidence.response.inertia if evidence.response is not None else start_inertia(data)


def _balanced_inertia(momenta: Sequence[Momentum], fit: FrictionFit, spread: Spread) -> float:
    """The J that balances the motion under the law of the steady runs, by weighted least squares."""
    inertia = fit.values["inertia"]
    left = right = 0.0
    for motion in momenta:
        law = fit.law(direction_of(motion.direction))
        whitening = _whitening(motion, inertia, spread, scale=1.0)
        gain = whitening @ motion.gain
        left += float(gain @ (whitening @ motion.residual(0.0, law)))
        right += float(gain @ gain)
    return float(left / right) if left > 0 else inertia


def _change(fit: FrictionFit, again: FrictionFit) -> float:
    """Largest change of a parameter from one fit to the next, in its standard errors."""
    change = np.array([again.values[name] - fit.values[name] for name in again.free])
    return float(np.max(np.abs(change) / np.sqrt(np.diag(again.covariance))))


def _first_data(evidence: Evidence, model: LawModel) -> FitData:
    runs, starts = evidence.used_runs, evidence.used_starts
    run_direction = np.array([run.direction for run in runs], dtype=np.int64)
    start_direction = np.array([start.direction for start in starts], dtype=np.int64)
    torque = np.array([run.direction * run.torque for run in runs], dtype=np.float64)
    begun = np.array([start.direction * start.torque for start in starts], dtype=np.float64)
    typical = FIRST_SPREAD * float(np.median(np.abs(torque)))
    line = np.array([start.line.stderr for start in starts])
    return FitData(
        model=model,
        run_direction=run_direction,
        speed=np.array([abs(run.velocity) for run in runs]),
        torque=torque,
        acceleration=np.array([run.acceleration for run in runs]) * run_direction,
        run_stderr=np.sqrt(white_variance(runs) + typical**2),
        start_direction=start_direction,
        start_torque=begun,
        start_stderr=np.hypot(line, typical),
        momenta=evidence.momenta,
        whitening=tuple(
            _whitening(motion, 0.0, Spread(np.full(2, typical**2), np.inf), scale=1.0)
            for motion in evidence.momenta
        ),
        inertia=None,
    )


def _spread_of(evidence: Evidence, data: FitData, fit: FrictionFit) -> Spread:
    """The spreads that the residuals of a fit of steady runs and breakaways show."""
    residual = measured(data) - predicted(data, fit.values)
    known = np.concatenate([_own_variance(evidence, data, fit), _start_variance(evidence, data, fit)])
    travel = np.array([run.travel for run in evidence.used_runs])
    scatter = np.array([run.scatter for run in evidence.used_runs])
    groups = members(data.run_direction, data.start_direction)
    return spread_of(residual, gradient(data, fit), known, groups, travel, scatter)


def _own_variance(evidence: Evidence, data: FitData, fit: FrictionFit) -> FloatArray:
    """What a run's own noise and the error of its speed make of its torque's variance (n,) [(N m)^2]."""
    runs = evidence.used_runs
    speed = np.array([run.velocity_stderr for run in runs])
    place = np.array([run.place_stderr for run in runs])
    doubt = (SWAY_DOUBT + _speed_variance(evidence, fit) / data.speed**2) * _sway(evidence, data, fit)
    return np.asarray(white_variance(runs) + place**2 + (law_slopes(data, fit) * speed) ** 2 + doubt**2)


def _speed_variance(evidence: Evidence, fit: FrictionFit) -> FloatArray:
    """How much a hunting loop swings the speed of each run (n,) [(rad/s)^2], as far as J is known."""
    momentum = np.array([run.momentum_variance for run in evidence.used_runs])
    inertia = fit.values["inertia"]
    return momentum / inertia**2 if inertia > 0.0 else np.zeros_like(momentum)


def _sway(evidence: Evidence, data: FitData, fit: FrictionFit) -> FloatArray:
    """F''(v) sigma_v^2 / 2 of each run (n,) [N m]: mean of a curved law less the law at the mean speed."""
    bend = np.zeros_like(data.torque)
    for direction in data.model.directions:
        own = data.run_direction == SIGN[direction]
        law, speed = fit.law(direction), data.speed[own]
        step = 1e-3 * speed
        ends = friction_torque(law, speed + step) + friction_torque(law, speed - step)
        bend[own] = (ends - 2.0 * friction_torque(law, speed)) / step**2
    return np.asarray(0.5 * bend * _speed_variance(evidence, fit))


def _start_variance(evidence: Evidence, data: FitData, fit: FrictionFit) -> FloatArray:
    """What the ramp's line, the wave's error and the detection make of a breakaway's variance (m,)."""
    starts = evidence.used_starts
    line = np.array([np.hypot(start.line.stderr, start.place_stderr) for start in starts])
    _, delay_error = onset_torque(starts, fit)
    return np.asarray(line**2 + delay_error**2)


def reweighted(evidence: Evidence, data: FitData, fit: FrictionFit, spread: Spread) -> FitData:
    """The data with onsets and standard errors as a fit and the spreads make them."""
    runs = data.torque.size
    start_torque, delay_error = onset_torque(evidence.used_starts, fit)
    known = np.concatenate([_own_variance(evidence, data, fit), _start_variance(evidence, data, fit)])
    travel = np.array([run.travel for run in evidence.used_runs])
    part = np.ones(known.size)
    part[:runs] = averaged_out(travel, spread.wavelength)
    by_group = members(data.run_direction, data.start_direction) * part * spread.variances[:, None]
    total = known + by_group.sum(axis=0)
    start_stderr = np.sqrt(total[runs:])
    rate = np.array([abs(start.line.rate) for start in evidence.used_starts])
    of_runs = np.where(data.start_direction > 0, spread.variances[0], spread.variances[1])
    shared_error = np.hypot(delay_error, np.sqrt(of_runs))
    trend = rate_trend(data.start_direction, rate, start_torque, start_stderr, shared_error)
    if trend is not None:
        start_torque = start_torque - trend.excess
        start_stderr = start_stderr * trend.widening(data.start_direction)
    start_torque, start_stderr = _with_bounds(evidence, data, start_torque, start_stderr)
    scale, dof = _motion_scale(data.momenta, fit, spread)
    sway = SWAY_TAKEN * _sway(evidence, data, fit)
    return replace(
        data,
        torque=data.torque + data.sway - sway,
        sway=sway,
        run_stderr=np.sqrt(total[:runs]),
        start_torque=start_torque,
        start_stderr=start_stderr,
        trend=trend,
        shares=by_group / total,
        motion_dof=dof,
        whitening=tuple(
            _whitening(motion, fit.values["inertia"], spread, scale=scale) for motion in data.momenta
        ),
    )


def _with_bounds(
    evidence: Evidence, data: FitData, torque: FloatArray, stderr: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Breakaways (m,) and their errors (m,) [N m] as ramps that ended at the torque limit shift them."""
    torque, stderr = torque.copy(), stderr.copy()
    for sign in np.unique(data.start_direction):
        own = data.start_direction == sign
        bounds = [abs(s.torque) for s in evidence.starts if s.is_censored and s.direction == sign]
        shift = bounded_shift(torque[own], stderr[own], np.array(bounds))
        torque[own] += shift.torque
        stderr[own] *= shift.factor
    return torque, stderr


def law_slopes(data: FitData, fit: FrictionFit) -> FloatArray:
    """The law's slope at each run (n,) [N m s/rad]."""
    slope = np.zeros_like(data.torque)
    for direction in data.model.directions:
        own = data.run_direction == SIGN[direction]
        law, speed = fit.law(direction), data.speed[own]
        step = 1e-4 * speed
        slope[own] = (friction_torque(law, speed + step) - friction_torque(law, speed - step)) / (2 * step)
    return slope


def onset_torque(starts: Sequence[Breakaway], fit: FrictionFit) -> tuple[FloatArray, FloatArray]:
    """Torque at the onset (m,) [N m], magnitudes, and the error that the delay may bring (m,)."""
    robots = {direction: robot_one_way(fit, direction) for direction in fit.model.directions}
    torque, error = np.zeros(len(starts)), np.zeros(len(starts))
    for number, start in enumerate(starts):
        rate, torque[number] = abs(start.line.rate), abs(start.torque)
        direction = direction_of(start.direction)
        robot = robots[direction]
        if robot is None:
            continue
        delays = [
            breakaway_delay(robot, direction=direction, ramp_rate=rate, travel=start.travel + off)
            for off in (-start.travel_stderr, 0.0, start.travel_stderr)
        ]
        torque[number] -= rate * delays[1]
        error[number] = rate * 0.5 * (delays[2] - delays[0])
    return torque, error


def _whitening(motion: Momentum, inertia: float, spread: Spread, *, scale: float) -> FloatArray:
    """Inverse square root of the covariance of a motion's windows (k, k)."""
    direction = np.full(motion.travel.size, motion.direction)
    place = spread.of_runs(direction, motion.travel) * motion.duration**2
    covariance = inertia**2 * motion.speed_covariance + np.diag(motion.impulse_variance + place)
    covariance = covariance + 1e-12 * float(np.trace(covariance)) * np.eye(motion.gain.size)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(scale * covariance)))


def _motion_scale(momenta: Sequence[Momentum], fit: FrictionFit, spread: Spread) -> tuple[float, float]:
    """Factor on the momenta's covariance under which each ramp, as one datum, strays by its own error.

    With it the degrees of freedom that it rests on: infinite where the covariance stands as it is.
    """
    if not momenta:
        return 1.0, np.inf
    inertia = fit.values["inertia"]
    total, strayed, windows = 0.0, 0.0, 0
    for motion in momenta:
        law = fit.law(direction_of(motion.direction))
        whitening = _whitening(motion, inertia, spread, scale=1.0)
        residual = whitening @ motion.residual(inertia, law)
        gain = whitening @ motion.gain
        strayed += float(residual @ gain) ** 2 / float(gain @ gain)
        total += float(residual @ residual)
        windows += residual.size
    between, within = max(len(momenta) - 1, 1), max(windows - 1, 1)
    return max((1.0, np.inf), (strayed / between, between), (total / within, within))

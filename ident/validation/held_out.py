r"""Runs left out in turn and predicted from the others.

With C the covariance of the parameters that the other runs give and g the gradient of the prediction, the
error of prediction of a run with error sigma has the variance sigma^2 + g' C g, sigma that of the settled
weights. If these are right, the errors divided by their size have a root mean square of about 1, and 95 % of
them lie within Student's quantile. Every k-th log is left out at once, in the order of speed, and single
steady runs and breakaways where there are few logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data.protocols import ProtocolName
from data.recording import Recording
from ident.evidence.breakaway import Breakaway
from ident.evidence.friction_map import SteadyRun
from ident.evidence.gathering import Evidence
from ident.fit.confidence import quantile
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, fit_friction
from ident.fit.law_model import DIRECTIONS, SIGN
from ident.fit.predictions import gradient, measured, predicted, stderr
from ident.fit.residual_tests import ResidualTest, rank_test, runs_test
from ident.fit.weighting import Weighted

FOLDS = 10
LEAST_RUNS = 3  # that each direction keeps


@dataclass(frozen=True)
class HeldOut:
    """One datum, predicted by a fit that has not seen its log."""

    log: str
    protocol: ProtocolName
    direction: int  # +1 or -1
    velocity: float  # signed [rad/s]; 0 for a breakaway
    place: float  # at its middle [rad]
    measured: float  # signed, less what acceleration takes [N m]
    predicted: float  # signed [N m]
    stderr: float  # of measured - predicted [N m]

    @property
    def standardised(self) -> float:
        """Error along the motion in standard errors."""
        return self.direction * (self.measured - self.predicted) / self.stderr


@dataclass(frozen=True)
class Fold:
    """The logs that were left out together, and the fit without them."""

    logs: frozenset[str]
    fit: FrictionFit


@dataclass(frozen=True)
class CrossValidation:
    """All that was predicted. Empty where the data are too few to leave any out."""

    points: tuple[HeldOut, ...]
    folds: tuple[Fold, ...]
    quantile: float  # standard errors within which 95 % should lie [-]
    tests: tuple[ResidualTest, ...]

    @property
    def torque_rms(self) -> float | None:
        """Root mean square of the errors [N m]."""
        errors = [point.measured - point.predicted for point in self.points]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    @property
    def standardised_rms(self) -> float | None:
        """The same in standard errors; about 1 where the intervals are right."""
        errors = [point.standardised for point in self.points]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    @property
    def inside(self) -> int:
        """Points within their 95 % prediction intervals."""
        return sum(abs(point.standardised) <= self.quantile for point in self.points)


def cross_validate(
    recordings: Sequence[Recording], evidence: Evidence, weighted: Weighted
) -> CrossValidation:
    """Leave every run and breakaway that the fit took out once, and predict it."""
    data = weighted.data
    items = _items(evidence)
    fold_of = _folds(data, items)
    points: dict[int, HeldOut] = {}
    folds = []
    for number in range(int(fold_of.max(initial=-1)) + 1):
        out = fold_of == number
        logs = frozenset(item.log for item, gone in zip(items, out, strict=True) if gone)
        kept = _kept(data, ~out, logs, evidence)
        if not _is_enough(kept):
            continue
        fit = fit_friction(kept, start=weighted.fit)
        folds.append(Fold(logs, fit))
        points |= _predicted(recordings, data, items, fit, np.flatnonzero(out))
    ordered = tuple(points[number] for number in sorted(points))
    spare = max(len(items) - sum(name != "inertia" for name in weighted.fit.free), 1)
    return CrossValidation(ordered, tuple(folds), quantile(spare), _tests(ordered))


def _items(evidence: Evidence) -> list[SteadyRun | Breakaway]:
    """In the order of the fit's data."""
    return [*evidence.used_runs, *evidence.used_starts]


def _folds(data: FitData, items: Sequence[SteadyRun | Breakaway]) -> NDArray[np.int64]:
    """The fold of each datum (n + m,): logs, or data where logs are few, dealt out in the order of speed."""
    direction = np.concatenate([data.run_direction, data.start_direction])
    speed = np.concatenate([data.speed, np.zeros(data.start_torque.size)])
    order = np.lexsort([speed, direction])
    logs = [item.log for item in items]
    unit = logs if len(set(logs)) >= 2 * FOLDS else [str(number) for number in range(len(items))]
    units = list(dict.fromkeys(unit[int(number)] for number in order))
    folds = min(FOLDS, max(len(units) // 2, 1))
    return np.array([units.index(own) % folds for own in unit], dtype=np.int64)


def _kept(data: FitData, kept: NDArray[np.bool_], logs: frozenset[str], evidence: Evidence) -> FitData:
    """The data without a fold; the motion of a log goes with it where the whole log goes."""
    runs, starts = kept[: data.torque.size], kept[data.torque.size :]
    partly = {item.log for item, stays in zip(_items(evidence), kept, strict=True) if stays}
    moving = [n for n, motion in enumerate(data.momenta) if motion.log not in logs or motion.log in partly]
    return replace(
        data,
        run_direction=data.run_direction[runs],
        speed=data.speed[runs],
        torque=data.torque[runs],
        acceleration=data.acceleration[runs],
        run_stderr=data.run_stderr[runs],
        start_direction=data.start_direction[starts],
        start_torque=data.start_torque[starts],
        start_stderr=data.start_stderr[starts],
        momenta=tuple(data.momenta[n] for n in moving),
        whitening=tuple(data.whitening[n] for n in moving),
    )


def _is_enough(data: FitData) -> bool:
    """Whether every law keeps more data than it has parameters, and runs among them in its directions."""
    for law in data.model.laws:
        ways = data.model.signs(law)
        runs = np.isin(data.run_direction, ways)
        starts = np.isin(data.start_direction, ways)
        free = sum(name.startswith(law) for name in data.free)
        if any(np.count_nonzero(data.run_direction == way) < LEAST_RUNS for way in ways):
            return False
        if int(runs.sum()) + int(starts.sum()) <= free:
            return False
    return True


def _predicted(
    recordings: Sequence[Recording],
    data: FitData,
    items: Sequence[SteadyRun | Breakaway],
    fit: FrictionFit,
    which: NDArray[np.int64],
) -> dict[int, HeldOut]:
    """The data of those numbers against a fit that has not seen them."""
    by_name = {recording.log: recording for recording in recordings}
    torque, said = measured(data), predicted(data, fit.values)
    felt = np.isfinite(np.diag(fit.covariance))
    slope, covariance = gradient(data, fit)[:, felt], fit.covariance[np.ix_(felt, felt)]
    variance = stderr(data) ** 2 + np.einsum("nj,jk,nk->n", slope, covariance, slope)
    found = {}
    for number in map(int, which):
        item = items[number]
        steady = isinstance(item, SteadyRun)
        driven = fit.values["inertia"] * float(data.acceleration[number]) if steady else 0.0
        found[number] = HeldOut(
            log=item.log,
            protocol="constant_velocity" if steady else "breakaway",
            direction=item.direction,
            velocity=item.velocity if isinstance(item, SteadyRun) else 0.0,
            place=_place(by_name[item.log], item),
            measured=item.direction * (float(torque[number]) - driven),
            predicted=item.direction * (float(said[number]) - driven),
            stderr=float(variance[number]) ** 0.5,
        )
    return found


def _place(recording: Recording, item: SteadyRun | Breakaway) -> float:
    if isinstance(item, Breakaway):
        return item.place
    return float(np.interp(0.5 * (item.start_time + item.end_time), recording.time, recording.position))


def _tests(points: Sequence[HeldOut]) -> tuple[ResidualTest, ...]:
    """Order among the errors: signs over speed in each direction, trends with speed and place."""
    error = np.array([point.standardised for point in points])
    speed = np.array([abs(point.velocity) for point in points])
    sign = np.array([point.direction for point in points])
    place = np.array([point.place for point in points])
    found = []
    for direction in DIRECTIONS:
        own = sign == SIGN[direction]
        found.append(runs_test(error[own], speed[own], name=f"signs over speed, {direction}"))
        found.append(rank_test(error[own], speed[own], name=f"trend with speed, {direction}"))
    found.append(rank_test(error, place, name="trend with place"))
    return tuple(test for test in found if test is not None)

r"""What to record next: the runs that would most narrow the interval of a chosen quantity.

A run adds to the Fisher information of the law's parameters what its own datum says of them. A steady run at
speed v in a direction measures F_c + dF exp(-(v/v_s)^beta) + b v, with the error that runs of this rig have
shown; a ramp from rest measures F_s and, where ramps have done so, the motion after it the rest of the law.
With I the information so far and g the gradient of the quantity, its variance is g' I^-1 g. Runs are chosen
one by one, each the one that lowers the variance most (c-optimal design; Atkinson, Donev and Tobias 2007,
ch. 10). Candidates are the speeds that the rig has held, with the errors that they had, and slower ones down
to a fifth of the slowest where that is not yet far below v_s.

The best speeds depend on v_s, which may be the very thing that is not known. So the logarithm of the variance
is averaged over Stribeck velocities across the present uncertainty (ibid., ch. 18), and a parameter of which
nothing is known is taken to be known to a factor of e^3.

All derivatives are with respect to parameters in parts of their own size, so that no unit matters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from data.recording import FloatArray
from ident.evidence.gathering import Evidence
from ident.fit.confidence import quantile
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import friction_torque, law_of, residuals
from ident.fit.law_model import DIRECTIONS, SIGN, Direction
from ident.fit.slopes import slopes
from ident.fit.weighting import Weighted
from ident.model.friction import steepest_fall_factor

Quantity = Literal["stribeck_velocity", "static_torque", "critical_observer_gain"]
QUANTITIES: Final[tuple[Quantity, ...]] = ("stribeck_velocity", "static_torque", "critical_observer_gain")

RUNS: Final = 6  # that are advised for a quantity
SPEEDS: Final = 25  # candidates in each direction
SLOWER: Final = 5.0  # the slowest speed so far over the slowest that is thought possible
SLOW_ENOUGH: Final = 0.3  # of v_s: slower still is not asked for
PLAUSIBLE: Final = (-1.4, -0.7, 0.0, 0.7, 1.4)  # standard errors of log v_s that are averaged over
LARGEST_DOUBT: Final = 1.0  # of log v_s that is averaged over
NOTHING_KNOWN: Final = 3.0  # standard deviation of log of a parameter before any data
RAMP_TIME: Final = 20.0  # [s] to F_s, where no ramp was recorded


@dataclass(frozen=True)
class NextRun:
    """Runs of one kind to record."""

    protocol: Literal["constant_velocity", "breakaway"]
    direction: Direction
    speed: float | None  # [rad/s], magnitude; None for a breakaway
    ramp_rate: float | None  # [N m/s], magnitude; None for a constant velocity
    duration: float | None  # [s] that its error was reckoned with; None for a breakaway
    times: int
    half_width: float  # of the quantity's 95 % interval, expected after these and those before [its unit]


@dataclass(frozen=True)
class Advice:
    """The runs that narrow one quantity [rad/s, N m or 1/s] of one direction most, the best first."""

    direction: Direction
    quantity: Quantity
    half_width_now: float | None  # by the same reckoning; None: the data do not bound it
    runs: tuple[NextRun, ...]
    why_none: str | None = None  # where nothing can be advised

    @property
    def half_width_then(self) -> float | None:
        """With all of the runs [unit of the quantity]."""
        return self.runs[-1].half_width if self.runs else None

    @property
    def reduction(self) -> float | None:
        """Of the half-width, in parts of the present one."""
        now, then = self.half_width_now, self.half_width_then
        return None if now is None or then is None else 1.0 - then / now


@dataclass(frozen=True)
class _Candidate:
    """A run that may be advised: speed [rad/s], ramp rate [N m/s], duration [s]."""

    protocol: Literal["constant_velocity", "breakaway"]
    direction: Direction
    speed: float | None
    ramp_rate: float | None
    duration: float | None
    information: tuple[FloatArray, ...]  # (p, p) under each plausible law


def advise(evidence: Evidence, weighted: Weighted) -> tuple[Advice, ...]:
    """Advice for v_s, F_s and L_c of each direction that has a law."""
    laws = _plausible(weighted)
    known = tuple(_information(weighted, values) for values in laws)
    candidates = [
        candidate
        for direction in weighted.data.model.directions
        for candidate in _candidates(evidence, weighted, laws, direction)
    ]
    return tuple(
        _advice(weighted, laws, known, candidates, direction, quantity)
        for direction in weighted.data.model.directions
        for quantity in QUANTITIES
    )


def advise_without_map() -> tuple[Advice, ...]:
    """Where neither constant speeds nor breakaways were recorded: there is no law to plan with yet."""
    why = (
        "neither constant speeds nor ramps were recorded, which these rest on: record ten or more speeds in "
        "ratio from the slowest that the loop holds to the fastest, and three slow ramps from rest"
    )
    return tuple(Advice(way, quantity, None, (), why) for way in DIRECTIONS for quantity in QUANTITIES)


def _advice(
    weighted: Weighted,
    laws: Sequence[Mapping[str, float]],
    known: Sequence[FloatArray],
    candidates: Sequence[_Candidate],
    direction: Direction,
    quantity: Quantity,
) -> Advice:
    model = weighted.data.model
    flat = model.law_of(direction) in model.lines or weighted.fit.law(direction)[1] <= 0.0
    if flat and quantity != "static_torque":
        why = (
            "no Stribeck effect is seen in this direction: slower speeds and breakaways would show one, if "
            "there is any"
        )
        return Advice(direction, quantity, None, (), why)
    if quantity == "critical_observer_gain" and not weighted.data.has_inertia:
        why = "the inertia is not known: record ramps until the link runs, or a multisine about a bias speed"
        return Advice(direction, quantity, None, (), why)
    free = weighted.fit.free
    gradients = [_gradient(values, free, direction, quantity) for values in laws]
    if not all(np.all(np.isfinite(gradient)) for gradient in gradients):
        return Advice(direction, quantity, None, (), "for beta < 1 no finite L_c exists")
    size = abs(_value(weighted.fit.values, direction, quantity))
    data = weighted.data.torque.size + weighted.data.start_torque.size - len(free)
    now = quantile(data) * size * float(np.exp(0.5 * _log_variance(known, gradients)))
    chosen: list[tuple[_Candidate, float]] = []
    current = list(known)
    for number in range(RUNS):
        scores = [
            _log_variance([a + b for a, b in zip(current, one.information, strict=True)], gradients)
            for one in candidates
        ]
        best = int(np.argmin(scores))
        current = [a + b for a, b in zip(current, candidates[best].information, strict=True)]
        width = quantile(data + number + 1) * size * float(np.exp(0.5 * scores[best]))
        chosen.append((candidates[best], width))
    return Advice(direction, quantity, now if now < size * NOTHING_KNOWN else None, _grouped(chosen))


def _grouped(chosen: Sequence[tuple[_Candidate, float]]) -> tuple[NextRun, ...]:
    """The same run asked for several times is one line."""
    runs: dict[int, NextRun] = {}
    for one, width in chosen:
        before = runs.pop(id(one), None)
        runs[id(one)] = NextRun(
            one.protocol,
            one.direction,
            one.speed,
            one.ramp_rate,
            one.duration,
            1 if before is None else before.times + 1,
            width,
        )
    return tuple(runs.values())


def _log_variance(information: Sequence[FloatArray], gradients: Sequence[FloatArray]) -> float:
    """Mean over the plausible laws of log g' I^-1 g, in parts of the quantity."""
    found = [
        np.log(gradient @ np.linalg.solve(one, gradient))
        for one, gradient in zip(information, gradients, strict=True)
    ]
    return float(np.mean(found))


def _plausible(weighted: Weighted) -> list[Mapping[str, float]]:
    """The fitted values with Stribeck velocities across their uncertainty."""
    fit = weighted.fit
    laws: list[Mapping[str, float]] = []
    for shift in PLAUSIBLE:
        values = dict(fit.values)
        for law in weighted.data.model.laws:
            name = f"{law}_stribeck_velocity"
            if name not in fit.free:
                continue
            where = fit.free.index(name)
            doubt = float(np.sqrt(fit.covariance[where, where])) / values[name]
            values[name] *= float(np.exp(shift * min(doubt, LARGEST_DOUBT)))
        laws.append(values)
    return laws


def _information(weighted: Weighted, values: Mapping[str, float]) -> FloatArray:
    """What all data so far say of the parameters in parts of their size (p, p), nothing known included."""
    own = _derivative(lambda changed: residuals(weighted.data, changed), values, weighted.fit.free)
    return np.asarray(own.T @ own + np.eye(own.shape[1]) / NOTHING_KNOWN**2)


def _derivative(
    function: Callable[[Mapping[str, float]], FloatArray], values: Mapping[str, float], free: Sequence[str]
) -> FloatArray:
    """Derivatives (n, p) of a function of the values, with respect to the free ones in parts of their
    size.
    """
    return slopes(function, values, free) * [_size(values, name) for name in free]


def _size(values: Mapping[str, float], name: str) -> float:
    """A parameter's own size; a Stribeck torque or damping that ended at 0 is felt as F_c is."""
    if values[name] != 0.0:
        return abs(values[name])
    direction = name.partition("_")[0]
    return values.get(f"{direction}_coulomb_torque", 1.0) or 1.0


def _value(values: Mapping[str, float], direction: Direction, quantity: Quantity) -> float:
    coulomb, stribeck, velocity, damping, shape = law_of(values, direction)
    if quantity == "stribeck_velocity":
        return velocity
    if quantity == "static_torque":
        return coulomb + stribeck
    return (steepest_fall_factor(shape) * stribeck / velocity - damping) / values["inertia"]


def _gradient(
    values: Mapping[str, float], free: Sequence[str], direction: Direction, quantity: Quantity
) -> FloatArray:
    """Derivatives (p,) of a quantity in parts of its size."""

    def own(changed: Mapping[str, float]) -> FloatArray:
        return np.array([_value(changed, direction, quantity)])

    with np.errstate(invalid="ignore"):  # beta < 1: infinite less infinite
        return np.asarray(_derivative(own, values, free)[0] / abs(_value(values, direction, quantity)))


def _candidates(
    evidence: Evidence, weighted: Weighted, laws: Sequence[Mapping[str, float]], direction: Direction
) -> list[_Candidate]:
    found = [_ramp(evidence, weighted, laws, direction)]
    duration = float(np.median([run.end_time - run.start_time for run in evidence.used_runs]))
    order = np.argsort(weighted.data.speed)
    speeds, errors = np.log(weighted.data.speed[order]), np.log(weighted.data.run_stderr[order])
    slowest, fastest = (float(end) for end in np.exp(speeds[[0, -1]]))
    velocity = law_of(weighted.fit.values, direction)[2]
    slowest = min(slowest, max(slowest / SLOWER, SLOW_ENOUGH * velocity))
    for speed in np.geomspace(slowest, fastest, SPEEDS).tolist():
        error = float(np.exp(np.interp(np.log(speed), speeds, errors)))
        information = []
        for values in laws:
            row = _derivative(
                lambda changed, at=speed: _friction(changed, direction, at),  # type: ignore[misc]
                values,
                weighted.fit.free,
            )
            information.append(row.T @ row / error**2)
        found.append(_Candidate("constant_velocity", direction, speed, None, duration, tuple(information)))
    return found


def _friction(values: Mapping[str, float], direction: Direction, speed: float) -> FloatArray:
    return friction_torque(law_of(values, direction), np.array([speed]))


def _ramp(
    evidence: Evidence, weighted: Weighted, laws: Sequence[Mapping[str, float]], direction: Direction
) -> _Candidate:
    """A ramp like those recorded; its motion tells what the motion of theirs tells on average."""
    data = weighted.data
    rates = [abs(start.line.rate) for start in evidence.used_starts]
    static = _value(weighted.fit.values, direction, "static_torque")
    rate = float(np.median(rates)) if rates else static / RAMP_TIME
    typical = data.start_stderr if data.start_stderr.size else data.run_stderr
    error = float(np.median(typical))
    moved = [motion.direction == SIGN[direction] for motion in data.momenta]
    nothing = _without_steady(data, moved)
    information = []
    for values in laws:
        row = _derivative(
            lambda changed: np.array([_value(changed, direction, "static_torque")]), values, weighted.fit.free
        )
        own = row.T @ row / error**2
        if any(moved):
            motion = _derivative(lambda changed: residuals(nothing, changed), values, weighted.fit.free)
            own = own + motion.T @ motion / sum(moved)
        information.append(own)
    return _Candidate("breakaway", direction, None, rate, None, tuple(information))


def _without_steady(data: FitData, kept: Sequence[bool]) -> FitData:
    """The data with nothing left but the motion of some ramps."""
    none = np.zeros(0)
    nowhere = np.zeros(0, dtype=np.int64)
    motions = [
        pair for pair, keep in zip(zip(data.momenta, data.whitening, strict=True), kept, strict=True) if keep
    ]
    return replace(
        data,
        run_direction=nowhere,
        speed=none,
        torque=none,
        acceleration=none,
        run_stderr=none,
        start_direction=nowhere,
        start_torque=none,
        start_stderr=none,
        momenta=tuple(motion for motion, _ in motions),
        whitening=tuple(whitening for _, whitening in motions),
        inertia=None,
    )

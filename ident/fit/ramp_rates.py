r"""F_s at a ramp rate of zero, from breakaways under several rates.

A set-valued law starts at F_s however fast the torque rises; the delay of detection is not part of it and has
been taken off before. The contacts of real joints need time, and the onset moves with the rate u', in one
commercial arm from 3.0 to 5.2 N m over five rates. Two models are held against no trend at all,

    F(u') = F_s + c u'                linear, or
    F(u') = F_s + c ln(1 + u'/u'_0)   logarithmic, and straight below a rate u'_0,

c of each direction, in weighted least squares with one scatter for all. A logarithm alone has no limit at
rest, so u'_0 has to be finite; it is looked for from a tenth of the slowest rate to ten times the fastest,
beyond which the second model is the first. The trend is taken where its F ratio could hardly be chance, and
where it is more than what all ramps of a rate, often of one log, may share would make of none: a delay of
detection that is wrong in all alike, and the spread from run to run that the steady runs show.

For the zero-rate value the models are averaged, every u'_0 by its likelihood, and its error holds the error
within each and the spread between them (Burnham and Anderson 2002, sec. 4.3): a line and a logarithm that
fit equally well disagree below the slowest rate. That is what extrapolation costs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from data.findings import Finding, Severity
from data.recording import FloatArray

RateShape = Literal["linear", "logarithmic"]
BENDS: Final = 16  # values of u'_0 that are tried
REACH: Final = 10.0  # by which u'_0 may lie below the slowest and above the fastest rate
CHANCE: Final = 0.001  # of a trend where there is none, for each of two shapes
APART: Final = 1.3  # ratio of two rates that differ
TINY: Final = float(np.finfo(np.float64).tiny)
CLEAR: Final = 3.0  # times the shared error
MATTERS: Final = 0.005  # part of F_s by which it has to rise or fall
SPARE: Final = 3  # least number of breakaways beyond the parameters


@dataclass(frozen=True)
class ZeroRate:
    """The onset torque of one direction at a ramp rate of zero, magnitudes."""

    torque: float  # [N m]
    stderr: float  # [N m], from the scatter about the trend, within and between the shapes
    rise: float  # from zero rate to the fastest [N m]
    widening: float  # stderr over that of a mean without a trend, as given [-]


@dataclass(frozen=True)
class RateTrend:
    """A rise of the onset torque with the ramp rate that is no chance."""

    shape: RateShape  # which AICc prefers
    preference: float  # AICc of the other shape less its own [-]
    chance: float  # p value of the trend [-]
    rates: tuple[float, float]  # slowest and fastest [N m/s]
    zero: Mapping[int, ZeroRate]  # of each direction with several rates
    excess: FloatArray  # (m,) onset torque of each breakaway over that at zero rate [N m]

    def widening(self, direction: NDArray[np.int64]) -> FloatArray:
        """Factors (m,) on errors, under which breakaways as independent data know F_s as the trend does."""
        factor = {sign: zero.widening for sign, zero in self.zero.items()}
        return np.array([factor.get(int(sign), 1.0) for sign in direction])


@dataclass(frozen=True)
class _Fitted:
    """One shape in every direction that has several rates."""

    rise: FloatArray  # (m,) u' [N m/s] or ln(1 + u'/u'_0) [-]
    squares: float  # sum of squares in standard errors [-]
    coefficients: Mapping[int, FloatArray]  # direction -> F_s, c
    covariance: Mapping[int, FloatArray]  # direction -> (2, 2), for standard errors as given


def rate_trend(
    direction: NDArray[np.int64],
    rate: FloatArray,
    torque: FloatArray,
    stderr: FloatArray,
    shared_error: FloatArray,
) -> RateTrend | None:
    """The trend over the rates, or None where there is none to speak of.

    Parameters
    ----------
    direction : (m,) +1 or -1
    rate : (m,) magnitudes [N m/s]
    torque : (m,) at the onset, magnitudes [N m]
    stderr : (m,) of it, correct up to a common factor [N m]
    shared_error : (m,) what may be wrong in all breakaways of a rate alike [N m]
    """
    told = [sign for sign in (1, -1) if _several(rate[direction == sign])]
    seen = np.isin(direction, told)
    data, free = int(seen.sum()), 2 * len(told)
    if not told or data - free < SPARE:
        return None
    slowest, fastest = float(rate[seen].min()), float(rate[seen].max())
    bends = np.geomspace(slowest / REACH, fastest * REACH, BENDS)
    line, at_slowest, *curves = (
        _fitted(told, direction, rise, torque, stderr)
        for rise in (rate, *(np.log1p(rate / bend) for bend in (slowest, *bends)))
    )
    flat = sum(_squares_about_mean(torque[direction == s], stderr[direction == s]) for s in told)
    left = max(min(line.squares, at_slowest.squares), TINY)
    chance = float(fisher.sf((flat - left) / len(told) / (left / (data - free)), len(told), data - free))
    if not chance < CHANCE:
        return None
    bent = min(curve.squares for curve in curves)
    preference = _aicc(line.squares, data, free) - _aicc(bent, data, free + 1)
    weights = _likelihoods([line, *curves], data)
    zero, excess = {}, np.zeros_like(torque)
    for sign in told:
        own = direction == sign
        for weight, fit in zip(weights, [line, *curves], strict=True):
            excess[own] += weight * float(fit.coefficients[sign][1]) * fit.rise[own]
        value, error = _at_zero(sign, [line, *curves], weights, spare=data - free)
        rise = float(excess[own][np.argmax(rate[own])])
        mean_error = float(np.sum(stderr[own] ** -2.0)) ** -0.5
        zero[sign] = ZeroRate(value, error, rise, error / mean_error)
    least = max(MATTERS * float(np.median(torque[seen])), CLEAR * float(shared_error[seen].max()))
    if max(abs(found.rise) for found in zero.values()) < least:
        return None
    shape: RateShape = "logarithmic" if preference > 0 else "linear"
    return RateTrend(shape, abs(preference), chance, (slowest, fastest), zero, excess)


def trend_finding(trend: RateTrend, *, unit: str) -> Finding:
    """What the trend does to F_s, with its numbers."""
    each = "; ".join(
        f"{'positive' if sign > 0 else 'negative'} direction: {zero.rise:+.3g} {unit} from zero rate to the "
        f"fastest, F_s = {zero.torque:.4g} {unit} at zero rate with a standard error of {zero.stderr:.2g}"
        for sign, zero in trend.zero.items()
    )
    text = (
        f"the breakaway torque changes with the ramp rate, between {trend.rates[0]:.3g} and "
        f"{trend.rates[1]:.3g} {unit}/s, by more than chance (p = {trend.chance:.1g}); a {trend.shape} trend "
        f"is preferred, by {trend.preference:.1f} in AICc. {each}. F_s is the value at zero rate, and its "
        "interval holds what the extrapolation costs. Slower ramps narrow it."
    )
    return Finding("E-CREEP", Severity.WARN, text)


def _several(rate: FloatArray) -> bool:
    return bool(rate.size > 2 and rate.max() > APART * rate.min())


def _squares_about_mean(torque: FloatArray, stderr: FloatArray) -> float:
    mean = np.average(torque, weights=stderr**-2.0)
    return float(np.sum(((torque - mean) / stderr) ** 2))


def _fitted(
    told: Sequence[int],
    direction: NDArray[np.int64],
    rise: FloatArray,
    torque: FloatArray,
    stderr: FloatArray,
) -> _Fitted:
    """Weighted least squares of F_s + c rise in each of the directions `told`."""
    squares, coefficients, covariance = 0.0, {}, {}
    for sign in told:
        own = direction == sign
        weight = 1.0 / stderr[own]
        basis = np.column_stack([weight, weight * rise[own]])
        solved, *_ = np.linalg.lstsq(basis, weight * torque[own], rcond=None)
        squares += float(np.sum((weight * torque[own] - basis @ solved) ** 2))
        coefficients[sign], covariance[sign] = solved, np.linalg.inv(basis.T @ basis)
    return _Fitted(rise, squares, coefficients, covariance)


def _aicc(squares: float, data: int, parameters: int) -> float:
    """Of least squares with an unknown scatter, which counts as a parameter; infinite where data are few."""
    k = parameters + 1
    if data - k - 1 <= 0:
        return float("inf")
    return float(data * np.log(max(squares, TINY) / data) + 2 * k + 2 * k * (k + 1) / (data - k - 1))


def _likelihoods(fits: Sequence[_Fitted], data: int) -> FloatArray:
    """Weights of fits with equally many parameters (n,), of sum 1."""
    squares = np.array([max(fit.squares, TINY) for fit in fits])
    weight = (squares.min() / squares) ** (0.5 * data)
    return np.asarray(weight / weight.sum())


def _at_zero(sign: int, fits: Sequence[_Fitted], weights: FloatArray, *, spare: int) -> tuple[float, float]:
    """F_s averaged over the fits [N m] and its standard error, from their own scatter and their spread."""
    value = np.array([fit.coefficients[sign][0] for fit in fits])
    within = np.array([max(1.0, fit.squares / spare) * fit.covariance[sign][0, 0] for fit in fits])
    mean = float(weights @ value)
    return mean, float(weights @ (within + (value - mean) ** 2)) ** 0.5

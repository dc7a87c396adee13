r"""Intervals: from the covariance where chi-square is a parabola, from the profile where it is not.

The residuals are in standard errors that were themselves estimated, so t and F quantiles with the degrees of
freedom of the data stand where normal ones would promise too much. The profile of a parameter is the least
chi-square with that parameter held; its interval ends where the profile has risen by t^2 (Bates and Watts
1988, ch. 6). Where it never rises so far the interval is open on that side: the data do not bound the
parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from data.recording import FloatArray

Residuals = Callable[[FloatArray], FloatArray]

LEVEL = 0.95
REACH = 12  # steps outwards before an interval is called open
TOLERANCE = 0.01  # of the height at which an end is taken as found


@dataclass(frozen=True)
class Interval:
    """A 95 % interval [unit of the parameter]; None for an end that the data do not bound."""

    low: float | None
    high: float | None


def quantile(dof: float) -> float:
    """Two-sided 95 % quantile of Student's t with so many degrees of freedom, at least one."""
    return float(student.ppf(0.5 + 0.5 * LEVEL, max(dof, 1.0)))


def symmetric(value: float, stderr: float, dof: int, *, least: float | None = None) -> Interval:
    """value +- t stderr, cut at `least`, below which the parameter cannot lie."""
    reach = quantile(dof) * stderr
    low = value - reach
    return Interval(low if least is None else max(low, least), value + reach)


def profiled(
    residual: Residuals, best: FloatArray, index: int, *, stderr: float, dof: int, least: FloatArray
) -> Interval:
    """Profile-likelihood interval of parameter `index`.

    Parameters
    ----------
    residual : of parameters (p,) to residuals in standard errors
    best : (p,) the parameters of the least chi-square
    stderr : of the parameter, for the first step
    least : (p,) lower bounds of the parameters
    """
    height = quantile(dof) ** 2
    base = float(np.sum(residual(best) ** 2))
    low = _end(residual, best, index, -stderr, base=base, height=height, least=least)
    high = _end(residual, best, index, stderr, base=base, height=height, least=least)
    return Interval(low, high)


def _end(
    residual: Residuals,
    best: FloatArray,
    index: int,
    step: float,
    *,
    base: float,
    height: float,
    least: FloatArray,
) -> float | None:
    """Where the profile has risen by `height`, going from the best value in the direction of `step`."""
    rest = np.delete(np.arange(best.size), index)
    held = best.copy()

    def rise(value: float) -> float:
        held[index] = value

        def free(x: FloatArray) -> FloatArray:
            held[rest] = x
            return residual(held)

        start = np.maximum(held[rest], least[rest] + 1e-9 * (1e-300 + np.abs(best[rest])))
        result = least_squares(free, start, bounds=(least[rest], np.inf), x_scale="jac")
        held[rest] = result.x
        return float(2.0 * result.cost) - base

    inside, inside_rise = float(best[index]), 0.0
    outside = inside + float(np.sqrt(height)) * step
    for _ in range(REACH):
        if outside <= least[index]:
            outside = float(least[index]) + 1e-6 * (inside - float(least[index]))
            if rise(outside) < height:
                return None
        outside_rise = rise(outside)
        if outside_rise >= height:
            return _between(rise, (inside, inside_rise), (outside, outside_rise), height)
        inside, inside_rise = outside, outside_rise
        outside = float(best[index]) + 1.6 * (outside - float(best[index]))
    return None


def _between(
    rise: Callable[[float], float], inside: tuple[float, float], outside: tuple[float, float], height: float
) -> float:
    """The crossing between two values, on the square root of the rise, which is nearly straight."""
    for _ in range(12):
        low, high = (np.sqrt(max(point[1], 0.0)) for point in (inside, outside))
        share = min(max((np.sqrt(height) - low) / (high - low), 0.05), 0.95)
        value = inside[0] + share * (outside[0] - inside[0])
        reached = rise(value)
        if abs(reached - height) <= TOLERANCE * height:
            return float(value)
        if reached < height:
            inside = (value, reached)
        else:
            outside = (value, reached)
    return 0.5 * (inside[0] + outside[0])

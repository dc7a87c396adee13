"""Intervals and how far they reach.

The residuals are in standard errors that were themselves estimated, so t and F quantiles with the degrees of
freedom of the data stand where normal ones would promise too much.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import t as student

LEVEL = 0.95


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

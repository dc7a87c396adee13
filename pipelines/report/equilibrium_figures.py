"""Figures 4 and 8: how far from the set point the loop can come to rest, over the observer gain."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from data.recording import FloatArray
from pipelines.report.style import styled


@styled
def figure4(
    observer_gain: FloatArray,
    exact: FloatArray,
    uncompensated: FloatArray,
    *,
    critical_gain: float | None,
    title: str = "Steady-state error with exact and without compensation",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Extrema of x1 at rest. observer_gain (n,) [1/s]; exact, uncompensated (n, 2): least and largest x1 [rad]."""
    raise NotImplementedError


@styled
def figure8(
    observer_gain: FloatArray,
    edges: Mapping[float, FloatArray],
    *,
    critical_gain: float | None,
    title: str = "Steady-state error with non-exact compensation",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Extrema of |x1| at rest. edges[r] is (n, 2): outer and inner edge [rad]; NaN where there is none."""
    raise NotImplementedError

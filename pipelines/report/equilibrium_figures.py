"""Figures 4 and 8: how far from the set point the loop can come to rest, over the observer gain.

At rest the position lies in a set whose extrema are eqs (9)-(10)'s. Figure 4 sets exact compensation (r =
1) against none (r = 0); figure 8 shows what a compensation that is not exact leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from data.recording import FloatArray
from pipelines.report.axis_units import units_of
from pipelines.report.style import BLUE, INK, MUTED, OVER, UNDER, new_figure, styled, zero_lines

_CROWDED = 0.2  # of the axis; the median of an even one lies at its middle
_POLE = 2.0  # times what is seen after the first tenth of the gains


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
    """Extrema of x1 at rest: (n,) gains [1/s]; `exact` (r = 1) and `uncompensated` (r = 0), (n, 2) [rad].

    `critical_gain` is where the exact set shrinks to a point [1/s]; None where no finite gain does that.
    """
    figure = new_figure(title, height=3.6, subtitle=subtitle, simulated=simulated)
    axes = figure.subplots()
    zero_lines(axes)
    axes.plot(observer_gain, uncompensated, color=MUTED, zorder=3)
    axes.fill_between(observer_gain, *uncompensated.T, color=MUTED, alpha=0.10, linewidth=0)
    axes.plot(observer_gain, exact, color=BLUE, zorder=3.2)
    axes.fill_between(observer_gain, *exact.T, color=BLUE, alpha=0.28, linewidth=0, zorder=2)
    _show_gains(axes, observer_gain)
    high, low = _shown_end(observer_gain, uncompensated), -_shown_end(observer_gain, -uncompensated)
    axes.annotate(
        "no compensation, r = 0", (observer_gain[-1], float(np.max(uncompensated[-1]))), (-8, -8),
        textcoords="offset points", ha="right", va="top", color=MUTED,
    )  # fmt: skip
    axes.annotate(
        "exact compensation, r = 1", (observer_gain[0], min(float(np.max(exact[0])), 0.8 * high)), (8, 3),
        textcoords="offset points", color=BLUE,
    )  # fmt: skip
    if critical_gain is not None:
        _mark_critical(axes, critical_gain)
    axes.set(
        xlabel="observer gain $L$ [1/s]", ylabel=f"position error at rest $x_1$ [{units_of(axis).position}]"
    )
    if high > low:
        axes.set_ylim(1.1 * low, 1.1 * high)
    return figure


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
    """Extrema of |x1| at rest: (n,) gains [1/s]; edges[r] is (n, 2), outer and inner edge [rad].

    NaN stands where no such edge exists. Inner edges (the set does not touch the set point) are dashed.
    """
    figure = new_figure(title, height=3.9, subtitle=subtitle, simulated=simulated)
    axes = figure.subplots()
    for r, colour in _colours(sorted(edges)).items():
        outer, inner = edges[r].T
        axes.plot(
            observer_gain,
            outer,
            color=colour,
            linewidth=2.2 if r == 1 else 1.6,
            label=f"$r$ = {r:g}",
            zorder=3,
        )
        axes.plot(
            observer_gain, np.where(inner > 0, inner, np.nan), color=colour, linestyle=(0, (4, 2)), zorder=3
        )
    if critical_gain is not None:
        _mark_critical(axes, critical_gain)
    axes.set(
        xlabel="observer gain $L$ [1/s]", ylabel=f"position error at rest $|x_1|$ [{units_of(axis).position}]"
    )
    _show_gains(axes, observer_gain)
    high = max((_shown_end(observer_gain, curve) for curve in edges.values()), default=0.0)
    axes.set_ylim(0.0, 1.05 * high if high > 0 else None)
    figure.legend(loc="outside right center", handlelength=1.4)
    return figure


def _show_gains(axes: Axes, observer_gain: FloatArray) -> None:
    """The axis of gains as they are spread: by ratios where most of them crowd at its lower end."""
    if observer_gain.size and np.median(observer_gain) < _CROWDED * observer_gain[-1]:
        axes.set_xscale("log")
    axes.set_xlim(observer_gain[0], observer_gain[-1])


def _shown_end(observer_gain: FloatArray, curve: FloatArray) -> float:
    """How high to show curves (n, 2) over gains (n,): all of them, or what is no pole at their lower end.

    A set grows beyond bounds as b + L J goes to 0, and would press all else to the axis.
    """
    finite = np.where(np.isfinite(curve), curve, 0.0)
    whole = float(np.max(finite, initial=0.0))
    settled = float(np.max(finite[observer_gain.size // 10 :], initial=0.0))
    return min(whole, _POLE * settled) if settled > 0 else whole


def _mark_critical(axes: Axes, gain: float) -> None:
    axes.axvline(gain, color=INK, linewidth=1.0, linestyle=(0, (1.5, 2)), zorder=2.5)
    axes.annotate(
        f"$L_c$ = {gain:.2f}", (gain, 1.0), (4, -2), xycoords=("data", "axes fraction"),
        textcoords="offset points", va="top",
    )  # fmt: skip


def _colours(values: Sequence[float]) -> dict[float, str]:
    """Blue below 1 and orange above, paler with the distance; exact compensation in ink."""
    under = [r for r in values if r < 1]
    over = [r for r in values if r > 1]
    colours = {r: UNDER[max(len(UNDER) - len(under) + k, 0)] for k, r in enumerate(under)}
    colours |= {r: INK for r in values if r == 1}
    colours |= {r: OVER[min(k, len(OVER) - 1)] for k, r in enumerate(over)}
    return colours

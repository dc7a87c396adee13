"""Figure 9: where the closed loop ends up over a gain, predicted.

Equilibrium sets are filled from their least to their largest x1, limit cycles are drawn by max|x1| over a
period, unstable equilibria are dashed; (I), (II) and (III) name them as the paper does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from compensation.bifurcation import Branch, Diagram, Point
from data.recording import FloatArray
from pipelines.report.axis_units import units_of
from pipelines.report.marked_values import DOTTED, mark_values
from pipelines.report.style import BLUE, INK, VERMILLION, new_figure, styled, zero_lines

_PARAMETER: Final = {"r": "compensation gain $r$", "L": "observer gain $L$ [1/s]"}
_ROMAN: Final = {"limit_cycle": "(I)", "equilibrium_set": "(II)", "equilibrium": "(III)"}
_SET_OPACITY: Final = 0.25


@styled
def figure9(
    diagram: Diagram,
    *,
    title: str = "Predicted bifurcation diagram",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """All branches and bifurcations of `diagram` over its parameter."""
    figure = new_figure(title, height=4.1, subtitle=subtitle, simulated=simulated)
    axes = figure.subplots()
    zero_lines(axes)
    named: set[str] = set()
    for branch in sorted(diagram.branches, key=lambda branch: -len(branch.points)):
        draw_branch(axes, branch, cycle=VERMILLION, rest=BLUE)
        if branch.kind not in named and len(branch.points) > 1:
            _name(axes, branch)
            named.add(branch.kind)
    unit = units_of(axis).position
    axes.set(
        xlabel=_PARAMETER.get(diagram.parameter, diagram.parameter),
        ylabel=f"$x_1$ at rest, $\\max|x_1|$ of a cycle [{unit}]",
    )
    axes.margins(x=0.0)
    mark_values(axes, diagram.parameter, [change.value for change in diagram.bifurcations])
    handles = _legend(diagram)
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles) if len(handles) < 4 else 3)
    return figure


def draw_branch(axes: Axes, branch: Branch, *, cycle: str, rest: str) -> None:
    """One branch: a filled set, a line of amplitudes, or a line of equilibria; dashed where unstable."""
    value, low, high, amplitude = branch_arrays(branch.points)
    dashes = "-" if branch.stable else (0, (4, 2.2))
    dot = "o" if value.size == 1 else "none"  # no line shows what exists at one value only
    if branch.kind == "limit_cycle":
        axes.plot(
            value,
            amplitude,
            color=cycle,
            linestyle=dashes,
            linewidth=2.0,
            marker=dot,
            markersize=4,
            zorder=3.2,
        )
    elif branch.kind == "equilibrium_set":
        axes.fill_between(value, low, high, color=rest, alpha=_SET_OPACITY, linewidth=0, zorder=2)
        for edge in (low, high):
            axes.plot(
                value, edge, color=rest, linestyle=dashes, linewidth=1.2, marker=dot, markersize=3, zorder=2.6
            )
        if value.size == 1:
            axes.vlines(value, low, high, color=rest, alpha=_SET_OPACITY, linewidth=3, zorder=2)
    else:
        axes.plot(
            value, 0.5 * (low + high), color=INK, linestyle=dashes, linewidth=1.4, marker=dot, markersize=4,
            zorder=3,
        )  # fmt: skip


def branch_arrays(points: Sequence[Point]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Value, x1_min, x1_max [rad], max|x1| [rad] along a branch, each (n,)."""
    rows = [(point.value, point.x1_min, point.x1_max, point.amplitude) for point in points]
    value, low, high, amplitude = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return value, low, high, amplitude


def _name(axes: Axes, branch: Branch) -> None:
    """The branch's roman number, above a line or inside the wider half of a set."""
    value, low, high, amplitude = branch_arrays(branch.points)
    if not value.size:
        return
    at = value.size // 3 if branch.kind == "equilibrium_set" else value.size // 2
    wider = low if abs(low[at]) >= abs(high[at]) else high
    inside = 0.5 * wider if low[at] * high[at] <= 0.0 else 0.5 * (low + high)
    heights = {"limit_cycle": amplitude, "equilibrium_set": inside}
    offsets = {"limit_cycle": (-6, 8), "equilibrium_set": (0, 0)}
    axes.annotate(
        _ROMAN.get(branch.kind, ""), (value[at], heights.get(branch.kind, high)[at]),
        offsets.get(branch.kind, (0, 10)), textcoords="offset points", ha="center", va="center",
        fontweight="bold", zorder=5,
    )  # fmt: skip


def _legend(diagram: Diagram) -> list[Line2D | Patch]:
    kinds = {(branch.kind, branch.stable) for branch in diagram.branches if len(branch.points) > 1}
    handles: list[Line2D | Patch] = []
    if ("limit_cycle", True) in kinds:
        handles.append(
            Line2D([], [], color=VERMILLION, linewidth=2, label="(I) stable limit cycle, $\\max|x_1|$")
        )
    if ("limit_cycle", False) in kinds:
        handles.append(Line2D([], [], color=VERMILLION, linestyle="--", label="unstable limit cycle"))
    if {("equilibrium_set", True), ("equilibrium_set", False)} & kinds:
        handles.append(Patch(facecolor=BLUE, alpha=_SET_OPACITY, label="(II) equilibrium set"))
    if ("equilibrium", False) in kinds:
        handles.append(Line2D([], [], color=INK, linestyle="--", label="(III) unstable equilibrium point"))
    if ("equilibrium", True) in kinds:
        handles.append(Line2D([], [], color=INK, label="stable equilibrium point"))
    if diagram.bifurcations:
        handles.append(Line2D([], [], color=INK, linestyle=DOTTED, linewidth=0.9, label="bifurcation"))
    return handles

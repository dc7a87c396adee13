"""Figure 2: friction measurements and the friction model fitted to them.

On the left every measurement over the signed velocity, as the paper draws it; on the right the magnitudes
over the speed, spread out towards rest so that the Stribeck part can be judged and the two directions lie
over each other. A run that was left out stays visible, as a hollow mark; where the law is fitted to something
else than was measured (a breakaway at zero ramp rate, a torque without its offset), a short dash stays where
it was measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ident.evidence.friction_map import MapPoint
from ident.model.friction import StribeckCurve
from pipelines.report.axis_units import units_of
from pipelines.report.speed_axis import speed_axis
from pipelines.report.style import DIRECTION_COLOUR, DIRECTION_NAME, INK, key, new_figure, styled, zero_lines

_STRIBECK_RANGE: Final = 10.0  # Stribeck velocities that the right panel shows
_WITHOUT_POINTS: Final = 2.5  # [rad/s], how far a model without measurements is drawn
_WIDE: Final = 1.96  # standard errors to either side of a 95 % bar
_MEASURED: Final = "_"


@styled
def figure2(
    points: Sequence[MapPoint],
    curves: Mapping[int, StribeckCurve],
    *,
    title: str = "Friction measurements and friction model",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Measurements as dots with 95 % bars, runs left out as hollow marks, the friction of each direction that
    is known (+1, -1) as a solid line.
    """
    drawn = [point for point in points if math.isfinite(point.velocity) and math.isfinite(point.torque)]
    figure = new_figure(title, height=3.9, simulated=simulated)
    whole, slow = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
    units = units_of(axis)
    _draw_whole(whole, drawn, curves)
    whole.set(xlabel=f"velocity [{units.velocity}]", ylabel=f"friction {units.effort} [{units.torque}]")
    whole.set_title("both directions")
    _draw_slow(slow, drawn, curves)
    slow.set(xlabel=f"speed [{units.velocity}], logarithmic", ylabel=f"magnitude [{units.torque}]")
    slow.set_title("the Stribeck part")
    handles = _legend(drawn, curves)
    figure.legend(handles=handles, loc="outside lower center", ncols=5, columnspacing=1.3)
    return figure


def _draw_whole(axes: Axes, points: Sequence[MapPoint], curves: Mapping[int, StribeckCurve]) -> None:
    zero_lines(axes)
    fastest = max((abs(point.velocity) for point in points), default=_WITHOUT_POINTS)
    speed = np.geomspace(1e-4, 1.0, 400) * fastest * 1.03
    for sign, curve in curves.items():
        axes.plot(sign * speed, sign * curve.total(speed), color=DIRECTION_COLOUR[sign], zorder=3)
    if len(curves) == 2:
        rest = [sign * curve.static_torque for sign, curve in curves.items()]
        axes.plot((0.0, 0.0), rest, color=INK, linewidth=1.6, zorder=2.8)
    for point in points:
        _mark(axes, point, velocity=point.velocity, side=1)


def _draw_slow(axes: Axes, points: Sequence[MapPoint], curves: Mapping[int, StribeckCurve]) -> None:
    moving = sorted(abs(point.velocity) for point in points if abs(point.velocity) > 0)
    slowest = moving[0] if moving else 0.01
    fastest = moving[-1] if moving else 1.0
    if curves:
        velocities = [curve.stribeck_velocity for curve in curves.values()]
        fastest = max(min(fastest, _STRIBECK_RANGE * max(velocities)), 2.0 * slowest)
    floor = speed_axis(axes, slowest=slowest, fastest=fastest)
    speed = np.concatenate(([0.0], np.geomspace(1e-2 * floor, 1.15 * fastest, 400)))
    for direction, curve in curves.items():
        axes.plot(speed, curve.total(speed), color=DIRECTION_COLOUR[direction], zorder=3)
    for point in points:
        if abs(point.velocity) <= 1.15 * fastest:
            _mark(axes, point, velocity=abs(point.velocity), side=point.direction)


def _mark(axes: Axes, point: MapPoint, *, velocity: float, side: int) -> None:
    """A point as the law is fitted to it, times `side`, and where it was measured."""
    colour = DIRECTION_COLOUR[point.direction]
    if _is_shifted(point):
        axes.plot(velocity, side * point.torque, color=colour, marker=_MEASURED, markersize=5.0, zorder=2.6)
    axes.errorbar(
        velocity,
        side * (point.torque if point.fitted is None else point.fitted),
        yerr=_WIDE * point.stderr if point.used and point.stderr else None,
        marker="D" if point.protocol == "breakaway" else "o",
        markersize=3.4 if point.protocol == "breakaway" else 3.8,
        color=colour,
        markerfacecolor=colour if point.used else "none",
        markeredgecolor=INK if point.used else colour,
        markeredgewidth=0.35 if point.used else 1.1,
        elinewidth=0.9,
        capsize=0,
        zorder=4 if point.used else 2.5,
    )


def _is_shifted(point: MapPoint) -> bool:
    """Whether the law is fitted to something that lies visibly off the measurement."""
    return point.fitted is not None and abs(point.fitted - point.torque) > 0.5 * (point.stderr or 0.0)


def _legend(points: Sequence[MapPoint], curves: Mapping[int, StribeckCurve]) -> list[Line2D]:
    handles = []
    for sign in (1, -1):
        marker = "o" if any(point.direction == sign for point in points) else ""
        line = 1.6 if sign in curves else 0.0
        if marker or line:
            handles.append(key(DIRECTION_NAME[sign], marker=marker, colour=DIRECTION_COLOUR[sign], line=line))
    protocols = {point.protocol for point in points}
    if "constant_velocity" in protocols:
        handles.append(key("constant velocity, with 95 % bar", marker="o"))
    if "breakaway" in protocols:
        handles.append(key("breakaway", marker="D"))
    if any(_is_shifted(point) for point in points):
        handles.append(key("as measured, with ramp rate and offset", marker=_MEASURED))
    if any(not point.used for point in points):
        handles.append(key("left out", marker="o", hollow=True))
    return handles

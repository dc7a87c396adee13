"""Held-out runs against what was predicted for them, in standard errors of the prediction.

Errors that are as large as they should be lie within the shaded band, 95 of 100 of them, and without order:
over the speed on the left, over the place on the right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipelines.report.axis_units import units_of
from pipelines.report.speed_axis import speed_axis
from pipelines.report.style import DIRECTION_COLOUR, DIRECTION_NAME, GRID, key, new_figure, styled, zero_lines

_LEAST_REACH: Final = 3.0  # standard errors that the picture shows at least


@styled
def validation_figure(
    held_out: Mapping[str, Any], *, axis: str = "rotary", simulated: bool = False
) -> Figure:
    """Dots: steady runs; diamonds: breakaways. `held_out` as robot.json's validation holds it."""
    points: Sequence[Mapping[str, Any]] = held_out["points"]
    figure = new_figure("Held-out runs against their prediction", height=2.9, simulated=simulated)
    over_speed, over_place = figure.subplots(1, 2, sharey=True)
    units = units_of(axis)
    moving = [abs(point["velocity"]) for point in points if point["velocity"]]
    speed_axis(over_speed, slowest=min(moving, default=0.01), fastest=max(moving, default=1.0))
    over_speed.set(xlabel=f"speed [{units.velocity}], logarithmic", ylabel="error / its standard error")
    over_place.set(xlabel=f"place [{units.position}]")
    reach = max([_LEAST_REACH, *(1.1 * abs(point["standardised"]) for point in points)])
    for axes, variable in ((over_speed, "velocity"), (over_place, "place")):
        axes.axhspan(-held_out["within"], held_out["within"], color=GRID, zorder=0.5)
        axes.set_ylim(-reach, reach)
        zero_lines(axes)
        for point in points:
            _mark(axes, point, abs(point[variable]) if variable == "velocity" else point[variable])
    handles = [key(DIRECTION_NAME[sign], marker="o", colour=DIRECTION_COLOUR[sign]) for sign in (1, -1)]
    handles += [key("steady run", marker="o"), key("breakaway", marker="D")]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, columnspacing=1.3)
    return figure


def _mark(axes: Axes, point: Mapping[str, Any], place: float) -> None:
    breakaway = point["protocol"] == "breakaway"
    axes.plot(
        place,
        point["standardised"],
        marker="D" if breakaway else "o",
        markersize=3.4 if breakaway else 3.8,
        color=DIRECTION_COLOUR[point["direction"]],
        linestyle="none",
        zorder=4,
    )

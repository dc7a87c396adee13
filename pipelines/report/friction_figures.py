"""Figure 2: friction measurements and the friction model fitted to them.

On the left every measurement over the signed velocity, as the paper draws it; on the right the magnitudes over
the speed on a logarithmic scale that reaches down to rest, where the Stribeck part is wide enough to be judged
and the two directions lie over each other. A run that was left out stays visible, as a hollow mark.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ident.model.robot import OneLinkRobot
from pipelines.report.axis_units import units_of
from pipelines.report.drawn_values import DrawnPoint
from pipelines.report.style import BLUE, INK, MUTED, VERMILLION, new_figure, styled, zero_lines

_COLOUR: Final = {"positive": BLUE, "negative": VERMILLION}
_SIGN: Final = {"positive": 1.0, "negative": -1.0}
_ARROW: Final = {"positive": "$\\dot{q} > 0$", "negative": "$\\dot{q} < 0$"}
_STRIBECK_RANGE: Final = 10.0  # Stribeck velocities that the right panel shows


@styled
def figure2(
    points: Sequence[DrawnPoint],
    robot: OneLinkRobot | None,
    *,
    title: str = "Friction measurements and friction model",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Measurements as dots with 95 % bars, runs left out as hollow marks, `robot`'s friction as a solid line.

    Without a robot (a parameter was withheld) the measurements stand alone.
    """
    figure = new_figure(title, height=3.9, simulated=simulated)
    whole, slow = figure.subplots(1, 2, width_ratios=(1.0, 1.0))
    units = units_of(axis)
    _draw_whole(whole, points, robot)
    whole.set(xlabel=f"velocity [{units.velocity}]", ylabel=f"friction {units.effort} [{units.torque}]")
    whole.set_title("both directions")
    _draw_slow(slow, points, robot)
    slow.set(xlabel=f"speed [{units.velocity}]", ylabel=f"magnitude [{units.torque}]")
    slow.set_title("the Stribeck part")
    figure.legend(handles=_legend(points, robot), loc="outside lower center", ncols=5, columnspacing=1.4)
    return figure

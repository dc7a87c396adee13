"""An axis of speeds that is logarithmic and still reaches rest, where the breakaways stand."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter


def speed_axis(axes: Axes, *, slowest: float, fastest: float) -> float:
    """Lay out the horizontal axis; returns the speed below which it is linear."""
    floor = 0.8 * slowest
    axes.set_xscale("symlog", linthresh=floor, linscale=0.35)
    axes.set_xlim(-0.12 * floor, 1.15 * fastest)
    decades = np.asarray(LogLocator(subs=(1.0,)).tick_values(floor, fastest))
    axes.xaxis.set_major_locator(FixedLocator([0.0, *decades[decades > floor]]))
    between = np.asarray(LogLocator(subs=range(2, 10)).tick_values(floor, fastest))
    axes.xaxis.set_minor_locator(FixedLocator(list(between[between > floor])))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    return floor

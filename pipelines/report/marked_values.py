"""Values marked on a horizontal axis: dotted lines up through it, their names in a row above.

Names of near values would lie on each other and on each other's lines. Above the axes no line crosses them;
there each stands as near to its line as its neighbours let it (least squares: isotonic regression of the
places less their order), and a thin leader joins the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import isotonic_regression

from data.recording import FloatArray
from pipelines.report.style import INK, MUTED

DOTTED: Final = (0, (1.5, 2))
_CHARACTER = 0.0115  # width of a small letter as a fraction of the axes'
_LINE = 0.027  # height of a line of small letters, as the same fraction
_LIFT = 0.05  # from the axes to the names, as a fraction of their height


def mark_values(axes: Axes, parameter: str, values: Sequence[float]) -> None:
    """Dotted lines at `values`, and each distinct name `parameter = value` above them.

    Names lie along the axis where all find room, else they stand upright; of more than can stand, every
    second, third, ... is named. To be called with the axis at its final limits.
    """
    for value in values:
        axes.axvline(value, color=INK, linewidth=0.9, linestyle=DOTTED, zorder=2.5)
    names = {f"{parameter} = {value:.4g}": value for value in sorted(values, reverse=True)}
    if not names:
        return
    wide = _CHARACTER * (2 + max(map(len, names)))
    upright = wide * len(names) > 1.0
    room = _LINE if upright else wide
    shown = list(names)[:: math.ceil(room * len(names))][::-1]
    low, high = axes.get_xlim()
    wanted = (np.array([names[name] for name in shown]) - low) / (high - low)
    for name, at, place in zip(shown, wanted, spread(wanted, room), strict=True):
        axes.annotate(
            name, (float(at), 1.0), (float(place), 1.0 + _LIFT),
            xycoords="axes fraction", textcoords="axes fraction",
            ha="center", va="bottom", rotation=90.0 if upright else 0.0, fontsize=8.0, color=MUTED,
            parse_math=False, arrowprops={
                "arrowstyle": "-", "color": MUTED, "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0,
                "relpos": (0.5, 0.0),
            },
        )  # fmt: skip


def spread(wanted: FloatArray, room: float) -> FloatArray:
    """Places (n,) in [0, 1] at least `room` apart and nearest to the `wanted` (n,), rising, within [0, 1]."""
    steps = room * np.arange(wanted.size)
    free = np.asarray(isotonic_regression(wanted - steps).x)
    return np.clip(free, 0.5 * room, max(1.0 - 0.5 * room - steps[-1], 0.5 * room)) + steps

"""How every picture looks, and how it becomes text.

A picture is a matplotlib `Figure` drawn without pyplot, so that nothing is global and nothing needs a
display. `svg_text` writes it as SVG that is the same, byte for byte, whenever the drawn values are: the
identifiers are salted with a constant and the date is left out. Letters are outlines, so the picture looks
the same on every machine; its title stands in `<title>` for those who cannot see it.

Colours are Okabe and Ito's (2008), which stay apart for colour-blind readers. Each has a role, and a second
value for dark pages: `report.html` exchanges the first for the second by name (see `page.py`).
"""

from __future__ import annotations

import functools
import html
import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from data.names import shown

P = ParamSpec("P")
_LONGEST: Final = 110  # characters of a title


@dataclass(frozen=True)
class Colour:
    """One role: its value on white and on a dark page."""

    light: str
    dark: str


INK: Final = "#1d2530"
MUTED: Final = "#68737f"
GRID: Final = "#e3e7eb"
PAPER: Final = "#ffffff"
BLUE: Final = "#0072b2"
VERMILLION: Final = "#d55e00"
GREEN: Final = "#009e73"
PURPLE: Final = "#b0578d"
ORANGE: Final = "#e69f00"
SKY: Final = "#56b4e9"
DIRECTION_COLOUR: Final = {1: BLUE, -1: VERMILLION}
DIRECTION_NAME: Final = {1: "$\\dot{q} > 0$", -1: "$\\dot{q} < 0$"}
UNDER: Final = ("#9ccbe8", "#4ba3d3", "#0072b1", "#084a75")  # r < 1, the farther the paler
OVER: Final = ("#9c3f00", "#d55e01", "#f0914a", "#f7be8f")  # r > 1, the farther the paler

COLOURS: Final = {
    "ink": Colour(INK, "#e7ebf0"),
    "muted": Colour(MUTED, "#9ca8b4"),
    "grid": Colour(GRID, "#323c47"),
    "paper": Colour(PAPER, "#161b21"),
    "blue": Colour(BLUE, "#5db7ee"),
    "vermillion": Colour(VERMILLION, "#ff8f4d"),
    "green": Colour(GREEN, "#35c99c"),
    "purple": Colour(PURPLE, "#e39ac8"),
    "orange": Colour(ORANGE, "#f2b737"),
    "sky": Colour(SKY, "#86cbf4"),
    "under-1": Colour(UNDER[0], "#2f5f80"),
    "under-2": Colour(UNDER[1], "#3f8fc0"),
    "under-3": Colour(UNDER[2], "#6fc1f2"),
    "under-4": Colour(UNDER[3], "#b5e0fb"),
    "over-1": Colour(OVER[0], "#ffd0ad"),
    "over-2": Colour(OVER[1], "#ff9a5c"),
    "over-3": Colour(OVER[2], "#c96f33"),
    "over-4": Colour(OVER[3], "#85512f"),
}

WIDTH: Final = 7.2  # [in]; about 700 px on a screen, a text width on paper

_STYLE: Final[dict[Any, Any]] = {  # matplotlib types every key of its settings by itself
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9.0,
    "mathtext.fontset": "dejavusans",
    "svg.fonttype": "path",
    "svg.hashsalt": "stribeck",
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "figure.facecolor": PAPER,
    "figure.edgecolor": "none",
    "savefig.facecolor": PAPER,
    "axes.facecolor": "none",
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.labelcolor": INK,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 7.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 1.8,
    "hatch.linewidth": 0.6,
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Let `draw` work under the house style and leave matplotlib's settings as they were."""

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(_STYLE):
            return draw(*args, **kwargs)

    return drawn


def new_figure(title: str, *, height: float, subtitle: str = "", simulated: bool = False) -> Figure:
    """An empty figure of the report's width under a title; to be called inside a `styled` function.

    `height` [in]. A picture of simulated logs says so in its corner, wherever it is copied to.
    """
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06))
    heading = plain(title)
    figure.set_label(heading + (" (SIMULATED)" if simulated else ""))
    figure.suptitle(
        heading + ("\n" if subtitle else ""),
        x=0.012, ha="left", va="top", fontsize=11, fontweight="bold", parse_math=False, linespacing=1.45,
    )  # fmt: skip
    if subtitle:
        figure.text(
            0.012,
            1 - 0.33 / height,
            subtitle,
            ha="left",
            va="top",
            fontsize=8.5,
            color=MUTED,
            parse_math=False,
        )
    if simulated:
        figure.text(
            0.988, 1 - 0.1 / height, "SIMULATED", ha="right", va="top", fontsize=8, fontweight="bold",
            color=PAPER, bbox={"boxstyle": "round,pad=0.35", "facecolor": PURPLE, "edgecolor": "none"},
        )  # fmt: skip
    return figure


def zero_lines(axes: Axes, *, vertical: bool = False) -> None:
    """Mark zero a little stronger than the grid."""
    axes.axhline(0.0, color=MUTED, linewidth=0.7, zorder=0.9)
    if vertical:
        axes.axvline(0.0, color=MUTED, linewidth=0.7, zorder=0.9)


def key(
    label: str,
    *,
    marker: str,
    colour: str = INK,
    hollow: bool = False,
    line: float = 0.0,
    size: float = 5.5,
) -> Line2D:
    """A legend's entry: a mark, hollow or filled, on a line of the given width or on none; [pt]."""
    return Line2D(
        [], [], marker=marker, color=colour, markerfacecolor="none" if hollow else colour, markersize=size,
        linewidth=line, linestyle="-" if line else "none", label=label,
    )  # fmt: skip


def plain(text: str) -> str:
    """Text that came from outside, fit to be drawn: one line, control characters as escapes."""
    return shown(text, _LONGEST)


def no_math(text: str) -> str:
    """The same for texts where matplotlib reads `$` as the beginning of a formula."""
    return plain(text).replace("$", r"\$")


def svg_text(figure: Figure) -> str:
    """The figure as SVG text, the same for the same values."""
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with mpl.rc_context(_STYLE):
        figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue()
    title = html.escape(str(figure.get_label()), quote=True)
    start = text.index("<svg ")
    end = text.index(">", start) + 1
    head = text[start : end - 1] + f' role="img" aria-label="{title}">\n <title>{title}</title>'
    return '<?xml version="1.0" encoding="utf-8"?>\n' + head + text[end:]

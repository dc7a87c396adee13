"""The lower panel of figure 10: where limit cycling sets in, recorded and predicted, a row for each start.

The bar is what the runs say: between the largest gain that rests and the smallest that cycles. The filled
diamond is the prediction for the fitted robot in the loop as it ran, with its 95 % interval; the hollow one
is the same robot in a continuous loop; the square is the symmetric robot. A star marks a run that came to
rest above the onset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pipelines.report.style import INK, MUTED, PAPER, key, no_math, plain

ROW: Final = 0.27  # height of an onset's row [in]
_BRACKET_OPACITY: Final = 0.45

Onset = Mapping[str, Any]


def draw_onsets(axes: Axes, onsets: Sequence[Onset], colours: Mapping[str, str], unit: str) -> None:
    """A row for each onset, in the colour of its start; `colours` by `start_label`."""
    several = len({str(onset.get("gains")) for onset in onsets}) > 1
    numbers = [float(x) for onset in onsets for x in _numbers(onset)]
    low, high = (min(numbers), max(numbers)) if numbers else (0.9, 1.1)
    spare = 0.12 * (high - low) or 0.02 * max(1.0, abs(high))
    for row, onset in enumerate(onsets):
        colour = colours[start_label(onset["start"])]
        _draw_bracket(
            axes, onset.get("recorded") or (None, None), row, colour, ends=(low - spare, high + spare)
        )
        _draw_prediction(axes, onset, row)
    axes.set_ylim(len(onsets) - 0.4, -0.6)
    axes.set_xlim(low - spare, high + spare)
    axes.set_yticks(range(len(onsets)), [_row_name(onset, unit, several=several) for onset in onsets])
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_title("onset of limit cycling, by start")
    axes.set_xlabel("compensation gain $r$")
    legend_beside(
        axes,
        [
            Patch(facecolor=INK, alpha=_BRACKET_OPACITY, label="recorded between"),
            key("predicted, 95 %", marker="D", line=1.2),
            key("continuous loop", marker="D", hollow=True),
            key("symmetric robot", marker="s", colour=MUTED),
        ],
    )


def _draw_bracket(
    axes: Axes, bracket: Sequence[float | None], row: int, colour: str, *, ends: tuple[float, float]
) -> None:
    below, above = bracket
    if below is None and above is None:
        return
    left, right = (ends[0] if below is None else below), (ends[1] if above is None else above)
    axes.plot(
        (left, right),
        (row, row),
        color=colour,
        linewidth=8.0,
        alpha=_BRACKET_OPACITY,
        solid_capstyle="butt",
        zorder=2,
    )
    for end in (below, above):
        if end is not None:
            axes.plot(end, row, marker="|", markersize=10, markeredgewidth=1.6, color=colour, zorder=2.2)


def _draw_prediction(axes: Axes, onset: Onset, row: int) -> None:
    interval = onset.get("predicted_interval95") or ()
    if len(interval) == 2 and None not in interval:
        axes.plot(interval, (row, row), color=INK, linewidth=1.2, zorder=3)
    for name, marker, fill, edge in (
        ("symmetric", "s", MUTED, PAPER),
        ("ideal", "D", PAPER, INK),
        ("predicted", "D", INK, PAPER),
    ):
        if onset.get(name) is not None:
            axes.plot(
                onset[name], row, marker=marker, markersize=5.5, color=fill, markeredgecolor=edge,
                markeredgewidth=0.9, linestyle="none", zorder=3.5,
            )  # fmt: skip
    for r in onset.get("reversals") or ():
        axes.plot(r, row, marker="*", markersize=7, color=MUTED, linestyle="none", zorder=3.2)


def _numbers(onset: Onset) -> list[float]:
    single = [onset.get(key) for key in ("predicted", "ideal", "symmetric")]
    several = [*(onset.get("recorded") or ()), *(onset.get("predicted_interval95") or ())]
    return [x for x in (*single, *several, *(onset.get("reversals") or ())) if x is not None]


def start_label(start: object) -> str:
    """A start's name: the position it was released from."""
    first = start[0] if isinstance(start, Sequence) and not isinstance(start, str) and start else start
    return f"{first:+.3g}".replace("-", "−") if isinstance(first, int | float) else plain(str(first))


def _row_name(onset: Onset, unit: str, *, several: bool) -> str:
    name = no_math(f"from {start_label(onset['start'])} {unit}")
    gains = onset.get("gains")
    if several and isinstance(gains, Mapping):
        name += "\n" + ", ".join(f"{no_math(str(key))} {value:.4g}" for key, value in gains.items())
    return name


def legend_beside(axes: Axes, handles: list[Line2D | Patch]) -> None:
    """A legend to the right of the axes, at their top."""
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, fontsize=8.0,
        labelspacing=0.5, handlelength=1.6,
    )  # fmt: skip

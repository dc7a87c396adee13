"""Figure 10: the recorded runs over the prediction, and where limit cycling sets in.

Above, every recorded set-point run at its compensation gain: a star where it came to rest (at its position
error), a circle where it cycles (at max|x1| over a period), a triangle where the record does not decide;
each in the colour of its start. Under them the fitted asymmetric robot and, grey, the symmetric one of
figure 9; a dash is what the fitted robot was predicted to do in the loop as it ran, from the run's own
start. Below, the onset of limit cycling from each start: the recorded bracket, and what each prediction
says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from compensation.bifurcation import Diagram
from pipelines.report.axis_units import AxisUnits, units_of
from pipelines.report.bifurcation_figures import branch_arrays, draw_branch
from pipelines.report.onset_panel import ROW, Onset, draw_onsets, legend_beside, start_label
from pipelines.report.style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PAPER,
    PURPLE,
    SKY,
    VERMILLION,
    key,
    new_figure,
    no_math,
    styled,
    zero_lines,
)

_STARTS: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_MARK: Final = {"equilibrium": "*", "limit_cycle": "o", "undecided": "^"}
_SIZE: Final = {"equilibrium": 10.0, "limit_cycle": 7.5, "undecided": 7.5}
_NESTED: Final = (1.0, 0.76, 0.55, 0.38)  # circles by start: runs that end alike lie inside each other
_NESTED_STARS: Final = (1.0, 0.86, 0.72, 0.6)

Run = Mapping[str, Any]


@styled
def figure10(
    comparison: Mapping[str, Any],
    *,
    fitted: Diagram | None = None,
    symmetric: Diagram | None = None,
    title: str = "Recorded runs over the prediction",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Runs and onsets as comparison.json holds them, over the fitted and the symmetric robot's diagrams."""
    runs: Sequence[Run] = comparison["runs"]
    onsets: Sequence[Onset] = comparison.get("onset", ())
    known = [onset["start"] for onset in onsets]
    groups = [start_label(_nearest(run["start"], known)) for run in runs]
    colours = _colours([*map(start_label, known), *groups])
    strip = 1.05 + ROW * len(onsets) if onsets else 0.0
    subtitle = subtitle or _shared_gains(onsets, units_of(axis))
    figure = new_figure(title, height=4.6 + strip, subtitle=subtitle, simulated=simulated)
    unit = units_of(axis).position
    if onsets:
        main, below = figure.subplots(2, 1, height_ratios=(4.0, strip - 0.35))
        draw_onsets(below, onsets, colours, unit)
    else:
        main = figure.subplots()
    zero_lines(main)
    if symmetric is not None:
        _draw_symmetric(main, symmetric)
    if fitted is not None:
        for branch in fitted.branches:
            draw_branch(main, branch, cycle=INK, rest=INK)
    for number, (start, colour) in enumerate(colours.items()):
        own = [run for run, group in zip(runs, groups, strict=True) if group == start]
        _draw_runs(main, own, colour, rank=number % len(_NESTED))
    main.set(xlabel="compensation gain $r$", ylabel=f"$x_1$ at rest, $\\max|x_1|$ of a cycle [{unit}]")
    reach = [float(run["r"]) for run in runs]
    if reach:
        spare = 0.03 * (max(reach) - min(reach)) or 0.02 * max(1.0, *reach)
        main.set_xlim(min(reach) - spare, max(reach) + spare)
    handles = _legend(runs, colours, unit, fitted=fitted is not None, symmetric=symmetric is not None)
    legend_beside(main, handles)
    return figure


def _shared_gains(onsets: Sequence[Onset], units: AxisUnits) -> str:
    """The controller's gains, where all runs share them."""
    gains = {str(onset.get("gains")): onset.get("gains") for onset in onsets}
    only = next(iter(gains.values())) if len(gains) == 1 else None
    if not isinstance(only, Mapping):
        return ""
    named = (
        ("proportional_gain", "n₁", f"{units.torque}/{units.position}"),
        ("derivative_gain", "n₂", units.damping),
        ("observer_gain", "L", "1/s"),
    )
    return ", ".join(
        f"{name} = {only[entry]:.6g} {unit}" for entry, name, unit in named if only.get(entry) is not None
    )


def _draw_symmetric(axes: Axes, diagram: Diagram) -> None:
    for branch in diagram.branches:
        value, low, high, amplitude = branch_arrays(branch.points)
        edges = (amplitude,) if branch.kind == "limit_cycle" else (low, high)
        if branch.kind == "equilibrium":
            continue
        for edge in edges:
            axes.plot(value, edge, color=MUTED, linestyle=(0, (5, 2)), linewidth=1.2, zorder=2.4)


def _draw_runs(axes: Axes, runs: Sequence[Run], colour: str, *, rank: int) -> None:
    for run in runs:
        r, verdict = run["r"], run["verdict"]
        height = _height(run)
        seen = 0.0 if height is None else height
        predicted = _height(run.get("predicted") or {})
        if predicted is not None:
            axes.plot((r, r), (seen, predicted), color=colour, linewidth=0.7, alpha=0.6, zorder=3.5)
            axes.plot(r, predicted, marker="_", markersize=11, markeredgewidth=1.1, color=colour, zorder=3.6)
        rests = verdict == "equilibrium"
        axes.plot(
            r,
            seen,
            marker=_MARK.get(verdict, "^"),
            markersize=_SIZE.get(verdict, 7.5) * (_NESTED_STARS if rests else _NESTED)[rank],
            markerfacecolor=colour if rests else "none",
            markeredgecolor=PAPER if rests else colour,
            markeredgewidth=0.4 if rests else 1.3,
            linestyle="none",
            zorder=4,
        )


def _height(outcome: Mapping[str, Any]) -> float | None:
    """Where an outcome is drawn: a cycle at its amplitude, a rest at its position."""
    if outcome.get("verdict") == "equilibrium":
        names = ("position_error", "x1_max", "amplitude")
    else:
        names = ("amplitude", "x1_max", "position_error")
    return next((float(outcome[name]) for name in names if outcome.get(name) is not None), None)


def _nearest(start: object, known: Sequence[object]) -> object:
    """The start of the onset that a run belongs to: measured starts scatter by some counts."""
    numbers = [number for number in known if isinstance(number, int | float)]
    if not isinstance(start, int | float) or not numbers:
        return start
    return min(numbers, key=lambda number: abs(number - start))


def _colours(starts: Sequence[str]) -> dict[str, str]:
    return {name: _STARTS[k % len(_STARTS)] for k, name in enumerate(dict.fromkeys(starts))}


def _legend(
    runs: Sequence[Run], colours: Mapping[str, str], unit: str, *, fitted: bool, symmetric: bool
) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        key("came to rest", marker="*", size=9.0),
        key("cycles", marker="o", hollow=True),
    ]
    if any(run["verdict"] == "undecided" for run in runs):
        handles.append(key("undecided", marker="^", hollow=True))
    handles.append(key("predicted", marker="_", size=9.0))
    handles += [
        Patch(facecolor=colour, label=no_math(f"from {start} {unit}")) for start, colour in colours.items()
    ]
    if fitted:
        handles.append(Line2D([], [], color=INK, linewidth=2, label="fitted robot"))
    if symmetric:
        handles.append(Line2D([], [], color=MUTED, linestyle=(0, (5, 2)), label="symmetric robot"))
    return handles

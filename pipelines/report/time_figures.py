"""Figures 6 and 7: one motion of the closed loop, over time.

Figure 6 is subtle. Below the critical observer gain the observer error x3 = 0 is unstable, yet it is a
solution: from (1, 0, 0) the exact motion is a damped oscillation. Only what perturbs it for ever (a sampled
controller, measurement noise, r just above 1) shows the limit cycle, so the picture draws both and names
the perturbation.
"""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from data.recording import FloatArray
from ident.simulation.trajectory import Trajectory
from pipelines.report.axis_units import AxisUnits, units_of
from pipelines.report.style import BLUE, GREEN, INK, MUTED, VERMILLION, new_figure, plain, styled, zero_lines


@styled
def figure6(
    exact: Trajectory,
    perturbed: Trajectory,
    *,
    perturbation: str,
    title: str = "Limit cycle below the critical observer gain",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """The exact solution and a perturbed one from the same start; `perturbation` says what was added."""
    figure = new_figure(title, height=4.6, subtitle=subtitle, simulated=simulated)
    panels = figure.subplots(3, 1, sharex=True)
    units = units_of(axis)
    for component, (axes, label) in enumerate(zip(panels, _labels(units), strict=True)):
        zero_lines(axes)
        axes.plot(perturbed.time, perturbed.state[:, component], color=VERMILLION, linewidth=1.2, zorder=3)
        axes.plot(exact.time, exact.state[:, component], color=BLUE, linewidth=1.4, zorder=3.2)
        axes.set_ylabel(label)
    panels[0].plot([], [], color=BLUE, label="exact solution")
    panels[0].plot([], [], color=VERMILLION, label=f"perturbed: {plain(perturbation)}".replace("$", r"\$"))
    figure.legend(loc="outside lower center", ncols=2)
    figure.align_ylabels(panels)
    _finish(panels[-1], exact)
    return figure


@styled
def figure7(
    history: Trajectory,
    *,
    torque: FloatArray | None = None,
    title: str = "Performance above the critical observer gain",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Position, velocity with its estimate, observer error, and the torque (n,) [N m] where it is given."""
    rows = 3 if torque is None else 4
    figure = new_figure(title, height=1.4 * rows + 0.8, subtitle=subtitle, simulated=simulated)
    panels = figure.subplots(rows, 1, sharex=True)
    units = units_of(axis)
    position, estimate, error = history.state.T
    lines: list[tuple[FloatArray, str, str]] = [(position, BLUE, "position $x_1$")]
    _panel(panels[0], history, lines, f"$x_1$ [{units.position}]")
    _panel(
        panels[1],
        history,
        [(estimate + error, BLUE, "velocity $v = x_2 + x_3$"), (estimate, VERMILLION, "its estimate $x_2$")],
        f"$v$, $x_2$ [{units.velocity}]",
    )
    _panel(panels[2], history, [(error, GREEN, "observer error $x_3$")], f"$x_3$ [{units.velocity}]")
    if torque is not None:
        _panel(panels[3], history, [(torque, INK, f"commanded {units.effort} $u$")], f"$u$ [{units.torque}]")
    figure.align_ylabels(panels)
    _finish(panels[-1], history)
    return figure


def _panel(axes: Axes, history: Trajectory, lines: list[tuple[FloatArray, str, str]], label: str) -> None:
    zero_lines(axes)
    for number, (values, colour, name) in enumerate(lines):
        dashes = "-" if number == 0 else (0, (3, 1.5))
        axes.plot(history.time, values, color=colour, linestyle=dashes, label=name, zorder=3 + number)
    axes.set_ylabel(label)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0, borderpad=0.2)


def _labels(units: AxisUnits) -> tuple[str, str, str]:
    return f"$x_1$ [{units.position}]", f"$x_2$ [{units.velocity}]", f"$x_3$ [{units.velocity}]"


def _finish(axes: Axes, history: Trajectory) -> None:
    axes.set_xlabel("time [s]", color=INK)
    axes.set_xlim(float(history.time[0]), float(history.time[-1]))
    axes.tick_params(axis="x", color=MUTED)

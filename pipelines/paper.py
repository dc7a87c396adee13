"""paper: Table 1 and figures 2, 4, 6, 7, 8 and 9 of the paper, from its published parameters alone.

Each figure comes with its numbers, `figureN.csv`. Table 1's means are computed from the two columns, and so
are the critical observer gains below them. Figure 2 has no measurements (they were not published), and figure
10 needs recorded runs.

**Figure 6.** At L = 40 < L_c and r = 1 the exact solution from (1, 0, 0) is no limit cycle: with x3 = 0 the
compensation cancels the friction exactly, e = 0 is a solution, and what remains is the damped oscillator x1''
+ ((b + n2)/J) x1' + (n1/J) x1 = 0. But that solution is unstable: while the link is slow, errors grow by up
to L_c - L = 33/s. A single disturbance is forgotten at the next stick that ends at x2 = 0, where x3 returns
to 0 exactly; a persistent one (rounding in a fixed step, a boundary layer, measurement noise, a compensation
that is not exact) decides between rest in the equilibrium set and bursts that repeat for ever, which is what
the printed figure shows. So the figure here shows two curves: the exact solution, and the same loop with the
compensation a hundred-thousandth too strong, r = 1 + 1e-5. The bursts of the latter reach max|x1| = 0.2456
rad, the limit of the limit cycle's amplitude as r falls to 1; only the time between them depends on the size
of the perturbation, by its logarithm. The choice matters, as said: from this start r = 1 + 1e-6 makes one
such burst and then rests off the set point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Final

import numpy as np

from compensation.bifurcation import diagram
from compensation.closed_loop import ClosedLoop, simulate, torque
from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gain, critical_observer_gains
from data.recording import FloatArray
from ident.model.friction import StribeckCurve
from ident.model.published import (
    DERIVATIVE_GAIN,
    INERTIA,
    LOW_OBSERVER_GAIN,
    OBSERVER_GAIN,
    PROPORTIONAL_GAIN,
    asymmetric_robot,
    symmetric_robot,
)
from ident.simulation.trajectory import Trajectory
from pipelines.equilibrium_sweeps import (
    FIGURE_8_GAINS,
    edges,
    extrema,
    observer_gain_axis,
    with_folds,
    write_edges,
    write_extrema,
)
from pipelines.report.bifurcation_figures import figure9
from pipelines.report.equilibrium_figures import figure4, figure8
from pipelines.report.friction_figures import figure2
from pipelines.report.style import svg_text
from pipelines.report.time_figures import figure6, figure7
from pipelines.results.diagram_file import write_diagram
from pipelines.results.folder import ResultFolder

START: Final = (1.0, 0.0, 0.0)  # of figures 6 and 7: x1 [rad], x2, x3 [rad/s]
PERTURBATION: Final = 1e-5  # r - 1 of figure 6's second curve
FIGURE_6_DURATION: Final = 40.0  # [s]
FIGURE_7_DURATION: Final = 5.0  # [s]
STEP: Final = 5e-3  # [s] between the rows of figures 6 and 7
FIGURE_9_GAINS: Final = np.linspace(0.8, 1.2, 201)  # r
_GAINS: Final = f"n1 = {PROPORTIONAL_GAIN:g} N m/rad, n2 = {DERIVATIVE_GAIN:g} N m s/rad"
_WORDS: Final = {
    "stribeck_shape": "beta [-]",
    "static_torque": "F_s [N m]",
    "coulomb_torque": "F_c [N m]",
    "stribeck_velocity": "v_s [rad/s]",
    "viscous_damping": "b [N m s/rad]",
}


def write_paper(folder: ResultFolder) -> None:
    """Everything that follows from the published parameters, into `folder`."""
    write_table1(folder)
    write_figure2(folder)
    write_figures4_and_8(folder)
    write_figure6(folder)
    write_figure7(folder)
    write_figure9(folder)


def table1() -> dict[str, tuple[float, float, float]]:
    """Rows of Table 1: q' > 0, q' < 0 and the unrounded mean, with L_c [1/s] of eq (11) as the last row."""
    friction = asymmetric_robot().friction
    columns = (friction.positive, friction.negative, friction.mean().positive)
    rows: Mapping[str, tuple[StribeckCurve, ...]] = dict.fromkeys(_WORDS, columns)
    table = {_WORDS[name]: _row(curves, name) for name, curves in rows.items()}
    ahead, back, mean = (critical_observer_gain(curve, inertia=INERTIA) for curve in columns)
    return {**table, "L_c [1/s]": (ahead, back, mean)}


def write_table1(folder: ResultFolder) -> None:
    """table1.csv with every digit, table1.md for people."""
    table = table1()
    folder.write_csv(
        "table1.csv",
        ("parameter", "positive", "negative", "mean"),
        [(name, *row) for name, row in table.items()],
    )
    lines = ["| parameter | q̇ > 0 | q̇ < 0 | mean value |", "| --- | --- | --- | --- |"]
    lines += [
        f"| {name} | " + " | ".join(f"{value:.6g}" for value in row) + " |" for name, row in table.items()
    ]
    lines += [
        "",
        f"J = {INERTIA:g} kg m^2. Means and L_c are computed from the two columns, not rounded.",
        "",
    ]
    folder.write_text("table1.md", "\n".join(lines))


def write_figure2(folder: ResultFolder) -> None:
    """Friction of both directions, viscous part included; at rest the whole interval."""
    robot = asymmetric_robot()
    speeds = np.concatenate((np.linspace(-2.5, 2.5, 1001), np.geomspace(1e-4, 0.1, 100)))
    velocity = np.unique(np.concatenate((speeds, -speeds)))
    low, high = robot.friction.torque_interval(velocity)
    viscous = velocity * np.where(
        velocity > 0, robot.friction.positive.viscous_damping, robot.friction.negative.viscous_damping
    )
    rows = np.column_stack((velocity, low + viscous, high + viscous))
    folder.write_csv("figure2.csv", ("v", "torque_low", "torque_high"), rows.tolist())
    curves = {1: robot.friction.positive, -1: robot.friction.negative}
    folder.write_text("figure2.svg", svg_text(figure2((), curves, title="Friction model of Table 1")))


def write_figures4_and_8(folder: ResultFolder) -> None:
    """Equilibrium sets over the observer gain: exact and no compensation, and other r."""
    robot, gains = symmetric_robot(), _gains()
    limit = critical_observer_gains(robot).mean
    swept = with_folds(observer_gain_axis(limit), robot, robot, gains, compensation_gains=FIGURE_8_GAINS)
    exact, none = (extrema(robot, robot, gains, compensation_gain=r, observer_gain=swept) for r in (1.0, 0.0))
    write_extrema(folder, "figure4.csv", swept, {"exact": exact, "uncompensated": none})
    folder.write_text(
        "figure4.svg", svg_text(figure4(swept, exact, none, critical_gain=limit, subtitle=_GAINS))
    )
    curves = {r: edges(robot, robot, gains, compensation_gain=r, observer_gain=swept) for r in FIGURE_8_GAINS}
    write_edges(folder, "figure8.csv", swept, curves)
    folder.write_text("figure8.svg", svg_text(figure8(swept, curves, critical_gain=limit, subtitle=_GAINS)))


def figure6_solutions() -> tuple[Trajectory, Trajectory]:
    """The exact solution at L = 40, and that of the loop with r = 1 + 1e-5."""
    exact, perturbed = (_motion(LOW_OBSERVER_GAIN, r, FIGURE_6_DURATION) for r in (1.0, 1.0 + PERTURBATION))
    return exact, perturbed


def write_figure6(folder: ResultFolder) -> None:
    """Below the critical gain: the exact solution and the perturbed one."""
    exact, perturbed = figure6_solutions()
    rows = [
        (name, *row)
        for name, found in (("exact, r = 1", exact), ("perturbed, r = 1 + 1e-5", perturbed))
        for row in np.column_stack((found.time, found.state)).tolist()
    ]
    folder.write_csv("figure6.csv", ("solution", "t", "x1", "x2", "x3"), rows)
    picture = figure6(
        exact,
        perturbed,
        perturbation="compensation a hundred-thousandth too strong, r = 1 + 1e-5",
        subtitle=f"{_GAINS}, L = {LOW_OBSERVER_GAIN:g} 1/s",
    )
    folder.write_text("figure6.svg", svg_text(picture))


def write_figure7(folder: ResultFolder) -> None:
    """Above the critical gain: the set point is reached."""
    found = _motion(OBSERVER_GAIN, 1.0, FIGURE_7_DURATION)
    robot = symmetric_robot()
    applied = torque(ClosedLoop(robot, Controller(_gains(), robot)), found.state)
    folder.write_csv(
        "figure7.csv",
        ("t", "x1", "x2", "x3", "u"),
        np.column_stack((found.time, found.state, applied)).tolist(),
    )
    folder.write_text(
        "figure7.svg",
        svg_text(figure7(found, torque=applied, subtitle=f"{_GAINS}, L = {OBSERVER_GAIN:g} 1/s")),
    )


def write_figure9(folder: ResultFolder) -> None:
    """The bifurcation diagram over r at L = 73.5."""
    robot = symmetric_robot()
    found = diagram(ClosedLoop(robot, Controller(_gains(), robot)), "r", FIGURE_9_GAINS)
    write_diagram(folder, found, loop="continuous: inclusion (8)", name="figure9")
    folder.write_text(
        "figure9.svg", svg_text(figure9(found, subtitle=f"{_GAINS}, L = {OBSERVER_GAIN:g} 1/s"))
    )


def _row(curves: tuple[StribeckCurve, ...], name: str) -> tuple[float, float, float]:
    ahead, back, mean = (float(asdict(curve)[name]) for curve in curves)
    return ahead, back, mean


def _gains(observer: float = OBSERVER_GAIN, compensation: float = 1.0) -> Gains:
    return Gains(PROPORTIONAL_GAIN, DERIVATIVE_GAIN, observer=observer, compensation=compensation)


def _motion(observer: float, compensation: float, duration: float) -> Trajectory:
    robot = symmetric_robot()
    loop = ClosedLoop(robot, Controller(_gains(observer, compensation), robot))
    times: FloatArray = np.linspace(0.0, duration, round(duration / STEP) + 1)
    return simulate(loop, START, times=times, duration=duration)

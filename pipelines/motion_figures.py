"""Figures 6 and 7 for a fitted robot: the loop below and above the critical observer gain.

As in the paper the robot is the symmetric one, with the means of its two directions, and r = 1: without a
perturbation both loops are then the damped oscillator. Figure 6 sets L at 0.55 of the critical gain (the
paper's 40 of 73.07) and shows what a persistent perturbation makes of it, here a compensation slightly
too strong; figure 7 sets L just above the critical gain, or at the chosen one where that is higher.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop, simulate, torque
from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains, loop_decay
from data.recording import Axis
from ident.model.robot import OneLinkRobot
from ident.simulation.trajectory import Trajectory
from pipelines.report.style import svg_text
from pipelines.report.time_figures import figure6, figure7
from pipelines.results.folder import ResultFolder

BELOW: Final = 0.55  # of the critical gain
ABOVE: Final = 1.006  # of the critical gain
PERTURBATION: Final = 1e-4  # r - 1; at 1e-6 Table 1's robot comes to rest after one burst
TIME_CONSTANTS: Final = (100.0, 10.0)  # of the loop without observer error, shown in figures 6 and 7
ROWS: Final = 4001


def write_motion_figures(
    folder: ResultFolder, robot: OneLinkRobot, gains: Gains, *, start: float, axis: Axis, simulated: bool
) -> str | None:
    """figure6.svg and figure7.svg from x1(0) = `start` [rad]; why there are none, where there are none."""
    mean = robot.mean()
    critical = critical_observer_gains(mean).mean
    if not (math.isfinite(critical) and critical > 0):
        return f"figures 6 and 7 need a finite critical observer gain > 0; it is {critical:g} 1/s"
    rate = loop_decay(Controller(gains, mean)).rate
    slow, fast = (number / rate for number in TIME_CONSTANTS)
    below, above = BELOW * critical, max(ABOVE * critical, gains.observer)
    weak = replace(gains, observer=below, compensation=1.0)
    exact = _motion(mean, weak, start, slow)
    perturbed = _motion(mean, replace(weak, compensation=1.0 + PERTURBATION), start, slow)
    words = f"compensation slightly too strong, r = {1.0 + PERTURBATION:g}"
    words6 = f"L = {below:.4g} 1/s, critical gain {critical:.4g} 1/s"
    picture = figure6(exact, perturbed, perturbation=words, subtitle=words6, axis=axis, simulated=simulated)
    folder.write_text("figure6.svg", svg_text(picture))
    set_gains = replace(gains, observer=above, compensation=1.0)
    motion = _motion(mean, set_gains, start, fast)
    applied = torque(ClosedLoop(mean, Controller(set_gains, mean)), motion.state)
    words7 = f"L = {above:.4g} 1/s, critical gain {critical:.4g} 1/s"
    picture = figure7(motion, torque=applied, subtitle=words7, axis=axis, simulated=simulated)
    folder.write_text("figure7.svg", svg_text(picture))
    return None


def _motion(robot: OneLinkRobot, gains: Gains, start: float, duration: float) -> Trajectory:
    loop = ClosedLoop(robot, Controller(gains, robot))
    return simulate(loop, (start, 0.0, 0.0), times=np.linspace(0.0, duration, ROWS), duration=duration)

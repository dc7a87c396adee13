"""How far from the set point cycles of a closed loop are looked for: lengths that belong to the loop.

Friction holds the link up to |x1| = F_s/n1, and compensation pushes it as far as r F_s^/n1. What compensation
does beyond friction, |r F_s^ - F_s|, is what a cycle near its birth from the set point lives on: its
amplitude falls with it to nothing, at r = 1 + 1e-12 of the paper's robot to 1.7e-10 rad.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_tables import Parameter
from ident.simulation.filippov_system import FloatArray

FAR: Final = 0.5  # of the largest torque over n1: beyond most cycles
NEAR: Final = 1.0 / 6.0  # of the far start, at most


def start_sizes(loop: ClosedLoop, parameter: Parameter, values: FloatArray) -> FloatArray:
    """Starts x1 [rad], far and near, (n, 2), at `values` (n,) of r [-] or L [1/s]."""
    gains = loop.controller.gains
    r = values if parameter == "r" else np.full(values.shape, gains.compensation)
    true, model = loop.robot.friction, loop.controller.model.friction
    held = np.array([true.positive.static_torque, true.negative.static_torque])
    pushed = r[:, None] * [model.positive.static_torque, model.negative.static_torque]
    far = FAR * np.maximum(held, pushed).max(axis=1) / gains.proportional
    excess = np.abs(pushed - held).max(axis=1) / gains.proportional
    return np.column_stack([far, np.minimum(excess, NEAR * far)])

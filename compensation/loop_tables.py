"""The parameters of the modes for a robot and a controller, or for one of them after another.

A kernel reads a loop as one table (6, 16) of `loop_parameters`, and a sweep or a batch as (n, 6, 16).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, Literal

import numpy as np

from compensation.controller import GAIN_OF, Controller
from compensation.loop_parameters import COLUMNS, ROWS, mode_table
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray

Parameter = Literal["r", "L"]
GAIN_NAMES: Final = tuple(GAIN_OF.values())
COLUMN_OF: Final[dict[Parameter, int]] = {"L": 2, "r": 3}


@lru_cache(maxsize=1024)
def mode_parameters(robot: OneLinkRobot, controller: Controller) -> FloatArray:
    """The numbers of all modes of one loop: (6, 16), not to be written to."""
    table: FloatArray = tables_over_gains(robot, controller, gain_row(controller)[np.newaxis])[0]
    return table


def gain_row(controller: Controller) -> FloatArray:
    """n1 [N m/rad], n2 [N m s/rad], L [1/s], r [-]: (4,)."""
    return np.array([getattr(controller.gains, name) for name in GAIN_NAMES])


def tables_over(
    robot: OneLinkRobot, controller: Controller, parameter: Parameter, values: FloatArray
) -> FloatArray:
    """Tables (n, 6, 16) over `values` (n,) of r [-] or L [1/s], the other gains as in the controller."""
    gains = np.tile(gain_row(controller), (values.size, 1))
    gains[:, COLUMN_OF[parameter]] = values
    return tables_over_gains(robot, controller, gains)


def tables_over_gains(robot: OneLinkRobot, controller: Controller, gains: FloatArray) -> FloatArray:
    """Tables (n, 6, 16) over rows of `gains` (n, 4): n1 [N m/rad], n2 [N m s/rad], L [1/s], r [-]."""
    laws, inertia = laws_of(robot, controller)
    tables = np.zeros((gains.shape[0], ROWS, COLUMNS))
    _fill(laws, inertia, np.ascontiguousarray(gains, dtype=np.float64), tables)
    return tables


def laws_of(robot: OneLinkRobot, controller: Controller) -> tuple[FloatArray, FloatArray]:
    """Laws (4, 5) and inertias (2,) of robot and model, as `loop_parameters.mode_table` takes them."""
    laws = np.array([*_rows(robot.friction), *_rows(controller.model.friction)])
    return laws, np.array([robot.inertia, controller.model.inertia])


@compiled
def _fill(laws: FloatArray, inertia: FloatArray, gains: FloatArray, tables: FloatArray) -> None:
    for i in range(gains.shape[0]):
        mode_table(laws, inertia, gains[i], tables[i])


def _rows(friction: StribeckFriction) -> tuple[tuple[float, ...], ...]:
    return tuple(_row(curve) for curve in (friction.positive, friction.negative))


def _row(curve: StribeckCurve) -> tuple[float, ...]:
    return (
        curve.static_torque,
        curve.coulomb_torque,
        curve.stribeck_velocity,
        curve.viscous_damping,
        # without a Stribeck effect the shape is nobody's business: 1 keeps the mode analytic
        curve.stribeck_shape if curve.stribeck_torque > 0.0 else 1.0,
    )

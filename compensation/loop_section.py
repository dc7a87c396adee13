"""The closed loop as a return map, for those who look for its cycles and know no robot."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.loop_returns import MOST_HALTS, carry_for, derivative, returns
from compensation.loop_runs import is_analytic, run_for
from compensation.loop_tables import mode_parameters
from compensation.orbits.periodic_orbits import Returns
from ident.model.friction import StribeckFriction
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray
from ident.simulation.integrate import END_REASONS, EQUILIBRIUM, SECTION

TOLERANCE: Final = 1e-13  # of a step; series lose nothing by it
TOLERANCE_ELSE: Final = 1e-11  # of a Dormand-Prince step
GAIN_NAMES: Final = {"r": "compensation", "L": "observer", "n1": "proportional", "n2": "derivative"}
STILL: Final = 1e-12  # of x1, by which a link that rests may move between its halts: by rounding
PATIENCE: Final = 200.0  # [s] for one half turn


@dataclass(frozen=True)
class LoopSection:
    """The section v = 0 of a closed loop. Points are (x1 [rad], x2 [rad/s]) where the link halts."""

    loop: ClosedLoop

    @cached_property
    def symmetric(self) -> bool:
        """Whether robot and model are the same in both directions: then a return is half a turn."""
        return _even(self.loop.robot) and _even(self.loop.controller.model)

    @cached_property
    def _parameters(self) -> FloatArray:
        return mode_parameters(self.loop.robot, self.loop.controller)

    @cached_property
    def by_series(self) -> bool:
        """Whether the modes have Taylor series."""
        return is_analytic(self._parameters)

    @property
    def _tolerance(self) -> float:
        return TOLERANCE if self.by_series else TOLERANCE_ELSE

    def follow(self, point: FloatArray, returns: int) -> Returns:
        """The next returns after a point (2,) of the section."""
        return self.follow_state(_state(point), returns)

    def follow_state(self, state: FloatArray, count: int) -> Returns:
        """The next returns after any state (3,)."""
        rows = np.empty((count, 5))
        parameters = self._parameters
        made, reason = returns(
            run_for(parameters), parameters, self.symmetric, self._tolerance, PATIENCE, state, rows
        )
        still = rows[:made, 4] - rows[:made, 3] <= STILL * np.abs(rows[:made, 0])
        if still.any():  # at the edge of an equilibrium set
            made, reason = int(np.argmax(still)), EQUILIBRIUM
        rows = rows[:made]
        return Returns(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], END_REASONS[reason])

    def derivative(self, point: FloatArray) -> FloatArray | None:
        """Derivative (2, 2) of one return from a point (2,), None where the motion rests or grazes."""
        state = _state(point)
        slope = np.eye(2)
        run, carried = run_for(self._parameters), carry_for(self._parameters)
        accuracy = (self._tolerance, self._tolerance, PATIENCE)
        for _ in range(MOST_HALTS):
            before = state[0]
            once = np.empty((2, 2))
            _, reason = derivative(run, carried, self._parameters, *accuracy, state, once)
            if reason != SECTION or not np.all(np.isfinite(once)):  # a link at rest slips on by rounding
                return None
            slope = once @ slope
            if self.symmetric:
                return -slope
            if state[0] > before:
                return slope
        return None


def with_gain(loop: ClosedLoop, parameter: str, value: float) -> ClosedLoop:
    """The same loop with another r, L [1/s], n1 [N m/rad] or n2 [N m s/rad]."""
    name = GAIN_NAMES[parameter]
    gains = replace(loop.controller.gains, **{name: value})
    return replace(loop, controller=replace(loop.controller, gains=gains))


def _state(point: FloatArray) -> FloatArray:
    return np.array([point[0], point[1], -point[1]])


def _even(robot: OneLinkRobot) -> bool:
    friction: StribeckFriction = robot.friction
    return friction.positive == friction.negative

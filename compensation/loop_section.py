"""The closed loop as a return map, for those who look for its cycles and know no robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from compensation import controller
from compensation.closed_loop import ClosedLoop
from compensation.loop_returns import MOST_HALTS, carry_for, derivative, returns
from compensation.loop_runs import is_analytic, run_for, smallest_shape
from compensation.orbits.periodic_orbits import Returns
from ident.model.doors import expect
from ident.model.friction import ModelError, StribeckFriction
from ident.model.numbers import is_count, real_array, shown
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray
from ident.simulation.integrate import END_REASONS, EQUILIBRIUM, SECTION

TOLERANCE: Final = 1e-13  # of a step; series lose nothing by it
TOLERANCE_ELSE: Final = 1e-11  # of a Dormand-Prince step
REPEATS: Final = 1e-11  # relative distance of points that are the same
STILL: Final = 1e-8  # of x1, by which a link still moves that closes in on the edge of an equilibrium set
PATIENCE: Final = 800.0  # times of the loop's own, for one half turn


@dataclass(frozen=True)
class LoopSection:
    """The section v = 0 of a closed loop. Points are (x1 [rad], x2 [rad/s]) where the link halts."""

    loop: ClosedLoop

    def __post_init__(self) -> None:
        expect("loop", self.loop, ClosedLoop, "eq 8")

    @cached_property
    def symmetric(self) -> bool:
        """Whether robot and model are the same in both directions: then a return is half a turn."""
        return _even(self.loop.robot) and _even(self.loop.controller.model)

    @property
    def _parameters(self) -> FloatArray:
        return self.loop.modes

    @cached_property
    def by_series(self) -> bool:
        """Whether the modes have Taylor series."""
        return is_analytic(self._parameters)

    @property
    def tolerance(self) -> float:
        """Of a step, relative to the largest state."""
        return TOLERANCE if self.by_series else TOLERANCE_ELSE

    @property
    def accuracy(self) -> float:
        """Relative distance of points that are the same.

        Where a law falls as the power beta < 1 of the speed, an error e of x2 near zero is one of e^beta
        in the friction.
        """
        return REPEATS if self.lipschitz else TOLERANCE_ELSE ** smallest_shape(self._parameters)

    @property
    def lipschitz(self) -> bool:
        """Whether no law falls infinitely steeply from rest: all shapes are 1 or more."""
        return smallest_shape(self._parameters) >= 1.0

    def follow(self, point: FloatArray, returns: int) -> Returns:
        """The next returns after a point (2,) of the section.

        Raises `ModelError` for what is no point, or no count >= 1.
        """
        found = real_array(point)
        if found is None or found.shape != (2,) or not np.isfinite(found).all():
            raise ModelError(f"point is {shown(point)}: two finite numbers x1 [rad], x2 [rad/s] (eq 8)")
        if not (is_count(returns) and returns >= 1):
            raise ModelError(f"returns are {shown(returns)}: a whole number >= 1 (eq 8)")
        return self.follow_state(_state(found), int(returns))

    def follow_state(self, state: FloatArray, count: int) -> Returns:
        """The next returns after any state (3,)."""
        rows = np.empty((count, 5))
        parameters = self._parameters
        made, reason = returns(
            run_for(parameters), parameters, self.symmetric, self.tolerance, PATIENCE, state, rows
        )
        still = rows[:made, 4] - rows[:made, 3] <= STILL * np.abs(rows[:made, 0])
        if still.any():  # at the edge of an equilibrium set
            made, reason = int(np.argmax(still)), EQUILIBRIUM
        rows = rows[:made]
        return Returns(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], END_REASONS[reason])

    def derivative(self, point: FloatArray) -> FloatArray | None:
        """Derivative (2, 2) of one return from a point (2,), None where the motion rests or grazes.

        By deviations carried along, or by differences where a law is not Lipschitz: there the coefficients of
        the deviations' equation are unbounded near x2 = 0.
        """
        return self._carried(point) if self.lipschitz else self._by_differences(point)

    def _by_differences(self, point: FloatArray) -> FloatArray | None:
        by = math.sqrt(self.accuracy) * float(np.max(np.abs(point)))
        ends = [self.follow(point + step, 1).points for step in by * np.vstack([np.eye(2), -np.eye(2)])]
        if any(end.size == 0 for end in ends):
            return None
        return np.column_stack([ends[0][0] - ends[2][0], ends[1][0] - ends[3][0]]) / (2.0 * by)

    def _carried(self, point: FloatArray) -> FloatArray | None:
        state = _state(point)
        slope = np.eye(2)
        run, carried = run_for(self._parameters), carry_for(self._parameters)
        accuracy = (self.tolerance, self.tolerance, PATIENCE)
        for _ in range(MOST_HALTS):
            before = state[0]
            once = np.empty((3, 2))
            _, reason = derivative(run, carried, self._parameters, *accuracy, state, once)
            if reason != SECTION or not np.all(np.isfinite(once)):  # a link at rest slips on by rounding
                return None
            slope = once[:2] @ slope
            if self.symmetric:
                return -slope
            if state[0] > before:
                return slope
        return None


def with_gain(loop: ClosedLoop, parameter: str, value: float) -> ClosedLoop:
    """The same loop with another r, L [1/s], n1 [N m/rad] or n2 [N m s/rad]; `ModelError` for others."""
    return replace(loop, controller=controller.with_gain(loop.controller, parameter, value))


def _state(point: FloatArray) -> FloatArray:
    return np.array([point[0], point[1], -point[1]])


def _even(robot: OneLinkRobot) -> bool:
    friction: StribeckFriction = robot.friction
    return friction.positive == friction.negative

r"""Equilibrium sets of inclusion (8), eqs (9)-(10), for any robot, any compensator and any gains.

At an equilibrium the link rests while the observer has settled: v = 0, x3 = -x2 and

    x1 = -((L J^ + b^ + n2) / n1) x2                                                     second line of eq (9)

with the compensator's model under hats (b^ and F^ of the direction of x2). The controller then applies T =
-n1 x1 - n2 x2 + r F^(x2) = (L J^ + b^) x2 + r F^(x2), eq (10) with the factor r, and the link stays where it
is as long as the *robot* can hold it: -F_s(negative) <= T <= F_s(positive). A set point missed on the
negative side (x1 < 0) comes with x2 > 0, so the positive direction limits it.

The set point itself, x = 0, is always an equilibrium: at x2 = 0 the compensation can be zero. Beside it each
direction holds a few *segments*, ranges of x1 whose points are all equilibria:

* one that touches 0 exists in a direction whenever r F_s^ < F_s there, whatever L is (undercompensation);
* where r F_s^ > F_s the set point is isolated, and a segment, if there is one, has an inner edge;
* where r F_s^ = F_s (the paper's r = 1) a segment exists while L is below a critical value, eq (11).

The edges are roots of a scalar function: see `torque_balance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from compensation.controller import Controller, with_gain
from compensation.torque_balance import TorqueBalance
from ident.model.doors import expect
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.numbers import is_number, is_one_of, real_array, shown
from ident.model.robot import OneLinkRobot

Direction = Literal["positive", "negative"]
DIRECTIONS: tuple[Direction, Direction] = ("positive", "negative")


@dataclass(frozen=True)
class Segment:
    """A range of rest positions, all with the velocity estimate x2 of one direction."""

    direction: Direction  # of x2, and of the torque that the link withstands; x1 has the other sign
    speed_min: float  # least |x2| [rad/s]; 0 where the segment touches the set point
    speed_max: float  # largest |x2| [rad/s]; infinite if the observer has neither gain nor damping
    x1_min: float  # [rad]
    x1_max: float  # [rad]

    @property
    def touches_zero(self) -> bool:
        """Whether the segment begins at the set point."""
        return self.speed_min == 0.0


@dataclass(frozen=True)
class EquilibriumSet:
    """The set point and the segments beside it, in rising order of x1."""

    segments: tuple[Segment, ...]

    @property
    def x1_min(self) -> float:
        """Lowest rest position [rad], at most 0."""
        return min((segment.x1_min for segment in self.segments), default=0.0)

    @property
    def x1_max(self) -> float:
        """Highest rest position [rad], at least 0."""
        return max((segment.x1_max for segment in self.segments), default=0.0)

    @property
    def largest_error(self) -> float:
        """max|x1| [rad]: the largest position error at rest."""
        return max(-self.x1_min, self.x1_max)

    @property
    def is_single_point(self) -> bool:
        """Whether the set point is the only equilibrium."""
        return not self.segments

    @property
    def origin_isolated(self) -> bool:
        """Whether no segment touches the set point."""
        return not any(segment.touches_zero for segment in self.segments)

    def contains(self, position: float, *, tolerance: float = 0.0) -> bool:
        """Whether x1 = `position` [rad] is within `tolerance` [rad] of an equilibrium."""
        if not (is_number(position) and is_number(tolerance) and tolerance >= 0.0):
            raise ModelError(
                f"position is {position!r} rad, tolerance {tolerance!r} rad: finite, tolerance >= 0 (eq 9)"
            )
        if abs(position) <= tolerance:
            return True
        return any(s.x1_min - tolerance <= position <= s.x1_max + tolerance for s in self.segments)


def equilibrium_set(robot: OneLinkRobot, controller: Controller) -> EquilibriumSet:
    """Every equilibrium of the robot under the controller, eqs (9)-(10)."""
    expect("robot", robot, OneLinkRobot, "eq 1")
    expect("controller", controller, Controller, "eqs 5-7")
    segments = [
        _segment(controller, direction, low, high)
        for direction in DIRECTIONS
        for low, high in torque_balance(robot, controller, direction).resting()
    ]
    return EquilibriumSet(tuple(sorted(segments, key=lambda segment: segment.x1_min)))


def equilibrium_sets(
    robot: OneLinkRobot, controller: Controller, *, parameter: Literal["r", "L"], values: ArrayLike
) -> tuple[EquilibriumSet, ...]:
    """The sets at `values` (n,) of r or of L [1/s], the other gains as in `controller`: figures 4, 8 and 9.

    Raises `ModelError` for another parameter, or a value that is no gain.
    """
    grid = real_array(values)
    if grid is None or grid.ndim != 1:
        raise ModelError(f"values of {parameter} are {shown(values)}: a list of numbers (eqs 9-10)")
    return tuple(equilibrium_set(robot, with_gain(controller, parameter, value)) for value in grid.tolist())


def curve_of(friction: StribeckFriction, direction: Direction) -> StribeckCurve:
    """The curve of one direction; `ModelError` for another word."""
    if not is_one_of(direction, DIRECTIONS):
        raise ModelError(
            f"direction is {shown(direction)}: 'positive' or 'negative', the sign of x2 (eqs 9-10)"
        )
    return friction.positive if direction == "positive" else friction.negative


def torque_balance(robot: OneLinkRobot, controller: Controller, direction: Direction) -> TorqueBalance:
    """What the controller applies at rest against what the robot withstands, for x2 in `direction`.

    Raises `ModelError` for another word than a direction.
    """
    true, believed = curve_of(robot.friction, direction), curve_of(controller.model.friction, direction)
    r = controller.gains.compensation
    return TorqueBalance(
        slope=believed.viscous_damping + controller.gains.observer * controller.model.inertia,
        onset=r * believed.static_torque - true.static_torque,
        fading=r * believed.stribeck_torque,
        stribeck_velocity=believed.stribeck_velocity,
        stribeck_shape=believed.stribeck_shape,
    )


def _segment(controller: Controller, direction: Direction, low: float, high: float) -> Segment:
    model, gains = controller.model, controller.gains
    believed = curve_of(model.friction, direction)
    stiffness = gains.observer * model.inertia + believed.viscous_damping + gains.derivative
    near = stiffness * low / gains.proportional
    far = stiffness * high / gains.proportional if stiffness > 0.0 else 0.0  # inf x 0 where nothing resists
    ends = (-far, -near) if direction == "positive" else (near, far)
    x1_min, x1_max = (0.0 if end == 0.0 else end for end in ends)  # no -0.0
    return Segment(direction, low, high, x1_min, x1_max)

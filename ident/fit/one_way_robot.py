"""A robot with the fitted law of one direction both ways, to simulate motion in that direction."""

from __future__ import annotations

from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import Direction
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot


def robot_one_way(
    fit: FrictionFit, direction: Direction, *, static_torque: float | None = None
) -> OneLinkRobot | None:
    """None where the values are no robot's. Another F_s [N m] may be given; a law that is a line has none."""
    coulomb, stribeck, velocity, damping, shape = fit.law(direction)
    static = coulomb + stribeck if static_torque is None else static_torque
    if fit.model.law_of(direction) in fit.model.lines:
        static = coulomb
    try:
        curve = StribeckCurve(static, coulomb, velocity, damping, shape)
        return OneLinkRobot(fit.values["inertia"], StribeckFriction(curve, curve))
    except ModelError:
        return None

r"""What coexists: equilibria beside the limit cycle for r > 1, and which starts end where.

Beside the set point a direction holds a rest with the estimate s = |x2| > 0 while (`torque_balance`)

    h(s) = a s + r g^(s) - F_s <= 0,    that is    r <= R(s) = (F_s - a s) / g^(s),

a = b^ + L J^ and F_s the robot's static friction in that direction. So r_max = sup R(s): the largest r up
to which the loop can rest off the set point. It exceeds F_s/F_s^ (the paper's r = 1) exactly while L is
below the critical gain of the equilibria; there rests and the limit cycle coexist for 1 < r <= r_max.

* beta = 1: h touches zero where h = h' = 0, which with A = a v_s gives r F_c^ + A ln(r dF^/A) = F_s - A, and

      r_max = (A / F_c^) omega(F_s/A - 1 - ln(dF^/F_c^)),    omega(z) + ln omega(z) = z

  (Wright's function, which is Lambert's W of e^z); for F_c^ = 0, r_max = (A/dF^) exp(F_s/A - 1). The point of
  touch must lie at s > 0, r_max dF^ > A; otherwise R falls from its value at 0.
* other beta: R' = 0 where u(s) = (F_s - a s)(-g^'/g^) = a. With y = (s/v_s)^beta,

      s d(ln u)/ds = (beta - 1) - beta y F_c^/(F_c^ + dF^ e^-y) - a s/(F_s - a s)

  falls all the way: u rises to one peak, for beta > 1, and falls after it (for beta < 1 it only falls). R
  has its only interior maximum where u comes down through a; it competes with R(0) = F_s/F_s^.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from scipy.optimize import brentq
from scipy.special import wrightomega

from compensation.controller import Controller
from compensation.equilibria import Direction
from ident.model.friction import StribeckCurve
from ident.model.robot import OneLinkRobot

LARGEST: Final = 700.0  # exponents beyond are infinite


@dataclass(frozen=True)
class LargestRest:
    """The largest r at which a direction still holds a rest beside the set point, and where that is."""

    r: float  # [-]; infinite where the compensation has nothing to push with
    estimate: float  # |x2| [rad/s] of that rest; 0: it shrinks into the set point
    x1: float  # [rad] of that rest


@dataclass(frozen=True)
class Coexistence:
    """r_max of each direction of the estimate x2."""

    positive: LargestRest
    negative: LargestRest

    @property
    def r_max(self) -> float:
        """The largest r [-] with a rest beside the set point, in whichever direction."""
        return max(self.positive.r, self.negative.r)


def largest_compensation_with_rest(robot: OneLinkRobot, controller: Controller) -> Coexistence:
    """r_max for the robot under the controller's model and gains; the controller's own r does not count."""
    return Coexistence(
        positive=_largest_rest(robot, controller, "positive"),
        negative=_largest_rest(robot, controller, "negative"),
    )


def largest_compensation(robot: OneLinkRobot, controller: Controller, *, observer_gain: float) -> float:
    """r_max(L) at L = `observer_gain` [1/s]."""
    gains = replace(controller.gains, observer=observer_gain)
    return largest_compensation_with_rest(robot, replace(controller, gains=gains)).r_max


def _largest_rest(robot: OneLinkRobot, controller: Controller, direction: Direction) -> LargestRest:
    true, model = robot.friction, controller.model
    held = (true.positive if direction == "positive" else true.negative).static_torque
    believed = model.friction.positive if direction == "positive" else model.friction.negative
    slope = believed.viscous_damping + controller.gains.observer * model.inertia
    r, speed = _supremum(believed, slope, held)
    stiffness = (slope + controller.gains.derivative) / controller.gains.proportional
    x1 = stiffness * speed if speed > 0.0 and stiffness > 0.0 else 0.0
    return LargestRest(r=r, estimate=speed, x1=-x1 if direction == "positive" and x1 > 0.0 else x1)


def _supremum(curve: StribeckCurve, slope: float, held: float) -> tuple[float, float]:
    """sup over s of (held - slope s)/g(s), and the s [rad/s] at which it is."""
    at_zero = held / curve.static_torque if curve.static_torque > 0.0 else math.inf
    if curve.static_torque == 0.0 or curve.stribeck_torque == 0.0 or held == 0.0:
        return at_zero, 0.0
    if slope == 0.0:
        return (held / curve.coulomb_torque if curve.coulomb_torque > 0.0 else math.inf), math.inf
    touch = _touch_in_closed_form if curve.stribeck_shape == 1.0 else _touch_by_search
    inside = touch(curve, slope, held)
    return inside if inside is not None and inside[0] > at_zero else (at_zero, 0.0)


def _touch_in_closed_form(curve: StribeckCurve, slope: float, held: float) -> tuple[float, float] | None:
    """r and s [rad/s] at which h touches zero, for beta = 1."""
    torque = slope * curve.stribeck_velocity
    if curve.coulomb_torque > 0.0:
        exponent = held / torque - 1.0 - math.log(curve.stribeck_torque / curve.coulomb_torque)
        r = torque / curve.coulomb_torque * float(wrightomega(exponent).real)
    else:
        exponent = held / torque - 1.0
        r = torque / curve.stribeck_torque * math.exp(exponent) if exponent < LARGEST else math.inf
    if r * curve.stribeck_torque <= torque:
        return None
    speed = (held - r * curve.coulomb_torque - torque) / slope
    return r, speed if curve.coulomb_torque > 0.0 else curve.stribeck_velocity * exponent


def _touch_by_search(curve: StribeckCurve, slope: float, held: float) -> tuple[float, float] | None:
    """The interior maximum of R, r and s [rad/s], for beta != 1."""
    beta, width, end = curve.stribeck_shape, curve.stribeck_velocity, held / slope

    def dry(y: float) -> float:
        return curve.coulomb_torque + curve.stribeck_torque * math.exp(-y)

    def steepness(speed: float) -> float:
        """u(s) - a."""
        y: float = (speed / width) ** beta
        fall: float = curve.stribeck_torque * beta * y * math.exp(-y) / speed
        return (held - slope * speed) * fall / dry(y) - slope

    def floor(y: float) -> float:
        return beta * y * curve.coulomb_torque / dry(y) if curve.coulomb_torque > 0.0 else 0.0

    def bend(speed: float) -> float:
        y: float = (speed / width) ** beta
        return (beta - 1.0) - floor(y) - slope * speed / (held - slope * speed)

    near, far = 1e-12 * min(end, width), end * (1.0 - 1e-15)
    low = near
    if beta > 1.0:
        low = float(brentq(bend, near, far, xtol=1e-300, rtol=1e-14))
    if steepness(low) <= 0.0:
        return None
    speed = float(brentq(steepness, low, end, xtol=1e-300, rtol=1e-14))
    return (held - slope * speed) / dry((speed / width) ** beta), speed

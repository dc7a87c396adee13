r"""What coexists: equilibria beside the limit cycle for r > 1, and which starts end where.

Beside the set point a direction holds a rest with the estimate s = |x2| > 0 while (`torque_balance`)

    h(s) = a s + r g^(s) - F_s <= 0,    that is    r <= R(s) = (F_s - a s) / g^(s),

a = b^ + L J^ and F_s the robot's static friction in that direction. So r_max = sup R(s): the largest r up
to which the loop can rest off the set point. It exceeds F_s/F_s^ (the paper's r = 1) exactly while L is
below the critical gain of the equilibria; there rests and the limit cycle coexist for 1 < r <= r_max.

With E = F_s/(a v_s), z = s/v_s and y = z^beta:

* beta = 1: h touches zero where h = h' = 0, and

      r_max = (F_s/F_c^) omega/E,    omega + ln omega = E - 1 - ln(dF^/F_c^)

  (Wright's function, which is Lambert's W of an exponential); for F_c^ = 0, r_max = F_s exp(E - 1)/(E dF^).
  The touch must lie at z > 0, E dF^ > F_s^; otherwise R falls from its value at 0.
* other beta: R' = 0 where u(z) = (E - z) beta z^(beta - 1) rho = 1, rho = dF^ e^-y/(F_c^ + dF^ e^-y), and

      z d(ln u)/dz = (beta - 1) - z/(E - z) - beta y (1 - rho)

  falls all the way: u rises to one peak, for beta > 1, and falls after it (for beta < 1 it only falls). R
  has its only interior maximum where u comes down through 1; it competes with R(0) = F_s/F_s^.

E spans hundreds of decades over what laws and gains may be, e^-y fades below every number, and without
Coulomb friction the touch comes as near to E as it likes. So everything is a logarithm here, and the
search runs over p = ln ln(E/z), which tells the values of z apart at both ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from scipy.special import wrightomega

from compensation.controller import Controller
from compensation.equilibria import Direction
from ident.model.doors import expect
from ident.model.friction import StribeckCurve
from ident.model.robot import OneLinkRobot

LARGEST: Final = 709.0  # exponents beyond are infinite
FADED: Final = 600.0  # ln y beyond which e^-y is nothing
NEAREST: Final = -744.0  # p of the z nearest to E: ln of the least number
FARTHEST: Final = 1500.0  # -ln z beyond which z is 0, whatever v_s is
BISECTIONS: Final = 64  # of p, to its last digit


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
    expect("robot", robot, OneLinkRobot, "eq 1")
    expect("controller", controller, Controller, "eqs 5-7")
    return Coexistence(
        positive=_largest_rest(robot, controller, "positive"),
        negative=_largest_rest(robot, controller, "negative"),
    )


def largest_compensation(robot: OneLinkRobot, controller: Controller, *, observer_gain: float) -> float:
    """r_max(L) at L = `observer_gain` [1/s]."""
    expect("robot", robot, OneLinkRobot, "eq 1")
    expect("controller", controller, Controller, "eqs 5-7")
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
    if held == 0.0:
        return 0.0, 0.0
    if curve.static_torque == 0.0:
        return math.inf, 0.0
    at_zero = held / curve.static_torque
    if curve.stribeck_torque == 0.0:
        return at_zero, 0.0
    if slope == 0.0:
        return (held / curve.coulomb_torque if curve.coulomb_torque > 0.0 else math.inf), math.inf
    touch = _touch_in_closed_form if curve.stribeck_shape == 1.0 else _touch_by_search
    inside = touch(curve, math.log(held) - math.log(slope) - math.log(curve.stribeck_velocity))
    if inside is None:
        return at_zero, 0.0
    log_r, log_z = inside[0] + math.log(held), inside[1]
    r = _exp(log_r)
    return (r, curve.stribeck_velocity * _exp(log_z)) if r > at_zero else (at_zero, 0.0)


def _touch_in_closed_form(curve: StribeckCurve, log_end: float) -> tuple[float, float] | None:
    """ln(r/F_s) and ln z where h touches zero, for beta = 1 and ln E = `log_end`."""
    if log_end + math.log(curve.stribeck_torque) <= math.log(curve.static_torque):
        return None
    exponent = math.expm1(min(log_end, LARGEST))
    if curve.coulomb_torque == 0.0:
        return exponent - log_end - math.log(curve.stribeck_torque), math.log(exponent)
    log_fall = _log_fall(curve)
    omega = float(wrightomega(exponent - log_fall).real)
    log_omega = math.log(omega) if omega > 1.0 else exponent - log_fall - omega
    if log_end > LARGEST:
        log_omega = log_end  # omega and E are one
    z = log_fall + log_omega
    return (log_omega - log_end - math.log(curve.coulomb_torque), math.log(z)) if z > 0.0 else None


def _touch_by_search(curve: StribeckCurve, log_end: float) -> tuple[float, float] | None:
    """ln(r/F_s) and ln z at the interior maximum of R, for beta != 1 and ln E = `log_end`."""
    beta, log_fall = curve.stribeck_shape, _log_fall(curve)

    def faded(p: float) -> float:
        """y, finite."""
        return math.exp(min(beta * (log_end - math.exp(p)), FADED))

    def log_u(p: float) -> float:
        log_z = log_end - math.exp(p)
        return log_end + _log_gap(p) + math.log(beta) + (beta - 1.0) * log_z - _softplus(faded(p) - log_fall)

    def bend(p: float) -> float:
        """z d(ln u)/dz."""
        y = faded(p)
        coulomb_share = math.exp(-_softplus(log_fall - y))
        return (beta - 1.0) - 1.0 / math.expm1(min(math.exp(p), LARGEST)) - beta * y * coulomb_share

    peak = math.log(max(log_end + FARTHEST, 1.0))
    if beta > 1.0:
        peak = _where_positive(bend, NEAREST, peak)
    if log_u(peak) <= 0.0:
        return None
    p = _where_positive(log_u, NEAREST, peak)
    log_dry = math.log(curve.stribeck_torque) - faded(p) + _softplus(faded(p) - log_fall)
    return _log_gap(p) - log_dry, log_end - math.exp(p)


def _where_positive(function: Callable[[float], float], low: float, high: float) -> float:
    """The least p from which a function that rises through 0 between `low` and `high` is positive."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if function(middle) > 0.0 else (middle, high)
    return high


def _log_gap(p: float) -> float:
    """ln(1 - z/E)."""
    return math.log(-math.expm1(-math.exp(p)))


def _log_fall(curve: StribeckCurve) -> float:
    """ln(dF/F_c)."""
    if curve.coulomb_torque == 0.0:
        return math.inf
    return math.log(curve.stribeck_torque) - math.log(curve.coulomb_torque)


def _softplus(x: float) -> float:
    """ln(1 + e^x)."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


def _exp(x: float) -> float:
    return math.exp(x) if x <= LARGEST else math.inf

r"""The design criteria of section 4: critical observer gain, decay rates, sector bound, eqs (11)-(17).

Seen alone, the observer error e = x3 obeys (exact model, any given x2(t))

    e' = -(L + b/J) e + (F(x2) - F(x2 + e)) / J                                           third line of eq (8)

The falling part of the Stribeck curve drives errors apart, at most as steeply as -lambda = eta dF / v_s, eqs
(12)-(13); damping and observer gain pull them together. With the incremental sector bound

    (F(x2) - F(x2 + x3)) x3 <= -lambda x3^2                                                           eq (16)

V = J e^2 / 2 obeys V' <= -2 (L - L_c) V, eq (17), with

    L_c = (eta dF / v_s - b) / J                                                                      eq (11)

On a robot with a law for each direction the steepest of the two counts: `worst`. The gains of the single
directions are local statements, about creeping that way. `mean` belongs to the robot with the mean law, the
paper's 73.07, and says nothing about a robot that is not its mean. For beta < 1 the law is infinitely steep
at 0 and no gain is enough.

The rest of the loop, (x1, x2) without error, is x1' = x2, x2' = -(n1/J) x1 - ((b + n2)/J) x2. (Eq (14) of the
text prints --n1/J in A_II; eq (8) has the sign that is meant.) It uses the controller's own J^ and b^.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.controller import Controller
from ident.model.doors import expect
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.numbers import is_number, real_array, shown
from ident.model.robot import OneLinkRobot


@dataclass(frozen=True)
class CriticalGains:
    """L_c [1/s] of each direction, of the mean law, and of the worse direction; infinite for beta < 1.

    A negative one means that damping alone is enough.
    """

    positive: float
    negative: float
    mean: float
    worst: float


def critical_observer_gain(curve: StribeckCurve, *, inertia: float) -> float:
    """L_c [1/s] of one curve on an inertia [kg m^2], eqs (11)-(13). `ModelError` for what is no inertia."""
    expect("curve", curve, StribeckCurve, "eq 3")
    if not (is_number(inertia) and inertia > 0):
        raise ModelError(f"inertia is {inertia!r} kg m^2: a finite J > 0 (eq 11)")
    return (curve.steepest_fall - curve.viscous_damping) / inertia


def critical_observer_gains(robot: OneLinkRobot) -> CriticalGains:
    """The critical gains of the robot itself, whatever its compensator believes."""
    expect("robot", robot, OneLinkRobot, "eq 1")
    friction, inertia = robot.friction, robot.inertia
    positive = critical_observer_gain(friction.positive, inertia=inertia)
    negative = critical_observer_gain(friction.negative, inertia=inertia)
    mean = critical_observer_gain(friction.mean().positive, inertia=inertia)
    return CriticalGains(positive=positive, negative=negative, mean=mean, worst=max(positive, negative))


def sector_constant(friction: StribeckFriction) -> float:
    """lambda [N m s/rad] of eq (12), the least slope of the law away from 0, over both directions; <= 0."""
    expect("friction", friction, StribeckFriction, "eqs 2-4")
    return -max(friction.positive.steepest_fall, friction.negative.steepest_fall)


def sector_slack(friction: StribeckFriction, x2: ArrayLike, x3: ArrayLike) -> NDArray[np.float64]:
    """-lambda x3^2 - (F(x2) - F(x2 + x3)) x3 [N m rad/s], what eq (16) leaves; never negative.

    x2, x3 [rad/s] of any common shape. Where the law is set-valued, its worst values are taken. Raises
    `ModelError` for what is no velocity, or shapes that do not fit.
    """
    expect("friction", friction, StribeckFriction, "eqs 2-4")
    estimate, error = _velocities("x2", x2), _velocities("x3", x3)
    try:
        np.broadcast_shapes(estimate.shape, error.shape)
    except ValueError:
        raise ModelError(
            f"x2 of shape {estimate.shape}, x3 of shape {error.shape}: one common shape (eq 16)"
        ) from None
    low, high = friction.torque_interval(estimate)
    low_true, high_true = friction.torque_interval(estimate + error)
    difference = np.where(error > 0, high - low_true, low - high_true)
    return -sector_constant(friction) * error**2 - difference * error


def _velocities(name: str, values: ArrayLike) -> NDArray[np.float64]:
    found = real_array(values)
    if found is None or not np.all(np.isfinite(found)):
        raise ModelError(f"{name} is {shown(values)}: finite numbers [rad/s] (eq 16)")
    return found


def observer_error_decay(robot: OneLinkRobot, observer_gain: float) -> float:
    """L - L_c(worst) [1/s], the guaranteed exponential rate of eq (17).

    Errors of two solutions under the same x2(t) approach each other at this rate. Negative: while the link
    creeps in the worse direction, errors grow. Raises `ModelError` unless L > 0, which eq (17) needs.
    """
    expect("robot", robot, OneLinkRobot, "eq 1")
    if not (is_number(observer_gain) and observer_gain > 0):
        raise ModelError(f"observer_gain is {observer_gain!r} 1/s: a finite L > 0 (eq 17)")
    return observer_gain - critical_observer_gains(robot).worst


@dataclass(frozen=True)
class LoopDecay:
    """The loop without observer error: how fast (x1, x2) goes to zero."""

    rate: float  # [1/s], > 0: exponential
    positive: tuple[complex, complex]  # eigenvalues of A_II while x2 > 0 [1/s]
    negative: tuple[complex, complex]  # while x2 < 0 [1/s]


def loop_decay(controller: Controller) -> LoopDecay:
    """Decay of subsystem S_II without input, from the eigenvalues of A_II.

    With a damping for each direction A_II switches with the sign of x2. Where both pairs are complex, x2 > 0
    lasts pi/w+ and x2 < 0 pi/w-, and the rate is the average over a turn. A direction with real eigenvalues
    is never left again: its slower one is the rate (the slower of both, if both are real).
    """
    expect("controller", controller, Controller, "eqs 5-7")
    friction = controller.model.friction
    pairs = [_eigenvalues(controller, friction.positive), _eigenvalues(controller, friction.negative)]
    monotone = [-max(pair[0].real, pair[1].real) for pair in pairs if pair[0].imag == 0.0]
    if monotone:
        rate = min(monotone)
    else:
        times = [math.pi / abs(pair[0].imag) for pair in pairs]
        rate = -sum(t * pair[0].real for t, pair in zip(times, pairs, strict=True)) / sum(times)
    return LoopDecay(rate=rate, positive=pairs[0], negative=pairs[1])


def _eigenvalues(controller: Controller, curve: StribeckCurve) -> tuple[complex, complex]:
    gains, inertia = controller.gains, controller.model.inertia
    half = 0.5 * (curve.viscous_damping + gains.derivative) / inertia
    root = cmath.sqrt(half * half - gains.proportional / inertia)
    if root.imag == 0.0:  # product of the roots, so that the slow one does not cancel
        fast = -half - root.real
        return complex(gains.proportional / inertia / fast), complex(fast)
    return complex(-half, root.imag), complex(-half, -root.imag)

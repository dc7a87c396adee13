r"""The robot under held torque samples, exact between the samples.

A digital controller holds its torque u for a sample period h. Eq (1) is then autonomous in each direction
of motion,

    J v' = u - b v - F(v),

so the speed is monotone while the link slips: it comes to rest at most once in a period. At rest the link
stays for the rest of the period if -F_s(negative) <= u <= F_s(positive), and otherwise goes on in the
direction of u. Slip is integrated by a Taylor series whose step follows from its own last terms
(`ident.slip_series`); for beta other than 1 the moments next to rest are a quadrature (`ident.near_rest`).
No step size is left to choose: the result is exact to rounding for any sample period and any admissible
law.

A joint may also have a torque that depends on its position (cogging, a gear's teeth). It is taken constant
over a sample period, like the torque that it adds to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final, Literal

import numpy as np

from data.recording import FloatArray
from ident.model.friction import ModelError
from ident.model.numbers import is_number, is_one_of, keep_floats, real_array, shown
from ident.model.robot import OneLinkRobot
from ident.near_rest import slip_near_rest, speed_limit
from ident.simulation.compiled import compiled, owning
from ident.slip_series import (
    distance_at,
    expand,
    part_at_distance,
    part_at_rest,
    speed_at,
    workspace,
)

_MOST_STEPS: Final = 100_000  # far above what any law needs: a loop that cannot end is worse than a NaN
_NEAR: Final = 10.0  # so many periods from rest the series takes a period in its stride
_AT_REST: Final = 1e-150  # [rad/s]: a speed that only fades (u = F_s, beta > 1) is 0 before it underflows
_EARLY: Final = 1e-9  # where beta is not 1, a ramp's series starts at this part of the shortest delay


def law_array(robot: OneLinkRobot) -> FloatArray:
    """The robot as kernels see it, (11,), SI: J, then F_s, F_c, v_s, b, beta of either direction."""
    values = [robot.inertia]
    for curve in (robot.friction.positive, robot.friction.negative):
        values += [
            curve.static_torque,
            curve.coulomb_torque,
            curve.stribeck_velocity,
            curve.viscous_damping,
            curve.stribeck_shape,
        ]
    return np.array(values)


@dataclass(frozen=True)
class TorqueRipple:
    """A torque amplitude x sin(harmonic x q + phase) that acts beside the motor's; none by default.

    Raises `ModelError` for what is no number.
    """

    amplitude: float = 0.0  # [N m]
    harmonic: float = 0.0  # [1/rad]: periods in a revolution
    phase: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not is_number(value):
                raise ModelError(f"ripple {field.name} is {value!r}: a finite number (u of eq 1)")
        keep_floats(self, (field.name for field in fields(self)))


NO_RIPPLE: Final = TorqueRipple()


def plant_array(robot: OneLinkRobot, ripple: TorqueRipple = NO_RIPPLE) -> FloatArray:
    """The robot and its ripple as kernels see them, (14,), SI: `law_array`, amplitude, harmonic, phase."""
    return np.array([*law_array(robot), ripple.amplitude, ripple.harmonic, ripple.phase])


@owning
def advance(
    position: float, velocity: float, torque: float, period: float, law: FloatArray
) -> tuple[float, float]:
    """Position [rad] and velocity [rad/s] after `period` [s] under a held `torque` [N m].

    `law` is a `law_array`, or a `plant_array`, whose ripple is left to `advance_with_ripple`.
    """
    if velocity == 0.0 and -law[6] <= torque <= law[1]:
        return position, 0.0
    series = workspace()
    inertia, left = law[0], period
    for _ in range(_MOST_STEPS):
        if velocity == 0.0:
            if -law[6] <= torque <= law[1]:
                return position, 0.0
            sign = 1.0 if torque > 0.0 else -1.0
        else:
            sign = 1.0 if velocity > 0.0 else -1.0
        curve = law[1:6] if sign > 0.0 else law[6:11]
        speed, excess = abs(velocity), sign * torque - curve[0]
        plain = curve[4] == 1.0 or curve[0] == curve[1]
        near = speed * inertia < _NEAR * left * abs(excess)
        if near and not plain and speed < speed_limit(excess, curve):
            speed, distance, used = slip_near_rest(speed, excess, left, inertia, curve)
        else:
            order, used = expand(speed, (excess, 0.0), left, (inertia, curve), series)
            part = 1.0
            speed = speed_at(series, order, 1.0)
            if speed <= 0.0:
                part = part_at_rest(series, order)
            if speed < _AT_REST:
                speed = 0.0
            distance = distance_at(series, order, part, used)
            used *= part
        position += sign * distance
        velocity = sign * speed if speed > 0.0 else 0.0  # no -0.0
        left -= used
        if left <= 0.0:
            return position, velocity
    return math.nan, math.nan


@compiled
def advance_with_ripple(
    position: float, velocity: float, torque: float, period: float, plant: FloatArray
) -> tuple[float, float]:
    """As `advance`, with the ripple of a `plant_array` at the sample's position added to the torque."""
    added = plant[11] * math.sin(plant[12] * position + plant[13]) if plant[11] != 0.0 else 0.0
    return advance(position, velocity, torque + added, period, plant)


@owning
def _respond(
    position: float, velocity: float, torque: FloatArray, period: float, law: FloatArray
) -> tuple[FloatArray, FloatArray]:
    positions = np.empty(torque.size + 1)
    velocities = np.empty(torque.size + 1)
    positions[0], velocities[0] = position, velocity
    for k in range(torque.size):
        position, velocity = advance(position, velocity, torque[k], period, law)
        positions[k + 1], velocities[k + 1] = position, velocity
    return positions, velocities


def respond(
    robot: OneLinkRobot, *, start: tuple[float, float], torque: FloatArray, period: float
) -> tuple[FloatArray, FloatArray]:
    """Motion of the robot under torque samples held for a period each, eqs (1)-(4).

    Parameters
    ----------
    start : position [rad] and velocity [rad/s] at the first sample
    torque : (n,) [N m], sample k held from k h to (k + 1) h
    period : h [s], > 0

    Returns
    -------
    position (n + 1,) [rad], velocity (n + 1,) [rad/s], at the samples and at the end of the last one.

    Raises `ModelError` for a period, start or torque that no rig can have.
    """
    if not (is_number(period) and period > 0):
        raise ModelError(f"sample period is {period!r} s: a finite h > 0 for which u is held (eq 1)")
    held, x0 = real_array(torque), real_array(start)
    if held is None or held.ndim != 1 or not np.isfinite(held).all():
        raise ModelError(f"torque is {shown(torque)}: one array (n,) of finite u [N m] (eq 1)")
    if x0 is None or x0.shape != (2,) or not np.isfinite(x0).all():
        raise ModelError(f"start is {shown(start)}: two finite numbers q [rad], v [rad/s] (eq 1)")
    position, velocity = x0.tolist()
    positions, velocities = _respond(position, velocity, held, float(period), law_array(robot))
    return positions, velocities


@owning
def _breakaway_delay(ramp: float, travel: float, inertia: float, curve: FloatArray) -> float:
    series = workspace()
    stribeck_torque = curve[0] - curve[1]
    time = speed = distance = 0.0
    whole = (6.0 * inertia * travel / ramp) ** (1.0 / 3.0)  # the delay without a Stribeck effect
    if curve[4] != 1.0 and stribeck_torque > 0.0:
        time = _EARLY * min(whole, math.sqrt(2.0 * inertia * travel / stribeck_torque))
        speed = 0.5 * ramp * time * time / inertia
        distance = speed * time / 3.0
    for _ in range(_MOST_STEPS):
        order, step = expand(speed, (ramp * time, ramp), whole, (inertia, curve), series)
        gone = distance_at(series, order, 1.0, step)
        if distance + gone >= travel:
            return time + step * part_at_distance(series, order, step, travel - distance)
        time, distance, speed = time + step, distance + gone, speed_at(series, order, 1.0)
    return math.nan


def breakaway_delay(
    robot: OneLinkRobot, *, direction: Literal["positive", "negative"], ramp_rate: float, travel: float
) -> float:
    """Time [s] from the onset of slip to a displacement, under a torque ramp that goes on.

    The onset is where |u| = F_s of the `direction`; `ramp_rate` [N m/s] and `travel` [rad] are magnitudes.
    A detector that waits for `travel` therefore reads a static torque that is too large by `ramp_rate`
    times this delay. For small travel and beta = 1 it tends to the root of (u' tau^2 / J) (tau (e^(t/tau) -
    1) - t - t^2 / (2 tau)) = travel, with tau = J / (dF / v_s - b). Raises `ModelError` unless both
    magnitudes are finite and > 0, and the direction is one of the two.
    """
    if not is_one_of(direction, ("positive", "negative")):
        raise ModelError(f"direction is {shown(direction)}: 'positive' or 'negative' (eqs 2-4)")
    for name, value in (("ramp_rate", ramp_rate), ("travel", travel)):
        if not (is_number(value) and value > 0):
            raise ModelError(
                f"{name} is {value!r}: a breakaway needs a ramp rate and a travel > 0, as magnitudes (eq 1)"
            )
    law = law_array(robot)
    curve = law[1:6] if direction == "positive" else law[6:11]
    return float(_breakaway_delay(float(ramp_rate), float(travel), robot.inertia, curve))

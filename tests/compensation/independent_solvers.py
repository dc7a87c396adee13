"""Two other ways to solve inclusion (8), from its equations in (x1, x2, v), sharing no code with ours.

`piecewise`: scipy's DOP853 with events between hand-made modes. `time_stepping`: Moreau's implicit scheme,
which knows no events at all and is first order; the random campaign of the benchmarks uses it too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.time_stepping import march
from compensation.closed_loop import ClosedLoop
from ident.model.friction import StribeckCurve

FloatArray = NDArray[np.float64]
NUDGE = 1e-13  # [rad/s] keeps scipy from finding again, by rounding, the surface that it has just left
MOST_EVENTS = 300


def dry(curve: StribeckCurve, speed: float) -> float:
    fading = np.exp(-((max(speed, 0.0) / curve.stribeck_velocity) ** curve.stribeck_shape))
    return curve.coulomb_torque + (curve.static_torque - curve.coulomb_torque) * float(fading)


class Equations:
    def __init__(self, loop: ClosedLoop) -> None:
        self.robot, self.model, self.gains = loop.robot, loop.controller.model, loop.controller.gains

    def curves(self, s2: float, sv: float) -> tuple[StribeckCurve, StribeckCurve]:
        model, true = self.model.friction, self.robot.friction
        return (model.positive if s2 > 0 else model.negative), (true.positive if sv > 0 else true.negative)

    def torque(self, x1: float, x2: float, s2: float) -> float:
        g = self.gains
        believed, _ = self.curves(s2, 1.0)
        feedback = -g.proportional * x1 - g.derivative * x2
        return float(feedback + g.compensation * s2 * dry(believed, s2 * x2))

    def estimate_rate(self, x1: float, x2: float, v: float, s2: float) -> float:
        g = self.gains
        believed, _ = self.curves(s2, 1.0)
        inside = -g.proportional * x1 - (believed.viscous_damping + g.derivative) * x2
        return float(inside / self.model.inertia + g.observer * (v - x2))

    def slip(self, s2: float, sv: float) -> Callable[[float, FloatArray], FloatArray]:
        _, true = self.curves(s2, sv)

        def rate(_: float, y: FloatArray) -> FloatArray:
            x1, x2, v = map(float, y)
            friction = true.viscous_damping * v + sv * dry(true, sv * v)
            acceleration = (self.torque(x1, x2, s2) - friction) / self.robot.inertia
            return np.array([v, self.estimate_rate(x1, x2, v, s2), acceleration])

        return rate

    def stick(self, s2: float) -> Callable[[float, FloatArray], FloatArray]:
        return lambda _, y: np.array([0.0, self.estimate_rate(float(y[0]), float(y[1]), 0.0, s2), 0.0])


def piecewise(loop: ClosedLoop, start: tuple[float, float, float], duration: float) -> FloatArray:
    """(x1, x2, x3) at the end, by DOP853 from event to event."""
    e = Equations(loop)
    high, low = e.robot.friction.positive.static_torque, -e.robot.friction.negative.static_torque
    y = np.array([start[0], start[1], start[1] + start[2]])
    s2, sv = float(np.sign(y[1])), float(np.sign(y[2]))
    t = 0.0

    def halt(_: float, y: FloatArray) -> float:
        return float(y[2])

    def reversal(_: float, y: FloatArray) -> float:
        return float(y[1])

    def forward(_: float, y: FloatArray) -> float:
        return e.torque(y[0], y[1], s2) - high

    def backward(_: float, y: FloatArray) -> float:
        return e.torque(y[0], y[1], s2) - low

    for _ in range(MOST_EVENTS):
        events = [halt, reversal] if sv else [reversal, forward, backward]
        directions = [-sv, -s2] if sv else [-s2, 1.0, -1.0]
        for event, direction in zip(events, directions, strict=True):
            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]  # as scipy asks
        field = e.slip(s2, sv) if sv else e.stick(s2)
        out = solve_ivp(field, (t, duration), y, method="DOP853", events=events, rtol=1e-11, atol=1e-12)
        t, y = float(out.t[-1]), out.y[:, -1].copy()
        if out.status == 0:
            return np.array([y[0], y[1], y[2] - y[1]])
        hit = next(event for event, times in zip(events, out.t_events or [], strict=True) if len(times))
        if hit is halt:
            y[2] = 0.0
        if hit is reversal:
            y[1] = 0.0
            s2 = -s2
        if hit in (forward, backward):
            sv = 1.0 if hit is forward else -1.0
            y[2] = sv * NUDGE
        elif y[2] == 0.0:
            torque = e.torque(y[0], y[1], s2)
            sv = 1.0 if torque > high else -1.0 if torque < low else 0.0
            y[2] = sv * NUDGE
    raise AssertionError(f"scipy still meets events at {t} s")


def time_stepping(
    loop: ClosedLoop, start: tuple[float, float, float], duration: float, fineness: float
) -> FloatArray:
    """(x1, x2, x3) at the end, by implicit steps of `fineness`, in shortest time constants of the loop."""
    robot, model, gains = loop.robot, loop.controller.model, loop.controller.gains
    sides = (robot.friction, model.friction)
    laws = np.array([_row(curve) for side in sides for curve in (side.positive, side.negative)])
    state = np.array([start[0], start[1], start[1] + start[2]])
    march(
        laws,
        np.array([robot.inertia, model.inertia]),
        np.array([gains.proportional, gains.derivative, gains.observer, gains.compensation]),
        fineness,
        duration,
        state,
    )
    return np.array([state[0], state[1], state[2] - state[1]])


def _row(curve: StribeckCurve) -> tuple[float, ...]:
    return (
        curve.static_torque,
        curve.coulomb_torque,
        curve.stribeck_velocity,
        curve.viscous_damping,
        curve.stribeck_shape,
    )

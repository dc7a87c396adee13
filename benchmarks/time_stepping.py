"""Inclusion (8) by an implicit time stepper: first order, without events, from the equations in (x1, x2, v).

    J v' = u - b v - F(v),    u = -n1 x1 - n2 x2 + r F^(x2),    x1' = v
    J^ x2' = -n1 x1 - (b^ + n2) x2 + J^ L (v - x2)

A step takes the springs, the dampers, the estimate and the set-valued part of friction at its end (Moreau's
scheme), the fading of friction at its beginning. It shares no code with the solver that it is to check: laws
are rows F_s, F_c, v_s, b, beta of the robot's positive and negative, the model's positive and negative
direction (4, 5), inertias robot and model (2,), gains n1, n2, L, r (4,); states are x1, x2, v.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, ParamSpec, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

SETTLED: Final = 1e-12  # of the way to its goal that an estimate at rest still goes
SETTLING_STEPS: Final = 2000
SETTLING_PACE: Final = 0.05  # of the estimate's time constant, once nothing but rest itself is in question

P = ParamSpec("P")
R = TypeVar("R")
FloatArray = NDArray[np.float64]


def _jitted(function: Callable[P, R]) -> Callable[P, R]:
    return numba.njit(error_model="numpy", nogil=True)(function)


@_jitted
def march_every(
    laws: FloatArray,
    inertia: FloatArray,
    gains: FloatArray,
    fineness: float,
    duration: FloatArray,
    part: int,
    parts: int,
    states: FloatArray,
    moving: NDArray[np.bool_],
) -> None:
    """Loops `part`, `part` + `parts`, ... of n, each for its `duration` (n,) [s], by steps of `fineness`.

    `states` (n, 3) of x1, x2, x3 = v - x2 become their ends; `moving` (n,) says whether the link moves there,
    or is going to.
    """
    for i in range(part, states.shape[0], parts):
        state = states[i]
        state[2] += state[1]
        march(laws[i], inertia[i], gains[i], fineness, duration[i], state)
        moving[i] = leaves_rest(laws[i], inertia[i], gains[i], state.copy())
        state[2] -= state[1]


@_jitted
def march(
    laws: FloatArray,
    inertia: FloatArray,
    gains: FloatArray,
    fineness: float,
    duration: float,
    state: FloatArray,
) -> None:
    """Advance `state` (3,) by `duration` [s] in steps of `fineness`, in shortest time constants."""
    time = 0.0
    while time < duration:
        step = min(fineness / fastest_rate(laws, inertia, gains, state), duration - time)
        before = state[1]
        advance(laws, inertia, gains, step, state)
        time += step
        if state[2] == 0.0 and _has_settled(laws, inertia, gains, step, before, state):
            return


@_jitted
def leaves_rest(laws: FloatArray, inertia: FloatArray, gains: FloatArray, state: FloatArray) -> bool:
    """Whether the link moves, or will move before its estimate has settled; `state` (3,) goes along."""
    step = SETTLING_PACE / estimate_rate(laws, inertia, gains, state)
    for _ in range(SETTLING_STEPS):
        if state[2] != 0.0:
            return True
        before = state[1]
        advance(laws, inertia, gains, step, state)
        if _has_settled(laws, inertia, gains, step, before, state):
            break
    return bool(state[2] != 0.0)


@_jitted
def advance(laws: FloatArray, inertia: FloatArray, gains: FloatArray, step: float, state: FloatArray) -> None:
    """One implicit step of length `step` [s] of `state` (3,), in place."""
    x1, x2, v = state[0], state[1], state[2]
    n1, n2, observer, r = gains[0], gains[1], gains[2], gains[3]
    pushed = x2 + step * (observer * v - n1 / inertia[1] * x1)
    model = laws[2] if pushed > 0.0 else laws[3]
    x2 = pushed / (1.0 + step * (observer + (model[3] + n2) / inertia[1]))
    torque = -n1 * x1 - n2 * x2
    if x2 > 0.0:
        torque += r * dry(model, x2)
    elif x2 < 0.0:
        torque -= r * dry(model, -x2)
    momentum = inertia[0] * v + step * torque
    forward = momentum - step * dry(laws[0], max(v, 0.0))
    backward = momentum + step * dry(laws[1], max(-v, 0.0))
    v = 0.0
    if forward > 0.0:
        v = forward / (inertia[0] + step * (laws[0, 3] + step * n1))
    elif backward < 0.0:
        v = backward / (inertia[0] + step * (laws[1, 3] + step * n1))
    state[0], state[1], state[2] = x1 + step * v, x2, v


@_jitted
def dry(law: FloatArray, speed: float) -> float:
    """Friction without its viscous part [N m] at a speed >= 0 [rad/s]."""
    ratio = speed / law[2]
    if law[4] == 2.0:
        ratio *= ratio
    elif law[4] != 1.0:
        ratio = ratio ** law[4]
    return float(law[1] + (law[0] - law[1]) * np.exp(-ratio))


@_jitted
def fastest_rate(laws: FloatArray, inertia: FloatArray, gains: FloatArray, state: FloatArray) -> float:
    """Sum of the rates [1/s] of what happens at `state` (3,): estimate, spring, damping, fading friction."""
    x2, v = state[1], state[2]
    model = laws[2] if x2 > 0.0 else laws[3]
    rate = estimate_rate(laws, inertia, gains, state) + gains[3] * fading_rate(model, inertia[0], abs(x2))
    if v != 0.0:
        true = laws[0] if v > 0.0 else laws[1]
        rate += np.sqrt(gains[0] / inertia[0]) + true[3] / inertia[0] + fading_rate(true, inertia[0], abs(v))
    return float(rate)


@_jitted
def fading_rate(law: FloatArray, inertia: float, speed: float) -> float:
    """At most about the rate [1/s] at which the falling branch of a law drives an inertia off."""
    ratio = speed / law[2]
    return float((law[0] - law[1]) / (inertia * law[2]) / (1.0 + ratio * (1.0 + 0.5 * ratio)))


@_jitted
def estimate_rate(laws: FloatArray, inertia: FloatArray, gains: FloatArray, state: FloatArray) -> float:
    """Rate [1/s] at which the estimate of a resting link settles."""
    model = laws[2] if state[1] > 0.0 else laws[3]
    return float(gains[2] + (model[3] + gains[1]) / inertia[1])


@_jitted
def _has_settled(
    laws: FloatArray, inertia: FloatArray, gains: FloatArray, step: float, before: float, state: FloatArray
) -> bool:
    rate = estimate_rate(laws, inertia, gains, state)
    goal = gains[0] * abs(state[0]) / (inertia[1] * rate)
    return bool(abs(state[1] - before) <= SETTLED * step * rate * goal)

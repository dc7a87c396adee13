"""The closed loop, inclusion (8): the robot with its true law under a controller with its own.

    J v' = -n1 x1 - n2 x2 + r F^(x2) - b v - F(v),    x1' = v = x2 + x3
    J^ x2' = -n1 x1 - (b^ + n2) x2 + J^ L x3

with hats for what the controller believes. Where the model is the robot, subtracting the two gives the
paper's x3' = -(b/J + L) x3 + (r F(x2) - F(v))/J. The solution is exact but for the tolerance of its
smooth pieces: friction is set-valued, a stick is a stick, and its end is found to rounding
(`loop_modes`).

Laws with beta < 1 fall infinitely steeply from rest. Near x2 = 0 an error e of the estimate is then one of
e^beta in the compensation, and that is how accurate a solution is; and the estimate is drawn onto a path on
which it comes to zero without crossing it (x2 = -(c/k)^(1/beta) for a torque c that passes zero), so close
that rounding would decide. It is taken to touch zero there and to keep its sign, an event of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from compensation.controller import Controller
from compensation.loop_runs import EVENT_NAMES, SURFACES, follow, run_for
from compensation.loop_tables import mode_parameters
from ident.model.doors import expect
from ident.model.friction import ModelError
from ident.model.numbers import LARGEST, is_number, is_quantity, real_array, shown
from ident.model.robot import OneLinkRobot
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray
from ident.simulation.integrate import END_REASONS, EVENTS_FULL, Progress
from ident.simulation.trajectory import Marks, Trajectory

GRID_RATE = 200.0  # [1/s] of the times chosen where none are asked for
GRID_LIMIT = 20_000
EVENT_STORE = 256  # of one call; a run with more goes on in another
STEP_LIMIT = 1_000_000


@dataclass(frozen=True)
class ClosedLoop:
    """A robot and its controller: true friction and compensated friction are two values."""

    robot: OneLinkRobot
    controller: Controller

    def __post_init__(self) -> None:
        expect("robot", self.robot, OneLinkRobot, "eq 1")
        expect("controller", self.controller, Controller, "eqs 5-6")

    @cached_property
    def modes(self) -> FloatArray:
        """The numbers of all modes (6, 16) of `loop_parameters`, not to be written to."""
        return mode_parameters(self.robot, self.controller)


def simulate(
    loop: ClosedLoop,
    start: ArrayLike,
    *,
    duration: float,
    times: ArrayLike | None = None,
    tolerance: float = 1e-10,
) -> Trajectory:
    """Solve inclusion (8) from `start` (3,) = (x1 [rad], x2 [rad/s], x3 [rad/s]) for `duration` [s].

    States are given at `times` (k,) [s], ascending within [0, duration]; without them on a grid that includes
    every event and both ends. `tolerance` bounds the error of a step relative to the largest state.

    Raises
    ------
    ModelError
        If a start, time or tolerance is no number, or times run backwards or out of the duration.
    """
    expect("loop", loop, ClosedLoop, "eq 8")
    state = _checked_start(start)
    duration, tolerance = checked_accuracy(duration, tolerance)
    if times is None:
        _, marks = _run(loop, state.copy(), np.empty(0), np.empty((0, 3)), duration, tolerance)
        points = min(GRID_LIMIT, max(2, math.ceil(duration * GRID_RATE)))
        wanted = np.union1d(np.linspace(0.0, duration, points + 1), marks.times)
    else:
        wanted = checked_times(times, duration)
    states = np.empty((wanted.size, 3))
    end, marks = _run(loop, state, wanted, states, duration, tolerance)
    if end.outputs < wanted.size:
        states[end.outputs :] = np.nan
    return Trajectory(
        time=wanted,
        state=states,
        marks=marks,
        end_reason=END_REASONS[end.reason],
        end_time=end.time,
        end_state=state,
    )


def torque(loop: ClosedLoop, states: ArrayLike) -> FloatArray:
    """Torque u = -n1 x1 - n2 x2 + r F^(x2) [N m] that the controller gives at states (k, 3). Eqs (5)-(6).

    At x2 = 0 the compensation is set-valued; its middle, 0 for a symmetric law, is given. Raises `ModelError`
    for states that are not finite, as after a run that broke off.
    """
    expect("loop", loop, ClosedLoop, "eq 8")
    found = real_array(states)
    x = None if found is None else np.atleast_2d(found)
    if x is None or x.ndim != 2 or x.shape[1] != 3 or not np.isfinite(x).all():
        raise ModelError(f"states are {shown(states)}: finite numbers of shape (k, 3) (eqs 5-6)")
    gains = loop.controller.gains
    low, high = loop.controller.model.friction.torque_interval(x[:, 1])
    feedback: FloatArray = -gains.proportional * x[:, 0] - gains.derivative * x[:, 1]
    return feedback + gains.compensation * 0.5 * (low + high)


def _run(
    loop: ClosedLoop,
    state: FloatArray,
    times: FloatArray,
    states: FloatArray,
    duration: float,
    tolerance: float,
) -> tuple[Progress, Marks]:
    """Advance `state` to the end, in place; `states` at `times` on the way."""
    run = run_for(loop.modes)
    mode = np.empty((2, SURFACES), np.int64)
    parts: list[Marks] = []
    time, steps = 0.0, STEP_LIMIT
    while True:
        at, kinds, where = np.empty(EVENT_STORE), np.empty(EVENT_STORE, np.int64), np.empty((EVENT_STORE, 3))
        end: Progress = follow(
            run, loop.modes, tolerance, duration, steps, time, state, mode, times, states, at, kinds, where
        )
        parts.append(Marks(at[: end.events], kinds[: end.events], where[: end.events], EVENT_NAMES))
        time, steps = end.time, steps - end.steps
        if end.reason != EVENTS_FULL:
            return end, _joined(parts)


def _joined(parts: Sequence[Marks]) -> Marks:
    if len(parts) == 1:
        return parts[0]
    return Marks(
        np.concatenate([part.times for part in parts]),
        np.concatenate([part.kinds for part in parts]),
        np.concatenate([part.states for part in parts]),
        EVENT_NAMES,
    )


def _checked_start(start: ArrayLike) -> FloatArray:
    state = real_array(start)
    if state is None or state.shape != (3,) or not all(map(is_quantity, state.tolist())):
        raise ModelError(
            f"start is {shown(start)}: three finite numbers x1 [rad], x2 [rad/s], x3 [rad/s], "
            f"up to {LARGEST:g} (eq 8)"
        )
    return state


def checked_accuracy(duration: float, tolerance: float) -> tuple[float, float]:
    """The duration [s] and the tolerance [-] of a run, as floats; `ModelError` unless they are possible ones.

    Of a number of any other type numba would compile the kernels once more.
    """
    if not (is_number(duration) and duration > 0):
        raise ModelError(f"duration is {duration!r}: a finite number of seconds > 0 (eq 8)")
    if not (is_number(tolerance) and 0 < tolerance < 1):
        raise ModelError(f"tolerance is {tolerance!r}: between 0 and 1, relative to the largest state (eq 8)")
    return float(duration), float(tolerance)


def checked_times(times: ArrayLike, duration: float) -> FloatArray:
    """Times (k,) [s] that ascend within a duration [s]; ModelError otherwise."""
    wanted = real_array(times)
    if wanted is None or wanted.ndim != 1:
        raise ModelError(f"times are {shown(times)}: a list of finite numbers [s] (eq 8)")
    failed = _first_out_of_order(wanted, float(duration))
    if failed >= 0:
        raise ModelError(
            f"times[{failed}] is {wanted[failed]:g} s: times must ascend within 0 and the duration, "
            f"{duration:g} s (eq 8)"
        )
    return wanted


@compiled
def _first_out_of_order(times: FloatArray, duration: float) -> int:
    """Index of the first time that is before the last one, beyond the duration or nan; -1: none."""
    before = 0.0
    for k in range(times.size):
        if not before <= times[k] <= duration:
            return k
        before = times[k]
    return -1

"""The return map of the closed loop on the section v = 0, and its derivative, as kernels.

A point of the section is z = (x1, x2), with x3 = -x2: an instant at which the link comes to a halt. A
*half turn* ends when it halts the next time, from whichever direction; a *turn* when it halts from v >
0, where x1 is largest. Where robot and controller are symmetric, a half turn followed by a change of
sign is a map of which the turn is the square.

The derivative comes from deviations carried along the modes and across their surfaces
(`orbits.saltation`). The estimate x2 passes through zero almost tangentially, with a jump of x3': the
matrices are well defined, but differences of neighbouring trajectories lose many digits there.
"""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types

from compensation.loop_modes import MOTION, SURFACE_ROWS, SYSTEM
from compensation.loop_parameters import fastest_decay, own_time
from compensation.loop_runs import begin, is_analytic, run_at, run_for
from compensation.loop_tangents import DEVIATIONS, ROW1, ROW2, ROW3, STATES, TANGENTS, stick_deviations
from compensation.orbits.saltation import carry, project_along, saltate
from ident.simulation.compiled import address_of, calls, compiled, owning
from ident.simulation.dormand_prince import DORMAND_PRINCE
from ident.simulation.filippov_system import FloatArray, Signs, assign
from ident.simulation.integrate import SECTION, WORK_ROWS
from ident.simulation.integrate import STEP_LIMIT as STEPS_SPENT
from ident.simulation.taylor import ORDER, TAYLOR

EVENT_STORE: Final = 256  # of a half turn: chattering beyond that is reported as no return
STEP_LIMIT: Final = 5_000  # of a turn, which takes a few hundred
STEPS_PER_DECAY: Final = 0.15  # where the observer is fast: a step spans some nine decay times of its error
LONG_TURN: Final = 40.0  # times of the loop's own, that a turn may take at so small steps
MOST_STEPS: Final = 500_000  # beyond: a turn at L = 1e6 of the paper's robot takes half of them
MOST_HALTS: Final = 1000  # in a turn: a link that halts more often is chattering, not turning

CARRY: Final = types.void(
    float64[:, ::1], int64[::1], float64[::1], float64, float64, float64[:, ::1], float64[:, ::1]
)
carry_at: Final = calls(CARRY)  # carry_at(address, arguments of `carry_by_series`)
RETURNS: Final = types.UniTuple(int64, 2)(  # type: ignore[no-untyped-call]  # numba
    int64, float64[:, ::1], boolean, float64, float64, float64[::1], float64[:, ::1]
)
returns_at: Final = calls(RETURNS)  # returns_at(address, arguments of `returns`)
DERIVATIVE: Final = types.Tuple((float64, int64))(  # type: ignore[no-untyped-call]  # numba
    int64, int64, float64[:, ::1], float64, float64, float64, float64[::1], float64[:, ::1]
)
derivative_at: Final = calls(DERIVATIVE)  # derivative_at(address, arguments of `derivative`)


class MapKernels(NamedTuple):
    """Addresses of what follows a loop's return map: searches for cycles need not be compiled with it."""

    run: int
    carried: int
    returns: int
    derivative: int


@compiled
def carry_by_series(
    parameters: FloatArray,
    signs: Signs,
    state: FloatArray,
    duration: float,
    tolerance: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> None:
    """`orbits.saltation.carry` of the nine states of `loop_tangents` by Taylor series."""
    carry(TAYLOR, TANGENTS, parameters, signs, state, duration, tolerance, polynomials, work)


@compiled
def carry_by_dormand_prince(
    parameters: FloatArray,
    signs: Signs,
    state: FloatArray,
    duration: float,
    tolerance: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> None:
    """As `carry_by_series`, for any shape of the laws."""
    carry(DORMAND_PRINCE, TANGENTS, parameters, signs, state, duration, tolerance, polynomials, work)


def carry_for(parameters: FloatArray) -> int:
    """Address of the kernel that carries deviations of a loop with these parameters (6, 16)."""
    return _carry_address(is_analytic(parameters))


@cache
def _carry_address(analytic: bool) -> int:
    return address_of(carry_by_series if analytic else carry_by_dormand_prince, CARRY)


def map_kernels(parameters: FloatArray) -> MapKernels:
    """The kernels for a loop with these parameters (6, 16)."""
    return MapKernels(run_for(parameters), carry_for(parameters), *_map_addresses())


@cache
def _map_addresses() -> tuple[int, int]:
    return address_of(returns, RETURNS), address_of(derivative, DERIVATIVE)


@compiled
def steps_allowed(parameters: FloatArray) -> int:
    """Steps of a turn: more where the observer is fast."""
    needed = STEPS_PER_DECAY * LONG_TURN * own_time(parameters) * fastest_decay(parameters)
    return STEP_LIMIT + int(min(needed, float(MOST_STEPS)))


@owning
def returns(
    run: int,
    parameters: FloatArray,
    symmetric: bool,
    tolerance: float,
    patience: float,
    start: FloatArray,
    points: FloatArray,
) -> tuple[int, int]:
    """Follow the return map from `start` (3,) for as many returns as `points` has rows: (returns, reason).

    A row (5,): x1, x2 of the return, its duration [s], lowest and highest x1 on the way. In the symmetric map
    every row stands in the frame of its own half turn: the way is followed by a change of sign. `patience` is
    for one half turn, in times of the loop's own (`own_time`), `run` the address of a kernel of `loop_runs`.
    """
    longest = patience * own_time(parameters)
    limit = steps_allowed(parameters)
    state = np.empty(STATES)
    assign(state, start)
    signs, contact = np.empty(2, np.int64), np.empty(2, np.int64)
    times, states = np.empty(0), np.empty((0, STATES))
    which, modes = np.empty(0, np.int64), np.empty((0, 2), np.int64)
    begin(parameters, state, signs, contact)
    for row in range(points.shape[0]):
        duration = 0.0
        low = high = state[0]
        returned = False
        left = limit
        for _ in range(MOST_HALTS):
            before = state[0]
            end = run_at(
                run,
                (
                    parameters, tolerance, longest, left, MOTION, 0, 1, 0.0, state, signs, contact,
                    times, states, times, which, modes, states,
                ),
            )  # fmt: skip
            duration += end.time
            left -= end.steps
            low, high = min(low, state[0]), max(high, state[0])
            if end.reason != SECTION:
                return row, end.reason
            if symmetric or state[0] > before:
                returned = True
                break
        if not returned:
            return row, STEPS_SPENT
        if symmetric:
            for i in range(STATES):
                state[i] = -state[i]
            begin(parameters, state, signs, contact)
        points[row, 0], points[row, 1] = state[0], state[1]
        points[row, 2], points[row, 3], points[row, 4] = duration, low, high
    return points.shape[0], SECTION


@owning
def derivative(
    run: int,
    carried: int,
    parameters: FloatArray,
    tolerance: float,
    tangent_tolerance: float,
    patience: float,
    state: FloatArray,
    out: FloatArray,
) -> tuple[float, int]:
    """Derivative (3, 2) of the half turn from the halt `state` (3,), which moves to the next halt.

    Its rows are those of x1, x2 and the duration [s], by x1 and x2. Returns the duration and why it ended.
    `tangent_tolerance` is that of the deviations' steps, `patience` as for `returns`; `run` and `carried` are
    the addresses of the kernels that integrate and that carry deviations.
    """
    longest = patience * own_time(parameters)
    limit = steps_allowed(parameters)
    signs, contact = np.empty(2, np.int64), np.empty(2, np.int64)
    begin(parameters, state, signs, contact)
    y = np.zeros(STATES * (1 + DEVIATIONS))
    assign(y, state)
    y[ROW1], y[ROW2 + 1], y[ROW3 + 1] = (
        1.0,
        1.0,
        -1.0,
    )  # deviations within the section: by x1, and by x2 = -x3
    mode = np.empty(2, np.int64)
    assign(mode, signs)
    times, which = np.empty(EVENT_STORE), np.empty(EVENT_STORE, np.int64)
    modes, states = np.empty((EVENT_STORE, 2), np.int64), np.empty((EVENT_STORE, STATES))
    end = run_at(
        run,
        (
            parameters, tolerance, longest, limit, MOTION, 0, 1, 0.0, state, signs, contact,
            np.empty(0), np.empty((0, STATES)), times, which, modes, states,
        ),
    )  # fmt: skip
    if end.reason != SECTION:
        return end.time, end.reason
    polynomials = np.empty((y.size, ORDER + 1))
    work = np.empty((WORK_ROWS, ORDER + 1))
    deviations = y[STATES:].reshape(STATES, DEVIATIONS)
    before, after = np.empty(STATES), np.empty(STATES)
    now = 0.0
    for event in range(end.events):
        span = times[event] - now
        if mode[MOTION] == 0:
            stick_deviations(deviations, mode[0], parameters, span)
        else:
            carry_at(carried, (parameters, mode, y, span, tangent_tolerance, polynomials, work))
        assign(y, states[event])
        normal = SURFACE_ROWS[which[event], :STATES]
        _rate(parameters, mode, states[event], before)
        if event == end.events - 1:
            project_along(deviations, before, normal, out[2])
        elif mode[MOTION] != 0 or which[event] != MOTION:
            _rate(parameters, modes[event], states[event], after)
            saltate(deviations, before, after, normal)
        assign(mode, modes[event])
        now = times[event]
    for i in range(DEVIATIONS):
        out[0, i], out[1, i] = deviations[0, i], deviations[1, i]
    return end.time, SECTION


@compiled
def newton_change(slope: FloatArray, missing1: float, missing2: float) -> tuple[float, float]:
    """Newton's change of a point (2,) that its return misses, towards the fixed point: (1 - slope) change."""
    a, b, c, d = 1.0 - slope[0, 0], -slope[0, 1], -slope[1, 0], 1.0 - slope[1, 1]
    determinant = a * d - b * c
    return (d * missing1 - b * missing2) / determinant, (a * missing2 - c * missing1) / determinant


@owning
def _rate(parameters: FloatArray, mode: Signs, state: FloatArray, out: FloatArray) -> None:
    """dx/dt (3,) in a slip mode or, the velocity held at zero, in a stick."""
    if mode[MOTION] != 0:
        SYSTEM.field(mode, state, parameters, out)
        return
    slipping = np.empty(2, np.int64)
    slipping[0] = mode[0]
    slipping[MOTION] = slipping[0] if slipping[0] != 0 else 1
    SYSTEM.field(slipping, state, parameters, out)
    out[0] = 0.0
    out[2] = -out[1]

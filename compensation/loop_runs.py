"""The event loop compiled for the closed loop: one kernel for each one-step method, both kept on disk.

Taylor series serve Stribeck shapes of 1 and 2, Dormand and Prince's method all others (`is_analytic`). Both
kernels have one signature: others call the one that they are given by its address, and need not be compiled
for each.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numba import float64, int64, types

from compensation.bell_series import BELL
from compensation.loop_modes import MOTION, REVERSAL, SYSTEM, surfaces
from compensation.loop_parameters import SHAPE2, SHAPEV, SLIP_MODES
from ident.simulation.compiled import address_of, calls, compiled, owning
from ident.simulation.dormand_prince import DORMAND_PRINCE
from ident.simulation.filippov_system import FloatArray, Signs, resolve, switching_value
from ident.simulation.integrate import Progress, Record, Settings, integrate, memory_shape
from ident.simulation.taylor import TAYLOR

TOUCH: Final = "estimate touch"  # x2 comes to zero but for the tolerance, and keeps its sign
SURFACES: Final = 2
PROGRESS: Final = types.NamedTuple((float64, *4 * (int64,)), Progress)  # type: ignore[no-untyped-call]  # numba
RUN: Final = PROGRESS(
    float64[:, ::1], float64, float64, int64, int64, int64, int64, float64, float64[::1], int64[::1],
    int64[::1], float64[::1], float64[:, ::1], float64[::1], int64[::1], int64[:, ::1], float64[:, ::1],
)  # fmt: skip
run_at: Final = calls(RUN)  # run_at(address, arguments of `run_series`)
EVENT_NAMES: Final = ("stick", "slip", "velocity reversal", "estimate reversal", TOUCH)


@compiled
def is_analytic(parameters: FloatArray) -> bool:
    """Whether every slip mode has a Taylor recurrence: all Stribeck shapes are 1 or 2."""
    return _only_shapes(parameters, 1.0, BELL)


@compiled
def is_exponential(parameters: FloatArray) -> bool:
    """Whether all Stribeck shapes are 1."""
    return _only_shapes(parameters, 1.0, 1.0)


@compiled
def smallest_shape(parameters: FloatArray) -> float:
    """The smallest Stribeck shape of all slip modes: below 1, friction falls infinitely steeply from rest."""
    least = np.inf
    for mode in range(SLIP_MODES):
        least = min(least, parameters[mode, SHAPE2], parameters[mode, SHAPEV])
    return least


@compiled
def _only_shapes(parameters: FloatArray, one: float, other: float) -> bool:
    others = 0
    for mode in range(SLIP_MODES):
        for column in (SHAPE2, SHAPEV):
            if parameters[mode, column] not in (one, other):
                others += 1
    return others == 0


def run_for(parameters: FloatArray) -> int:
    """Address of the kernel that integrates a loop with these parameters (6, 16)."""
    return _address(is_analytic(parameters))


@cache
def _address(analytic: bool) -> int:
    return address_of(run_series if analytic else run_dormand_prince, RUN)


@owning
def begin(parameters: FloatArray, state: FloatArray, signs: Signs, contact: Signs) -> None:
    """The mode in which a state starts, into `signs` and `contact` (2,).

    The origin is an equilibrium for any gains: its friction torques may take any value up to break-away, zero
    included. (For r > 1 it is not the only solution from there; it is the one without a push.)
    """
    for i in range(contact.size):
        contact[i] = 0
    if state[0] == 0.0 and state[1] == 0.0 and state[2] == 0.0:
        for i in range(signs.size):
            signs[i] = 0
        return
    on = surfaces()
    rate = np.empty(2 * state.size)
    for i in range(signs.size):
        signs[i] = 1 if switching_value(on, i, state) >= 0.0 else -1
    for i in range(signs.size):
        if switching_value(on, i, state) == 0.0:
            contact[i] = 1
            signs[i] = resolve(SYSTEM, on, i, signs, state, parameters, rate)


@compiled
def name_events(surfaces_met: Signs, modes: Signs, first: Signs) -> None:
    """Turn the surfaces (e,) that were met into indices of EVENT_NAMES, in place.

    `modes` (e or more, 2) are those after the events, `first` (2,) that before the first.
    """
    moving, estimate = first[MOTION], first[REVERSAL]
    for i in range(surfaces_met.size):
        after = modes[i, MOTION]
        if surfaces_met[i] == MOTION or after != moving:
            surfaces_met[i] = 0 if after == 0 else 1 if moving == 0 else 2
        else:
            surfaces_met[i] = 4 if modes[i, REVERSAL] == estimate else 3
        moving, estimate = after, modes[i, REVERSAL]


@owning
def follow(
    run: int,
    parameters: FloatArray,
    tolerance: float,
    end: float,
    step_limit: int,
    time: float,
    state: FloatArray,
    mode: Signs,
    times: FloatArray,
    states: FloatArray,
    event_times: FloatArray,
    event_kinds: Signs,
    event_states: FloatArray,
) -> Progress:
    """Begin at time 0, or go on, with the kernel at the address `run`; events are named on the way.

    `mode` (2, 2) keeps signs and contacts between calls, `event_kinds` (e,) are indices of EVENT_NAMES; the
    other arguments are those of `run_series`.
    """
    signs, contact = mode[0], mode[1]
    if time == 0.0:
        begin(parameters, state, signs, contact)
    first = signs.copy()
    event_signs = np.empty((event_times.size, SURFACES), np.int64)
    now: Progress = run_at(
        run,
        (
            parameters, tolerance, end, step_limit, -1, 0, 0, time, state, signs, contact,
            times, states, event_times, event_kinds, event_signs, event_states,
        ),
    )  # fmt: skip
    name_events(event_kinds[: now.events], event_signs, first)
    return now


@owning
def run_series(
    parameters: FloatArray,
    tolerance: float,
    end: float,
    step_limit: int,
    section: int,
    section_side: int,
    returns: int,
    time: float,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    times: FloatArray,
    states: FloatArray,
    event_times: FloatArray,
    event_surfaces: Signs,
    event_signs: Signs,
    event_states: FloatArray,
) -> Progress:
    """`integrate` by Taylor series; the arguments are its `Settings` and its `Record`, one by one."""
    settings = Settings(tolerance, end, step_limit, section, section_side, returns)
    record = Record(times, states, event_times, event_surfaces, event_signs, event_states)
    memory = np.empty(memory_shape(state.size, signs.size))
    return integrate(
        TAYLOR, SYSTEM, surfaces(), parameters, settings, time, state, signs, contact, record, memory
    )


@owning
def run_dormand_prince(
    parameters: FloatArray,
    tolerance: float,
    end: float,
    step_limit: int,
    section: int,
    section_side: int,
    returns: int,
    time: float,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    times: FloatArray,
    states: FloatArray,
    event_times: FloatArray,
    event_surfaces: Signs,
    event_signs: Signs,
    event_states: FloatArray,
) -> Progress:
    """`integrate` by Dormand and Prince's method; arguments as for `run_series`."""
    settings = Settings(tolerance, end, step_limit, section, section_side, returns)
    record = Record(times, states, event_times, event_surfaces, event_signs, event_states)
    memory = np.empty(memory_shape(state.size, signs.size))
    return integrate(
        DORMAND_PRINCE, SYSTEM, surfaces(), parameters, settings, time, state, signs, contact, record, memory
    )

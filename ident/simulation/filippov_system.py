"""A Filippov system: smooth vector fields on the cells that switching surfaces cut out of the state space.

The surfaces are h_i(y) = A_i y + a_i = 0, i = 1..m (a curved surface becomes one of these when h is
made a state). A mode is the tuple of the signs of the h_i: sign +1 or -1 on either side, 0 while the
state slides on the surface. Inside a mode the vector field is smooth and may be continued across the
surfaces.

Where the state meets surface i, the normal components a+ = A_i f(sign +1) and a- = A_i f(sign -1)
decide, by Filippov's convex rule: it leaves to the + side where a+ > 0, to the - side where a- < 0, and
slides where both fields point at the surface. Where both point away the solution is not unique; it then
goes on in its direction.

How a slide moves and how long it lasts is told by the system, in closed form: the event loop need not know
the sliding field, and a state that slides for ever is an equilibrium known exactly.

`contact[i]` counts the leading time derivatives of h_i, from the zeroth on, that are known to vanish at
the present instant: 0 inside a cell, 1 just after surface i was reached, 2 where a slide ends
tangentially. Without it, rounding would find the surface again and again at the same instant.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ident.simulation.compiled import compiled, specialised

FloatArray = NDArray[np.float64]
Signs = NDArray[np.int64]


class FilippovSystem(NamedTuple):
    """The compiled functions that are a system. All take (signs (m,), state (n,), parameters, ...).

    A system without a Taylor recurrence gives `no_series`, one without slides `no_slide` and `no_slide_at`.
    """

    field: Callable[[Signs, FloatArray, FloatArray, FloatArray], None]
    """field(signs, state, parameters, out): writes dy/dt (n,); no sign is 0."""
    series: Callable[[Signs, FloatArray, FloatArray, int, FloatArray, FloatArray], float]
    """series(signs, state, parameters, order, coefficients, work): Taylor coefficients into rows 0..n-1.

    Returns the time for which they tell the whole truth, inf if the coefficients themselves show it: a term
    that is too small to be seen now but grows within the step must be reached in shorter ones.
    """
    slide: Callable[[Signs, FloatArray, FloatArray], tuple[float, int, int, int]]
    """slide(signs, state, parameters) -> how long, then which surface gets which sign at which contact."""
    slide_at: Callable[[Signs, FloatArray, FloatArray, float, FloatArray], None]
    """slide_at(signs, state, parameters, time, out): the sliding state `time` after `state`."""


class OneStepMethod(NamedTuple):
    """How a mode is integrated: one step, and its end at an event."""

    step: Callable[
        [FilippovSystem, Signs, FloatArray, FloatArray, float, float, float, FloatArray, FloatArray],
        tuple[float, int, float],
    ]
    """step(system, signs, state, parameters, tolerance, longest, suggested, polynomials, work)."""
    end_at: Callable[..., tuple[float, float]]
    """end_at(system, surfaces, surface, signs, state, parameters, length, part, polynomials, work)
    -> length and the part of it at which the event is. Where the step did not tell the truth there: a length,
    negative, of the step to be taken instead."""


class Surfaces(NamedTuple):
    """Switching surfaces h_i(y) = rows[i, :n] y + rows[i, n]."""

    rows: FloatArray  # (m, n + 1)
    pivots: Signs  # (m,) the state that is solved for when a state is put onto the surface


@compiled
def assign(out: NDArray[Any], values: NDArray[Any]) -> None:
    """out[:] = values, without the code for broadcasting that numba would compile into every kernel."""
    for i in range(values.size):
        out[i] = values[i]


@compiled
def largest(values: FloatArray) -> float:
    """The largest magnitude among values (n,)."""
    size = 0.0
    for i in range(values.size):
        size = max(size, abs(values[i]))
    return size


@specialised
def switching_value(surfaces: Surfaces, index: int, state: FloatArray) -> float:
    """h_index at a state."""
    n = state.size
    value: float = surfaces.rows[index, n]
    for j in range(n):
        if surfaces.rows[index, j] != 0.0:
            value += surfaces.rows[index, j] * state[j]
    return value


@specialised
def project(surfaces: Surfaces, index: int, state: FloatArray) -> None:
    """Put the state onto the surface exactly, by its pivot."""
    pivot = surfaces.pivots[index]
    state[pivot] = 0.0
    value = switching_value(surfaces, index, state)
    if value != 0.0:
        state[pivot] = -value / surfaces.rows[index, pivot]


@specialised
def leaving_rate(
    system: FilippovSystem,
    surfaces: Surfaces,
    index: int,
    side: int,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    rate: FloatArray,
) -> float:
    """dh_index/dt on one side of the surface; `rate` is memory (>= n,)."""
    before = signs[index]
    signs[index] = side
    system.field(signs, state, parameters, rate)
    signs[index] = before
    value = 0.0
    for j in range(state.size):
        if surfaces.rows[index, j] != 0.0:
            value += surfaces.rows[index, j] * rate[j]
    return value


@specialised
def resolve(
    system: FilippovSystem,
    surfaces: Surfaces,
    index: int,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    rate: FloatArray,
) -> int:
    """Side to which a state on surface `index` goes, 0 if it slides: Filippov's rule. No other sign is 0.

    Where both rates vanish the next derivative decides, by a short step along the field. `rate` is memory
    (2 n,).
    """
    plus = leaving_rate(system, surfaces, index, 1, signs, state, parameters, rate)
    minus = leaving_rate(system, surfaces, index, -1, signs, state, parameters, rate)
    if plus > 0.0 and minus < 0.0:
        return -1 if signs[index] > 0 else 1
    if plus > 0.0:
        return 1
    if minus < 0.0:
        return -1
    if plus == 0.0 and minus == 0.0:
        own = -1 if signs[index] < 0 else 1
        for side in (own, -own):
            leaving_rate(system, surfaces, index, side, signs, state, parameters, rate)
            for j in range(state.size):
                rate[state.size + j] = state[j] + TANGENT_STEP * rate[j]
            ahead = rate[state.size : 2 * state.size]
            if side * leaving_rate(system, surfaces, index, side, signs, ahead, parameters, rate) > 0.0:
                return side
    return 0


TANGENT_STEP = 1e-8  # [s]


@specialised
def no_series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    """Stands in a system that has no Taylor recurrence."""
    return np.inf


@specialised
def no_slide(signs: Signs, state: FloatArray, parameters: FloatArray) -> tuple[float, int, int, int]:
    """Stands in a system whose surfaces are always crossed: a state held there stays for ever."""
    return np.inf, 0, 0, 0


@specialised
def no_slide_at(
    signs: Signs, state: FloatArray, parameters: FloatArray, time: float, out: FloatArray
) -> None:
    """Goes with `no_slide`."""
    assign(out, state)

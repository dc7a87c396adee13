"""Surfaces that are touched but not crossed: what is too shallow for the tolerance to tell.

Which side a motion goes on to that turns back within the error of a step is beyond the tolerance, and it is
kept on its own, whatever the tolerance. That matters where the field is not Lipschitz: a term that grows as
the root of the distance draws the motion onto a path that touches the surface, passed at a distance far below
rounding. A motion that comes again before it has left by as much is driven across, and crosses.
"""

from __future__ import annotations

from ident.simulation.compiled import compiled, specialised
from ident.simulation.filippov_system import (
    TANGENT_STEP,
    FilippovSystem,
    FloatArray,
    Signs,
    Surfaces,
    largest,
    leaving_rate,
    project,
    switching_value,
)


@specialised
def turn_back(
    system: FilippovSystem,
    surfaces: Surfaces,
    parameters: FloatArray,
    surface: int,
    side: int,
    tolerance: float,
    longest: float,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    rate: FloatArray,
) -> float:
    """Undo a crossing from `side` that is shallower than the error of a step, and go to where it turns back.

    Returns how long that takes, `longest` at most; 0 where the crossing stands. `rate` is memory (2 n,), and
    begins with the rate of the state on the way.
    """
    n = state.size
    nearing = side * leaving_rate(system, surfaces, surface, side, signs, state, parameters, rate)
    for j in range(n):
        rate[n + j] = state[j] + TANGENT_STEP * rate[j]
    ahead = rate[n : 2 * n]
    later = side * leaving_rate(system, surfaces, surface, side, signs, ahead, parameters, rate)
    turning = (later - nearing) / TANGENT_STEP
    if nearing >= 0.0 or turning <= 0.0 or 0.5 * nearing * nearing > _error(tolerance, state) * turning:
        return 0.0
    span = min(-nearing / turning, longest)
    for j in range(n):
        state[j] += span * (ahead[j] - state[j]) / TANGENT_STEP
    project(surfaces, surface, state)
    signs[surface], contact[surface] = side, 2
    return span


@compiled
def drive_across(surface: int, signs: Signs, contact: Signs) -> None:
    """Cross a surface that a motion comes to again, whatever its rate there: it is that of its errors."""
    signs[surface], contact[surface] = -signs[surface], 2


@compiled
def back_along(state: FloatArray, rate: FloatArray, time: float, out: FloatArray) -> None:
    """The state (n,) a short `time` [s] ago, at a rate (n or more,)."""
    for j in range(state.size):
        out[j] = state[j] - time * rate[j]


@specialised
def has_left(surfaces: Surfaces, surface: int, tolerance: float, state: FloatArray) -> bool:
    """Whether a state is farther from a surface than a step may err."""
    return bool(abs(switching_value(surfaces, surface, state)) > _error(tolerance, state))


@compiled
def _error(tolerance: float, state: FloatArray) -> float:
    """What a step may err by: the tolerance is relative to the largest component of the state."""
    return tolerance * largest(state)

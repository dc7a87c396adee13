"""Where the pieces of the equilibrium set change over a gain, for a Stribeck shape of 1: kernels.

What rests there are at a gain is told by `lambert_roots`. A change is bracketed by bisection to neighbouring
numbers.
"""

from __future__ import annotations

from compensation.lambert_roots import resting_range
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray


@compiled
def change_of_rests(
    laws: FloatArray, inertia: float, over_r: bool, other: float, low: float, high: float
) -> float:
    """A value of r [-], else of L [1/s], in (low, high] from which on the pieces are not those of `low`.

    `laws` (2, 5): F_s, F_s^, dF^, v_s^, b^ of the positive and negative direction; `inertia` is J^ [kg m^2]
    and `other` the other gain. At `high` the pieces must differ from those of `low`.
    """
    before = _pieces(laws, inertia, over_r, other, low)
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if _pieces(laws, inertia, over_r, other, middle) == before:
            low = middle
        else:
            high = middle


@compiled
def _pieces(laws: FloatArray, inertia: float, over_r: bool, other: float, value: float) -> int:
    """A number for the pieces that there are: the set point stable, unstable or in a set; rests beside it."""
    r, observer = (value, other) if over_r else (other, value)
    pushed, around, beside = 0, 0, 0
    for direction in range(2):
        held, static, stribeck, width, damping = laws[direction]
        onset = r * static - held
        inner, outer = resting_range(damping + observer * inertia, onset, r * stribeck, width)
        if onset > 0.0:
            pushed = 1
        if inner > 0.0:
            beside += 1 + direction
        elif outer > 0.0:
            around = 1
    return 3 * beside + (2 if around == 1 else pushed)

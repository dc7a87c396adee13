"""The pieces of the equilibrium set at every value of a gain: what a diagram draws of the rests.

What touches the set point is one piece, the rest of each direction is one by one; where nothing touches it,
the set point stands alone. For a Stribeck shape of 1 the edges over all values come from one kernel
(`lambert_roots`), otherwise value by value (`equilibria`).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from compensation.closed_loop import ClosedLoop
from compensation.equilibria import DIRECTIONS, Direction, equilibrium_set
from compensation.lambert_roots import resting_ranges
from compensation.loop_section import with_gain
from compensation.loop_tables import Parameter
from compensation.rest_changes import change_of_rests
from ident.model.friction import StribeckCurve
from ident.simulation.filippov_system import FloatArray

SET_POINT: Final = "set point"
AROUND: Final = "around the set point"

PieceName = tuple[str, bool]
"""A piece and whether it is stable."""

Pieces = dict[PieceName, FloatArray]
"""Ranges (n, 2) of x1 [rad] by piece, nan where there is none."""


def rest_pieces(loop: ClosedLoop, parameter: Parameter, values: FloatArray) -> Pieces:
    """The pieces that there are at some of the `values` (n,) of r [-] or L [1/s].

    The set point alone is unstable where the compensation exceeds the static friction in a direction.
    """
    r = values if parameter == "r" else np.full(values.size, loop.controller.gains.compensation)
    observer = values if parameter == "L" else np.full(values.size, loop.controller.gains.observer)
    pushed = (_onset(loop, r, "positive") > 0.0) | (_onset(loop, r, "negative") > 0.0)
    around = np.zeros((values.size, 2))
    rests = _closed_form(loop, r, observer, around)
    if rests is None:
        rests = _one_by_one(loop, parameter, values, around)
    alone = around[:, 0] == around[:, 1]
    pieces = {
        (AROUND, True): _only(around, ~alone),
        (SET_POINT, True): _only(np.zeros(2), alone & ~pushed),
        (SET_POINT, False): _only(np.zeros(2), alone & pushed),
        **{(name, True): ranges for name, ranges in rests.items()},
    }
    return {name: ranges for name, ranges in pieces.items() if not np.all(np.isnan(ranges[:, 0]))}


def present(pieces: Pieces, index: int) -> frozenset[PieceName]:
    """The pieces at one of the values."""
    return frozenset(name for name, ranges in pieces.items() if not np.isnan(ranges[index, 0]))


def change_between(loop: ClosedLoop, parameter: Parameter, low: float, high: float) -> float:
    """A value in (low, high] at which the pieces are not those of `low`, as they are just before.

    At `high` they must differ.
    """
    laws = _laws(loop)
    believed = [model for model, _ in laws.values()]
    inertia, gains = loop.controller.model.inertia, loop.controller.gains
    least = low if parameter == "L" else gains.observer
    closed = all(
        model.stribeck_shape == 1.0 and model.viscous_damping + least * inertia > 0.0 for model in believed
    )
    if closed:
        numbers = np.array([
            (true.static_torque, model.static_torque, model.stribeck_torque, model.stribeck_velocity,
             model.viscous_damping)
            for model, true in laws.values()
        ])  # fmt: skip
        other = gains.observer if parameter == "r" else gains.compensation
        return change_of_rests(numbers, inertia, parameter == "r", other, low, high)
    before = present(rest_pieces(loop, parameter, np.array([low])), 0)
    while low < (middle := 0.5 * (low + high)) < high:
        if present(rest_pieces(loop, parameter, np.array([middle])), 0) == before:
            low = middle
        else:
            high = middle
    return high


def _closed_form(
    loop: ClosedLoop, r: FloatArray, observer: FloatArray, around: FloatArray
) -> dict[str, FloatArray] | None:
    """Rests away from the set point by name; `around` (n, 2) is widened by those that touch it.

    None where they are not closed form.
    """
    rests: dict[str, FloatArray] = {}
    for direction in DIRECTIONS:
        found = _edges(loop, r, observer, direction)
        if found is None:
            return None
        low, high = found.T
        touches = (low == 0.0) | (high == 0.0)
        around[:, 0] += np.where(touches, low, 0.0)  # each direction has its own side
        around[:, 1] += np.where(touches, high, 0.0)
        rests[f"{direction} 0"] = _only(found, ~touches & (low < high))
    return rests


def _only(ranges: FloatArray, where: NDArray[np.bool_]) -> FloatArray:
    return np.where(where[:, np.newaxis], ranges, np.nan)


def _one_by_one(
    loop: ClosedLoop, parameter: Parameter, values: FloatArray, around: FloatArray
) -> dict[str, FloatArray]:
    """As `_closed_form`, for any shape; the rests of a direction are numbered as x1 rises."""
    rests: dict[str, FloatArray] = {}
    for index, value in enumerate(values.tolist()):
        at = with_gain(loop, parameter, value)
        numbers = dict.fromkeys(DIRECTIONS, 0)
        for one in equilibrium_set(at.robot, at.controller).segments:
            if one.touches_zero:
                around[index, 0] = min(around[index, 0], one.x1_min)
                around[index, 1] = max(around[index, 1], one.x1_max)
                continue
            name = f"{one.direction} {numbers[one.direction]}"
            numbers[one.direction] += 1
            rests.setdefault(name, np.full((values.size, 2), np.nan))[index] = one.x1_min, one.x1_max
    return rests


def _laws(loop: ClosedLoop) -> dict[Direction, tuple[StribeckCurve, StribeckCurve]]:
    """The model's and the robot's law in each direction."""
    true, model = loop.robot.friction, loop.controller.model.friction
    return {"positive": (model.positive, true.positive), "negative": (model.negative, true.negative)}


def _onset(loop: ClosedLoop, r: FloatArray, direction: Direction) -> FloatArray:
    """r F_s^ - F_s (n,) [N m]: where it is positive, the compensation alone moves the link."""
    believed, held = _laws(loop)[direction]
    return r * believed.static_torque - held.static_torque


def _edges(loop: ClosedLoop, r: FloatArray, observer: FloatArray, direction: Direction) -> FloatArray | None:
    """Ends (n, 2) of the rests x1 [rad] with x2 in one direction, equal where there are none.

    None where they are not closed form.
    """
    model, gains = loop.controller.model, loop.controller.gains
    believed, _ = _laws(loop)[direction]
    slope = believed.viscous_damping + observer * model.inertia
    if believed.stribeck_shape != 1.0 or not np.all(slope > 0.0):
        return None
    speeds = np.empty((r.size, 2))
    fading = r * believed.stribeck_torque
    resting_ranges(slope, _onset(loop, r, direction), fading, believed.stribeck_velocity, speeds)
    x1 = speeds * ((slope + gains.derivative) / gains.proportional)[:, np.newaxis]
    return 0.0 - x1[:, ::-1] if direction == "positive" else x1

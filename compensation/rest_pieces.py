"""The pieces of the equilibrium set at every value of a gain: what a diagram draws of the rests.

What touches the set point is one piece, the rest of each direction is one by one; where nothing touches it,
the set point stands alone. For a Stribeck shape of 1 the edges over all values come from one kernel
(`lambert_roots`), otherwise value by value (`equilibria`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.equilibria import DIRECTIONS, Direction, equilibrium_set
from compensation.lambert_roots import resting_ranges
from compensation.loop_section import with_gain
from compensation.loop_tables import Parameter
from ident.simulation.filippov_system import FloatArray

SET_POINT: Final = "set point"
AROUND: Final = "around the set point"

PieceName = tuple[str, bool]
"""A piece and whether it is stable."""

Pieces = dict[PieceName, tuple[float, float]]
"""Ranges of x1 [rad] by piece."""


def rest_pieces(loop: ClosedLoop, parameter: Parameter, values: FloatArray) -> list[Pieces]:
    """The pieces at `values` (n,) of r [-] or L [1/s]."""
    r = values if parameter == "r" else np.full(values.size, loop.controller.gains.compensation)
    observer = values if parameter == "L" else np.full(values.size, loop.controller.gains.observer)
    pushed = (_onset(loop, r, "positive") > 0.0) | (_onset(loop, r, "negative") > 0.0)
    edges = {direction: _edges(loop, r, observer, direction) for direction in DIRECTIONS}
    ranges: list[list[tuple[Direction, float, float]]] = [[] for _ in range(values.size)]
    if any(found is None for found in edges.values()):
        for index, value in enumerate(values.tolist()):
            at = with_gain(loop, parameter, value)
            segments = equilibrium_set(at.robot, at.controller).segments
            ranges[index] = [(one.direction, one.x1_min, one.x1_max) for one in segments]
    else:
        for direction, found in edges.items():  # positive first: its rests are below the set point
            for index, (low, high) in enumerate(found.tolist() if found is not None else ()):
                if high > low:
                    ranges[index].append((direction, low, high))
    return [_named(here, beyond) for here, beyond in zip(ranges, pushed.tolist(), strict=True)]


def _onset(loop: ClosedLoop, r: FloatArray, direction: Direction) -> FloatArray:
    """r F_s^ - F_s (n,) [N m]: where it is positive, the compensation alone moves the link."""
    true, model = loop.robot.friction, loop.controller.model.friction
    held = true.positive if direction == "positive" else true.negative
    believed = model.positive if direction == "positive" else model.negative
    return r * believed.static_torque - held.static_torque


def _edges(loop: ClosedLoop, r: FloatArray, observer: FloatArray, direction: Direction) -> FloatArray | None:
    """Ends (n, 2) of the rests x1 [rad] with x2 in one direction, equal where there are none.

    None where they are not closed form.
    """
    model, gains = loop.controller.model, loop.controller.gains
    believed = model.friction.positive if direction == "positive" else model.friction.negative
    slope = believed.viscous_damping + observer * model.inertia
    if believed.stribeck_shape != 1.0 or not np.all(slope > 0.0):
        return None
    speeds = np.empty((r.size, 2))
    fading = r * believed.stribeck_torque
    resting_ranges(slope, _onset(loop, r, direction), fading, believed.stribeck_velocity, speeds)
    x1 = speeds * ((slope + gains.derivative) / gains.proportional)[:, np.newaxis]
    return 0.0 - x1[:, ::-1] if direction == "positive" else x1


def _named(ranges: list[tuple[Direction, float, float]], pushed: bool) -> Pieces:
    """The pieces of ranges (direction, x1_min, x1_max) in rising order, and the set point among them.

    The set point alone is unstable where the compensation exceeds the static friction in a direction.
    """
    pieces: Pieces = {}
    touching = [(low, high) for _, low, high in ranges if low == 0.0 or high == 0.0]
    if touching:
        pieces[AROUND, True] = (
            min(0.0, *(low for low, _ in touching)),
            max(0.0, *(high for _, high in touching)),
        )
    else:
        pieces[SET_POINT, not pushed] = (0.0, 0.0)
    outer = [(direction, low, high) for direction, low, high in ranges if low > 0.0 or high < 0.0]
    for number, (direction, low, high) in enumerate(outer):
        pieces[f"{direction} {number}", True] = (low, high)
    return pieces

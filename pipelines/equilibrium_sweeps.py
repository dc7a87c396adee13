"""Equilibrium sets over the observer gain, as arrays: what figures 4 and 8 show and their tables hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from compensation.controller import Controller, Gains
from compensation.equilibria import EquilibriumSet, equilibrium_set, equilibrium_sets
from data.recording import FloatArray
from ident.model.robot import OneLinkRobot
from pipelines.results.folder import ResultFolder

FIGURE_8_GAINS: Final = (0.9, 0.95, 0.99, 1.0, 1.005, 1.01, 1.02)  # r; the paper does not print its own
_POINTS: Final = 481
_FAR_APART: Final = 20.0  # ratio of marks that no even axis shows together
_FAR_BELOW: Final = 0.02
_NEAR_FOLD: Final = (0.0, 1e-5, 1e-4, 5e-4, 1e-3, 2e-3)  # relative distances below the end of a set


def observer_gain_axis(*marks: float) -> FloatArray:
    """Observer gains (n,) [1/s] from near 0 to well past every finite one of `marks`.

    Evenly spaced; by ratios from far below the least mark where the marks lie orders of magnitude apart.
    """
    finite = [mark for mark in marks if np.isfinite(mark) and mark > 0] or [100.0]
    end = 1.4 * max(finite)
    if max(finite) > _FAR_APART * min(finite):
        return np.geomspace(_FAR_BELOW * min(finite), end, _POINTS)
    return np.linspace(end / (_POINTS - 1), end, _POINTS)


def with_folds(
    observer_gain: FloatArray,
    robot: OneLinkRobot,
    model: OneLinkRobot,
    gains: Gains,
    *,
    compensation_gains: Sequence[float],
) -> FloatArray:
    """The axis (n,) [1/s] with more points where, for one of the r, the equilibria end: edges meet there."""
    ends = [
        _fold(observer_gain, robot, model, gains, r)
        for r in compensation_gains
        if r > 0.0  # without compensation the set never ends
    ]
    near = [end * (1.0 - distance) for end in ends if end is not None for distance in _NEAR_FOLD]
    return np.union1d(observer_gain, near)


def extrema(
    robot: OneLinkRobot,
    model: OneLinkRobot,
    gains: Gains,
    *,
    compensation_gain: float,
    observer_gain: FloatArray,
) -> FloatArray:
    """Least and largest x1 at rest (n, 2) [rad] over observer gains (n,) [1/s]."""
    sets = _sets(robot, model, gains, r=compensation_gain, observer_gain=observer_gain)
    return np.array([(found.x1_min, found.x1_max) for found in sets])


def edges(
    robot: OneLinkRobot,
    model: OneLinkRobot,
    gains: Gains,
    *,
    compensation_gain: float,
    observer_gain: FloatArray,
) -> FloatArray:
    """Outer and inner edge of |x1| (n, 2) [rad] of the segment that reaches farthest.

    NaN: no segment, or no inner edge because it touches the set point.
    """
    sets = _sets(robot, model, gains, r=compensation_gain, observer_gain=observer_gain)
    return np.array([_farthest(found) for found in sets])


def write_extrema(
    folder: ResultFolder, name: str, observer_gain: FloatArray, curves: dict[str, FloatArray]
) -> None:
    """A table with a row an observer gain and two columns, `_x1_min` and `_x1_max`, a curve."""
    header = ["L", *(f"{label}_{end}" for label in curves for end in ("x1_min", "x1_max"))]
    folder.write_csv(name, header, np.column_stack([observer_gain, *curves.values()]).tolist())


def write_edges(
    folder: ResultFolder, name: str, observer_gain: FloatArray, curves: dict[float, FloatArray]
) -> None:
    """A table with a row an r and observer gain; an edge that does not exist is an empty cell."""
    rows: list[Sequence[float]] = [
        (r, float(L), *map(float, ends))
        for r, curve in curves.items()
        for L, ends in zip(observer_gain, curve, strict=True)
    ]
    folder.write_csv(name, ("r", "L", "x1_outer", "x1_inner"), rows)


def _sets(
    robot: OneLinkRobot, model: OneLinkRobot, gains: Gains, *, r: float, observer_gain: FloatArray
) -> tuple[EquilibriumSet, ...]:
    controller = Controller(replace(gains, compensation=r), model)
    return equilibrium_sets(robot, controller, parameter="L", values=observer_gain)


def _fold(
    observer_gain: FloatArray, robot: OneLinkRobot, model: OneLinkRobot, gains: Gains, r: float
) -> float | None:
    """The largest L [1/s] on the axis with rests beside the set point, to rounding; None: all or none."""

    def rests(L: float) -> bool:
        controller = Controller(replace(gains, compensation=r, observer=L), model)
        return not equilibrium_set(robot, controller).is_single_point

    some = np.array([rests(float(L)) for L in observer_gain])
    if some.all() or not some.any() or some[-1]:
        return None
    last = int(np.flatnonzero(some)[-1])
    low, high = float(observer_gain[last]), float(observer_gain[last + 1])
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(middle) else (low, middle)
    return low


def _farthest(found: EquilibriumSet) -> tuple[float, float]:
    if found.is_single_point:
        return np.nan, np.nan
    ends = [(max(abs(s.x1_min), abs(s.x1_max)), s) for s in found.segments]
    outer, segment = max(ends, key=lambda end: end[0])
    inner = min(abs(segment.x1_min), abs(segment.x1_max))
    return outer, np.nan if segment.touches_zero else inner

"""Limit cycles as fixed points of a return map, with their Floquet multipliers.

A return map takes a point of a section to the next one; a cycle of k returns is a fixed point of its
k-th iterate. Where the map contracts strongly (friction forgets: most cycles of dry friction are
superstable), following it finds the cycle to rounding within a few returns. Where it contracts slowly
or not at all, Newton's method (shooting) on the fixed-point equation takes over, with the derivative
that the map gives.

Where the system is odd under a change of sign, the map may be that of a half turn followed by the
change of sign. A cycle with an odd number of such returns is symmetric, and takes each of them twice.

The Floquet multipliers are the eigenvalues of the derivative of the map over a period; the one that is
always 1, along the cycle, is not among them. The cycle is stable where all lie inside the unit circle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from ident.simulation.filippov_system import FloatArray

MOST_TURNS: Final = 6  # returns a cycle may take
PATIENCE: Final = 240  # returns to follow before giving up
FIRST_LOOK: Final = 3
SHOOTING: Final = 12  # returns after which following is dearer than shooting
LONGEST_LOOK: Final = 24  # each look is as long as all before, up to this
NEWTON_STEPS: Final = 12
SAME_POINT: Final = 1e-7  # relative distance of points of a converged cycle that are one
VANISHED: Final = 1e-9  # of the start: what has become as small decays
NEAR: Final = 1e-3  # relative distance from which shooting is tried
UNREPEATED: Final = "no repetition within"
DECAYS: Final = "decays to a point"
NO_DERIVATIVE: Final = "the return has no derivative that leads on"


@dataclass(frozen=True)
class Returns:
    """A stretch of a return map: points and what happened on the way to each."""

    points: FloatArray  # (k, d) coordinates on the section [units of the system]
    durations: FloatArray  # (k,) [s]
    lows: FloatArray  # (k,) least x1 on the way [units of the system]
    highs: FloatArray  # (k,) greatest x1 [units of the system]
    end_reason: str  # "section reached" if all returns were made


class ReturnMap(Protocol):
    """What a system tells of its section."""

    @property
    def symmetric(self) -> bool:
        """Whether a return is a half turn followed by a change of sign."""

    @property
    def accuracy(self) -> float:
        """Relative distance within which the map tells points apart no more: they are the same."""

    def follow(self, point: FloatArray, returns: int) -> Returns:
        """The next `returns` returns after a point (d,) of the section."""

    def derivative(self, point: FloatArray) -> FloatArray | None:
        """Derivative (d, d) of one return, None where there is no return."""


@dataclass(frozen=True)
class Cycle:
    """A limit cycle."""

    point: FloatArray  # (d,) on the section [units of the system]
    returns: int  # of the map, in a period or, of a symmetric cycle, in half of it
    period: float  # [s]
    x1_min: float  # least value of the watched coordinate [its unit]
    x1_max: float  # greatest [its unit]
    multipliers: tuple[complex, ...]  # the largest first
    stable: bool

    @property
    def amplitude(self) -> float:
        """max|x1| over a period."""
        return max(abs(self.x1_min), abs(self.x1_max))


@dataclass(frozen=True)
class NoCycle:
    """Why a search ended without a cycle."""

    end_reason: str


def is_undecided(found: Cycle | NoCycle) -> bool:
    """Whether the motion neither repeats nor comes to rest as far as it was followed."""
    return isinstance(found, NoCycle) and found.end_reason.startswith(UNREPEATED)


def find_cycle(section: ReturnMap, start: FloatArray) -> Cycle | NoCycle:
    """The cycle that a point (d,) of the section leads to."""
    done = section.follow(start, FIRST_LOOK)
    points = done.points
    while True:
        if done.end_reason != "section reached":
            return NoCycle(done.end_reason)
        returns = _repeats(points, section.accuracy)
        if returns:
            return cycle_at(section, points[-1], returns)
        if float(np.max(np.abs(points[-1]))) <= VANISHED * float(np.max(np.abs(start))):
            return NoCycle(DECAYS)
        if points.shape[0] >= PATIENCE:
            return NoCycle(f"{UNREPEATED} {points.shape[0]} returns")
        returns = _repeats(points, NEAR)
        if returns and points.shape[0] >= SHOOTING:
            shot = shoot(section, points[-1], returns)
            if isinstance(shot, Cycle) and shot.stable:
                return shot
        done = section.follow(points[-1], min(points.shape[0], LONGEST_LOOK))
        points = np.concatenate([points, done.points])


def shoot(section: ReturnMap, guess: FloatArray, returns: int) -> Cycle | NoCycle:
    """Newton's method on the fixed-point equation of `returns` returns, from a guess (d,); stable or not."""
    point = guess
    for _ in range(NEWTON_STEPS):
        done = section.follow(point, returns)
        slope = slope_of(section, point, returns)
        if done.end_reason != "section reached":
            return NoCycle(done.end_reason)
        change = None if slope is None else _newton_step(slope, done.points[-1] - point)
        if change is None:
            return NoCycle(NO_DERIVATIVE)
        point = point + change
        if float(np.max(np.abs(change))) <= section.accuracy * float(np.max(np.abs(point))):
            return cycle_at(section, point, returns)
    return NoCycle(f"shooting did not converge in {NEWTON_STEPS} steps")


def cycle_at(section: ReturnMap, point: FloatArray, returns: int) -> Cycle | NoCycle:
    """The cycle through a fixed point (d,) of the map's iterate, the point corrected by one Newton step."""
    done = section.follow(point, returns)
    same = max(SAME_POINT, section.accuracy)
    fewer = _repeats(np.concatenate([done.points[-1:], done.points]), same)
    if done.end_reason == "section reached" and 0 < fewer < returns:
        return cycle_at(section, point, fewer)
    if done.end_reason != "section reached":
        return NoCycle(done.end_reason)
    slope = slope_of(section, point, returns)
    change = None if slope is None else _newton_step(slope, done.points[-1] - point)
    if slope is None or change is None:
        return NoCycle(NO_DERIVATIVE)
    point = point + change
    sides = np.where(np.arange(returns) % 2 == 0, 1.0, -1.0 if section.symmetric else 1.0)
    ends = np.concatenate([sides * done.lows, sides * done.highs])
    extremes = (float(ends.min()), float(ends.max()))
    return cycle_of(point, returns, float(np.sum(done.durations)), extremes, slope, section.symmetric)


def cycle_of(
    point: FloatArray,
    returns: int,
    duration: float,
    extremes: tuple[float, float],
    slope: FloatArray,
    symmetric: bool,
) -> Cycle:
    """The cycle of a number of returns that take a `duration` [s], from what was found of them.

    `extremes` are those of x1 on the way and `slope` (d, d) is their derivative. In a `symmetric` map an odd
    number of returns is half a period.
    """
    low, high = extremes
    if symmetric and returns % 2 == 1:
        duration, slope = 2.0 * duration, slope @ slope
        high = max(high, -low)
        low = -high
    multipliers = sorted(_eigenvalues(slope), key=abs, reverse=True)
    return Cycle(
        point=point,
        returns=returns,
        period=duration,
        x1_min=low,
        x1_max=high,
        multipliers=tuple(multipliers),
        stable=abs(multipliers[0]) < 1.0,
    )


def _eigenvalues(slope: FloatArray) -> list[complex]:
    """Of a derivative (d, d); of two rows in closed form, the smaller by the product of both."""
    if slope.shape != (2, 2):
        return [complex(value) for value in np.linalg.eigvals(slope)]
    (a, b), (c, d) = slope.tolist()
    middle, half = 0.5 * (a + d), 0.5 * (a - d)
    square = half * half + b * c
    if square < 0.0:
        return [complex(middle, side * math.sqrt(-square)) for side in (1.0, -1.0)]
    larger = middle + math.copysign(math.sqrt(square), middle)
    return [complex(larger), complex((a * d - b * c) / larger if larger else 0.0)]


def _newton_step(slope: FloatArray, missing: FloatArray) -> FloatArray | None:
    """Change (d,) of a point that the return misses by (d,); None where the derivative (d, d) tells none."""
    try:
        return np.asarray(np.linalg.solve(np.eye(missing.size) - slope, missing), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None


def _repeats(points: FloatArray, tolerance: float) -> int:
    """How many returns until the last point comes back, 0 where it does not."""
    if points.shape[0] < 2:
        return 0
    scale = float(np.max(np.abs(points[-1])))
    for returns in range(1, min(MOST_TURNS, points.shape[0] - 1) + 1):
        if float(np.max(np.abs(points[-1] - points[-1 - returns]))) <= tolerance * scale:
            return returns
    return 0


def slope_of(section: ReturnMap, point: FloatArray, returns: int) -> FloatArray | None:
    """Derivative (d, d) of `returns` returns from a point (d,), None where there is no return."""
    slope = np.eye(point.size)
    at = point
    for index in range(returns):
        once = section.derivative(at)
        if once is None:
            return None
        slope = once @ slope
        if index + 1 < returns:
            points = section.follow(at, 1).points
            if points.size == 0:
                return None
            at = points[-1]
    return slope

r"""Which way a link moves, read off its positions.

A filtered speed misplaces a reversal, because friction makes the acceleration jump there, and a sign taken
too early or too late looks like a delay, a damping, an inertia. The positions themselves tell the turn: the
sign changes where the position has its extreme, and is in doubt while the position lies within the
resolution of that extreme. Left and right of it the position leaves the extreme like a parabola, so that
the turn lies as far before the exit from one resolution as that lies before the exit from four.

A link that needs long for one step of the resolution, turning or not, may as well stick. `dwell` is the time
that each sample's step takes; what is long is for the filter to say.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.simulation.compiled import owning

NOISE: Final = 5.0  # standard deviations of a noisy position that count as one step


def position_noise(position: FloatArray) -> float:
    """Standard deviation [rad] of white noise in a smooth position (n,), from its third differences."""
    return 1.4826 * float(np.median(np.abs(np.diff(position, 3)))) / float(np.sqrt(20.0))


def position_step(position: FloatArray, resolution: float | None) -> float:
    """The least change [rad] of a position (n,) that is a motion."""
    rounding = 1e-12 * float(np.ptp(position))
    return max(1.01 * (resolution or 0.0), NOISE * position_noise(position), rounding, 1e-300)


@owning
def direction_of_motion(position: FloatArray, step: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Direction (n,), +1 or -1, and dwell (n,) [samples], the time that the step at each sample takes."""
    n = position.size
    direction, dwell = np.ones(n), np.zeros(n, dtype=np.int64)
    low = high = 0  # the extremes so far, until the first motion says which way it goes
    way, extreme, level = 0.0, 0, 0
    for k in range(n):
        if way == 0.0:
            low = k if position[k] < position[low] else low
            high = k if position[k] > position[high] else high
            if position[high] - position[low] > step:
                way = 1.0 if high > low else -1.0
                dwell[:k] = k
                direction[: k + 1] = way
                extreme = level = k
            continue
        if way * (position[k] - position[extreme]) >= 0.0:
            extreme = k if position[k] != position[extreme] else extreme
            if way * (position[k] - position[level]) > step:
                dwell[level:k] = k - level
                level = k
        elif way * (position[extreme] - position[k]) > step:
            first = extreme
            while first > 0 and abs(position[first - 1] - position[extreme]) <= step:
                first -= 1
            turn = _turn(position, first, extreme, k, step)
            dwell[first:k] = k - first
            direction[first:turn] = way
            direction[turn : k + 1] = -way
            way, extreme, level = -way, k, k
            continue
        direction[k] = way
    if level < n and n - level > 1:
        dwell[level:] = max(n - level, dwell[level])
    if way == 0.0:
        dwell[:] = n
    return direction, dwell


@owning
def _turn(position: FloatArray, first: int, extreme: int, past: int, step: float) -> int:
    """The sample of the turn, between the first within a step of the extreme and the first beyond."""
    begin, end = first, past
    while begin > 0 and abs(position[begin - 1] - position[extreme]) <= 4.0 * step:
        begin -= 1
    while end < position.size - 1 and abs(position[end] - position[extreme]) <= 4.0 * step:
        end += 1
    ahead, behind = 2 * first - begin, 2 * past - end
    middle = (ahead + behind) // 2
    return min(max(middle, first + 1), past)

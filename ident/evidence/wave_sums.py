"""Sums of a run's blocks over waves of many wavenumbers, compiled.

For each k the blocks' cos k q and sin k q, less what mean and trend span, are projected on the torque and on
each other. Where the k are equally spaced, the phases turn by the same angles from each to the next, which
costs four products a block instead of a sine and a cosine.
"""

from __future__ import annotations

import numpy as np

from data.recording import FloatArray
from ident.simulation.compiled import compiled

SAME_STEP = 1e-9  # relative, by which steps of k differ that are equal
LONGEST = 64  # turns after which the phases are taken anew


def wave_sums(
    grid: FloatArray, *, position: FloatArray, torque: FloatArray, smooth: FloatArray, stride: float
) -> tuple[FloatArray, FloatArray]:
    """Projections (w, 2) of block torques (m,) [N m] on cos k q and sin k q, k of `grid` (w,) [1/rad], and
    the products (w, 2, 2) of these, at positions (m,) [rad] that are means over `stride` [rad].

    `smooth` (m, 2) is orthonormal; what it spans is taken off the waves.
    """
    right, left = np.zeros((grid.size, 2)), np.zeros((grid.size, 2, 2))
    turning = np.empty((4, position.size))
    grid, position, torque, smooth = (np.ascontiguousarray(a) for a in (grid, position, torque, smooth))
    _sum(grid, position, torque, smooth, stride, turning, right, left)
    return right, left


@compiled
def _sum(
    grid: FloatArray,
    position: FloatArray,
    torque: FloatArray,
    smooth: FloatArray,
    stride: float,
    turning: FloatArray,
    right: FloatArray,
    left: FloatArray,
) -> None:
    """`wave_sums` into `right` and `left`; `turning` (4, m) holds the phases and what turns them."""
    first = second = 0.0  # what mean and trend hold of the torque
    for j in range(position.size):
        first += smooth[j, 0] * torque[j]
        second += smooth[j, 1] * torque[j]
    step, turns = 0.0, LONGEST
    for n in range(grid.size):
        asked = grid[n] - grid[n - 1] if n > 0 else 0.0
        if n > 0 and abs(asked - step) > SAME_STEP * abs(asked):
            step, turns = asked, LONGEST
            for j in range(position.size):
                turning[2, j] = np.cos(step * position[j])
                turning[3, j] = np.sin(step * position[j])
        if turns >= LONGEST:
            turns = 0
            for j in range(position.size):
                turning[0, j] = np.cos(grid[n] * position[j])
                turning[1, j] = np.sin(grid[n] * position[j])
        else:
            turns += 1
            for j in range(position.size):
                c, s = turning[0, j], turning[1, j]
                turning[0, j] = c * turning[2, j] - s * turning[3, j]
                turning[1, j] = s * turning[2, j] + c * turning[3, j]
        cu = su = cc = cs = ss = c1 = c2 = s1 = s2 = 0.0
        for j in range(position.size):
            c, s = turning[0, j], turning[1, j]
            cu += c * torque[j]
            su += s * torque[j]
            cc += c * c
            cs += c * s
            ss += s * s
            c1 += c * smooth[j, 0]
            c2 += c * smooth[j, 1]
            s1 += s * smooth[j, 0]
            s2 += s * smooth[j, 1]
        half = 0.5 * stride * grid[n]
        fading = np.sin(half) / half if half != 0.0 else 1.0
        right[n, 0] = fading * (cu - c1 * first - c2 * second)
        right[n, 1] = fading * (su - s1 * first - s2 * second)
        left[n, 0, 0] = fading**2 * (cc - c1 * c1 - c2 * c2)
        left[n, 0, 1] = left[n, 1, 0] = fading**2 * (cs - c1 * s1 - c2 * s2)
        left[n, 1, 1] = fading**2 * (ss - s1 * s1 - s2 * s2)

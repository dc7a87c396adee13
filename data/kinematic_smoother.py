r"""Kalman filter and Rauch-Tung-Striebel smoother of the kinematic model, compiled.

State (q, v, a), driven by white jerk of spectral density S; q is measured with unit noise. Over a step h

    F = [[1, h, h^2/2], [0, 1, h], [0, 0, 1]],    Q = S [[h^5/20, h^4/8, h^3/6], [h^4/8, h^3/3, h^2/2],
                                                         [h^3/6, h^2/2, h]].

The covariances depend on the steps and on S alone, never on the measurements, and where the steps are equal
they settle within some dozens of samples, forwards and backwards. Until then the recursion is carried out in
full; from then on its gains are constants and a sample costs a few additions. Where the steps differ it is
carried out in full throughout. filterpy's `batch_filter` and `rts_smoother` do the same arithmetic sample by
sample and are what this is tested against, except that they take a covariance as a difference (see below)
and lose its digits where S is small.

Source: Rauch, Tung, Striebel, AIAA Journal 3 (1965); Bar-Shalom, Li, Kirubarajan, Estimation with
Applications to Tracking and Navigation (2001), section 6.2.3.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.compiled import kernel

FloatArray = NDArray[np.float64]
_SETTLED: Final = 1e-14  # change of a covariance in a step, in parts of it, that rounding alone makes


@kernel
def _carry(spread: FloatArray, step: float, density: float, ahead: FloatArray) -> None:
    """Covariance (3, 3) after a step: F P F' + Q into `ahead`."""
    h = step
    moved = np.empty((3, 3))  # F P
    for j in range(3):
        moved[0, j] = spread[0, j] + h * (spread[1, j] + 0.5 * h * spread[2, j])
        moved[1, j] = spread[1, j] + h * spread[2, j]
        moved[2, j] = spread[2, j]
    for i in range(3):
        ahead[i, 0] = moved[i, 0] + h * (moved[i, 1] + 0.5 * h * moved[i, 2])
        ahead[i, 1] = moved[i, 1] + h * moved[i, 2]
        ahead[i, 2] = moved[i, 2]
    ahead[0, 0] += density * h**5 / 20.0
    ahead[0, 1] += density * h**4 / 8.0
    ahead[1, 0] += density * h**4 / 8.0
    ahead[0, 2] += density * h**3 / 6.0
    ahead[2, 0] += density * h**3 / 6.0
    ahead[1, 1] += density * h**3 / 3.0
    ahead[1, 2] += density * h**2 / 2.0
    ahead[2, 1] += density * h**2 / 2.0
    ahead[2, 2] += density * h


@kernel
def _measured(prior: FloatArray, gain: FloatArray, posterior: FloatArray) -> None:
    """Gain (3,) of a measurement of q with unit noise, and the covariance after it (Joseph's form)."""
    for i in range(3):
        gain[i] = prior[i, 0] / (prior[0, 0] + 1.0)
    kept = np.empty((3, 3))  # (I - K H) P
    for i in range(3):
        for j in range(3):
            kept[i, j] = prior[i, j] - gain[i] * prior[0, j]
    for i in range(3):
        for j in range(3):
            posterior[i, j] = kept[i, j] - kept[i, 0] * gain[j] + gain[i] * gain[j]


@kernel
def _backward_gain(posterior: FloatArray, step: float, ahead: FloatArray, gain: FloatArray) -> None:
    """The smoother's gain P F' (F P F' + Q)^-1 into `gain` (3, 3), by Cholesky."""
    low = np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            left = ahead[i, j]
            for k in range(j):
                left -= low[i, k] * low[j, k]
            low[i, j] = math.sqrt(left) if i == j else left / low[j, j]
    row = np.empty(3)
    for i in range(3):
        row[0] = posterior[i, 0] + step * (posterior[i, 1] + 0.5 * step * posterior[i, 2])
        row[1] = posterior[i, 1] + step * posterior[i, 2]
        row[2] = posterior[i, 2]
        for j in range(3):
            for k in range(j):
                row[j] -= low[j, k] * row[k]
            row[j] /= low[j, j]
        for j in range(2, -1, -1):
            for k in range(j + 1, 3):
                row[j] -= low[k, j] * row[k]
            row[j] /= low[j, j]
        for j in range(3):
            gain[i, j] = row[j]


@kernel
def _same(one: FloatArray, other: FloatArray) -> bool:
    for i in range(3):
        for j in range(3):
            size = math.sqrt(abs(one[i, i] * one[j, j]))
            if not abs(one[i, j] - other[i, j]) <= _SETTLED * size:
                return False
    return True


@kernel
def _smooth_back(
    spread: FloatArray, step: float, density: float, gain: FloatArray, after: FloatArray, out: FloatArray
) -> None:
    """Smoothed covariance (3, 3) into `out`, as a sum: (I - C F) P (I - C F)' + C (P_after + Q) C'.

    The usual P + C (P_after - F P F' - Q) C' is the same, but a small difference of large terms where the
    filter knew little.
    """
    left, driven, nothing = np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3))
    _carry(nothing, step, density, driven)
    for i in range(3):
        for j in range(3):
            driven[i, j] += after[i, j]
        left[i, 0] = -gain[i, 0]
        left[i, 1] = -(gain[i, 0] * step + gain[i, 1])
        left[i, 2] = -(gain[i, 0] * 0.5 * step * step + gain[i, 1] * step + gain[i, 2])
        left[i, i] += 1.0
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for n in range(3):
                    total += left[i, k] * spread[k, n] * left[j, n]
                    total += gain[i, k] * driven[k, n] * gain[j, n]
            out[i, j] = total


@kernel
def smooth(
    steps: FloatArray, even: bool, position: FloatArray, density: float, start: FloatArray, doubt: FloatArray
) -> FloatArray:
    """Velocity, acceleration and their standard errors (4, m), in units of noise and time.

    Parameters
    ----------
    steps
        (m - 1,) between samples; all equal to the first where `even`.
    position
        (m,) in standard deviations of the measurement, m >= 2.
    density
        S > 0.
    start, doubt
        (3,) and (3, 3): state and covariance at the first sample before it is measured.
    """
    m = position.size
    states, spreads = np.empty((m, 3)), np.empty((m, 3, 3))
    prior, ahead, gain = doubt.copy(), np.empty((3, 3)), np.empty(3)
    q, v, a = start[0], start[1], start[2]
    settled = m  # first sample from which the forward covariances are those of the sample before
    for k in range(m):
        if k > 0:
            h = steps[k - 1]
            q += h * (v + 0.5 * h * a)
            v += h * a
        if k < settled:
            if k > 0:
                _carry(spreads[k - 1], steps[k - 1], density, ahead)
                if even and _same(ahead, prior):
                    settled = k
                prior[:] = ahead
            _measured(prior, gain, spreads[k])
        wrong = position[k] - q
        q += gain[0] * wrong
        v += gain[1] * wrong
        a += gain[2] * wrong
        states[k, 0], states[k, 1], states[k, 2] = q, v, a
    found = np.empty((4, m))
    last = min(m - 1, settled)
    after, now = spreads[last].copy(), np.empty((3, 3))
    back = np.empty((3, 3))
    fresh = steady = False
    found[0, m - 1], found[1, m - 1] = v, a
    found[2, m - 1], found[3, m - 1] = math.sqrt(after[1, 1]), math.sqrt(after[2, 2])
    for k in range(m - 2, -1, -1):
        h = steps[k]
        if k < settled or not fresh:
            spread = spreads[min(k, settled)]
            _carry(spread, h, density, ahead)
            _backward_gain(spread, h, ahead, back)
            fresh = k >= settled
        if k < settled or not steady:
            _smooth_back(spreads[min(k, settled)], h, density, back, after, now)
            steady = fresh and _same(now, after)
            after[:] = now
        x0, x1, x2 = states[k, 0], states[k, 1], states[k, 2]
        d0 = q - (x0 + h * (x1 + 0.5 * h * x2))
        d1, d2 = v - (x1 + h * x2), a - x2
        q = x0 + back[0, 0] * d0 + back[0, 1] * d1 + back[0, 2] * d2
        v = x1 + back[1, 0] * d0 + back[1, 1] * d1 + back[1, 2] * d2
        a = x2 + back[2, 0] * d0 + back[2, 1] * d1 + back[2, 2] * d2
        found[0, k], found[1, k] = v, a
        found[2, k] = math.sqrt(max(after[1, 1], 0.0))
        found[3, k] = math.sqrt(max(after[2, 2], 0.0))
    return found

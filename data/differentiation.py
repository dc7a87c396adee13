r"""Velocity and acceleration from encoder positions, offline, with standard errors.

The model is the kinematic one: position, velocity and acceleration, driven by white jerk of spectral density
S, and a position measured with noise of variance R (`data.kinematic_smoother`). A Kalman filter runs forwards
and a Rauch-Tung-Striebel smoother backwards over it, so that every sample uses the past and the future; the
smoother's covariances are the standard errors. R is that of rounding to encoder counts, resolution^2/12, or
taken from the third differences where no count is known. S is the one number to choose: it maximises the
likelihood of the filter's innovations, evaluated with the filter's steady gain, which depends only on the
ratio S h^5/R. The innovations then are the third differences of the positions, sent through the filter's own
poles.

The run is taken apart at gaps (steps above three medians) and nothing is differentiated across one. Positions
are scaled by the noise and times by the median step, so that the recursion is well conditioned in any units.

Motion is not white jerk, and rounding errors of a link that moves less than a count a sample are not white
either: the standard errors are a model's, and a steady speed is better taken as the slope over the run.

Source: Rauch, Tung, Striebel, AIAA Journal 3 (1965); Bar-Shalom, Li, Kirubarajan, Estimation with
Applications to Tracking and Navigation (2001), section 6.2.3 (the Wiener process acceleration model). The
model's matrices are filterpy's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from filterpy.common import Q_continuous_white_noise, kinematic_state_transition
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter

from data.findings import LogError
from data.kinematic_smoother import smooth

FloatArray = NDArray[np.float64]
_GAP: Final = 3.0  # median steps
_FEWEST: Final = 8  # samples of a piece that can be differentiated
_JITTER: Final = 0.01  # relative, below which steps count as equal
_RATIOS: Final = np.logspace(-13.0, 5.0, 73)  # S h^5/R that are tried
_SETTLING: Final = 20  # innovations that still remember the start


@dataclass(frozen=True)
class Motion:
    """Derivatives of a recorded position; all arrays are (n,). NaN in pieces too short to differentiate."""

    velocity: FloatArray  # [rad/s]
    acceleration: FloatArray  # [rad/s^2]
    velocity_stderr: FloatArray  # [rad/s]
    acceleration_stderr: FloatArray  # [rad/s^2]


def differentiate(time: FloatArray, position: FloatArray, *, resolution: float | None) -> Motion:
    """Differentiate a recorded position.

    Parameters
    ----------
    time
        (n,) [s], increasing.
    position
        (n,) [rad].
    resolution
        One encoder count [rad]; None: the noise is estimated from the positions.

    Raises
    ------
    LogError
        When the arrays differ in shape, time does not advance, or fewer than eight samples are given.
    """
    if time.shape != position.shape or time.ndim != 1 or time.size < _FEWEST:
        raise LogError(f"{time.size} samples cannot be differentiated; at least {_FEWEST} are needed")
    step = np.diff(time)
    if np.any(step <= 0.0) or not np.all(np.isfinite(position)):
        raise LogError("only finite positions on a clock that advances can be differentiated")
    unit = float(np.median(step))
    noise = _noise(position, resolution)
    bounds = [0, *(np.flatnonzero(step > _GAP * unit) + 1).tolist(), time.size]
    pieces = [slice(begin, end) for begin, end in pairwise(bounds)]
    scaled = (position - position[0]) / noise
    long_enough = [piece for piece in pieces if piece.stop - piece.start >= _FEWEST]
    ratio = _likeliest_ratio([_evenly(time[piece] / unit, scaled[piece]) for piece in long_enough])
    states = np.full((4, time.size), np.nan)
    for piece in long_enough:
        states[:, piece] = _smooth(np.diff(time[piece]) / unit, scaled[piece], ratio)
    speed = noise / unit
    return Motion(
        velocity=states[0] * speed,
        acceleration=states[1] * speed / unit,
        velocity_stderr=states[2] * speed,
        acceleration_stderr=states[3] * speed / unit,
    )


def _noise(position: FloatArray, resolution: float | None) -> float:
    """Standard deviation of the measured position [rad].

    White noise of variance R gives third differences of variance 20 R, and a smooth motion next to none.
    """
    floor = 16.0 * float(np.finfo(np.float64).eps) * max(float(np.max(np.abs(position))), 1e-9)
    if resolution is not None:
        return max(resolution / math.sqrt(12.0), floor)
    third = np.diff(position, 3)
    spread = 1.4826 * float(np.median(np.abs(third)))
    return max(spread / math.sqrt(20.0), floor)


def _likeliest_ratio(pieces: list[FloatArray]) -> float:
    """The S h^5/R under which the innovations are likeliest; positions in units of the noise."""
    if not pieces:
        return 1.0
    scores = [sum(_deviance(piece, ratio) for piece in pieces) for ratio in _RATIOS.tolist()]
    best = int(np.argmin(scores))
    return float(_RATIOS[best])


def _evenly(time: FloatArray, position: FloatArray) -> FloatArray:
    """Positions at equal steps, for the choice of S alone: as they are, or between jittered samples."""
    if np.all(np.abs(np.diff(time) - 1.0) <= _JITTER):
        return position
    even: FloatArray = CubicSpline(time, position)(np.linspace(time[0], time[-1], time.size))
    return even


def _deviance(position: FloatArray, ratio: float) -> float:
    """-2 log likelihood of one piece, a constant aside."""
    gain, variance = _steady_gain(ratio)
    transition = np.asarray(kinematic_state_transition(2, 1.0))
    closed = transition @ (np.eye(3) - np.outer(gain, (1.0, 0.0, 0.0)))
    # From measurement to innovation: zeros where the model's own modes are (all three at 1), which is a third
    # difference and forgets any parabola at the start, and the filter's poles.
    innovation = lfilter([1.0], np.poly(closed).real, np.diff(position, 3))
    settled = innovation[min(_SETTLING, innovation.size // 2) :]
    return float(np.sum(settled**2) / variance + settled.size * np.log(variance))


@cache
def _steady_gain(ratio: float) -> tuple[FloatArray, float]:
    """The filter's gain (3,) and innovation variance at unit step and unit noise, once it has settled."""
    transition = np.asarray(kinematic_state_transition(2, 1.0))
    drive = np.asarray(Q_continuous_white_noise(3, dt=1.0, spectral_density=ratio))
    measured = np.array([[1.0, 0.0, 0.0]])
    prior = np.asarray(solve_discrete_are(transition.T, measured.T, drive, np.eye(1)))
    variance = float(prior[0, 0] + 1.0)
    return prior[:, 0] / variance, variance


def _smooth(steps: FloatArray, position: FloatArray, ratio: float) -> FloatArray:
    """Filter and smooth one piece in scaled units: velocity, acceleration, their standard errors (4, m)."""
    even = bool(np.all(np.abs(steps - 1.0) <= _JITTER))
    if even:
        steps = np.ones_like(steps)
    drive = np.asarray(Q_continuous_white_noise(3, dt=1.0, spectral_density=ratio))
    start, doubt = _start(np.cumsum([0.0, *steps[: _FEWEST - 1].tolist()]), position[:_FEWEST], drive)
    return smooth(steps, even, position, ratio, start, doubt)


def _start(time: FloatArray, position: FloatArray, drive: FloatArray) -> tuple[FloatArray, FloatArray]:
    """State (3,) and its covariance (3, 3) before the first sample: a parabola through the first ones.

    Its covariance is widened, since the same samples are filtered afterwards and the motion is no parabola.
    """
    powers = np.stack((np.ones_like(time), time, 0.5 * time**2), axis=1)
    state: FloatArray = np.linalg.pinv(powers) @ position
    left = position - powers @ state
    variance = max(1.0, float(left @ left) / (time.size - 3))
    doubt = 100.0 * variance * np.linalg.inv(powers.T @ powers) + time.size * drive
    return state, doubt

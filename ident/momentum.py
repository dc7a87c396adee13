r"""The motion after breakaway as a balance of momentum, which holds the inertia.

Eq (1) integrated over a window [t1, t2] of motion in one direction, magnitudes along the motion:

    J (v2 - v1) = int u dt - b (q2 - q1) - F_c (t2 - t1) - dF int exp(-(v/v_s)^beta) dt.

Nothing is differentiated twice, and the law enters as it stands. The torque is held between samples, so its
integral is a sum. The speeds at the window's ends come from `data.differentiation` (a kinematic model,
filtered and smoothed); the exponential needs the speed only roughly.

Windows of a ramp share the speeds at their common ends: their errors are correlated, and the covariance
below says so. What the model of noise leaves out (ripple, a friction that differs from place to place) is
scaled afterwards, with each ramp as one datum.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray, Recording
from ident.breakaway import Breakaway
from ident.segmentation import grain

WINDOWS = 8  # a ramp
LEAST_COUNTS = 12.0  # of travel in the window that a speed is read from
LEAST_SAMPLES = 5  # in it
NODES = 40  # of the integral of the exponential in a window
JUMP = 0.2  # part of the torque by which one sample may differ from the last


@dataclass(frozen=True)
class Momentum:
    """The windows of one motion. Magnitudes along the motion; k windows."""

    log: str
    direction: int
    impulse: FloatArray  # (k,) int u dt [N m s]
    duration: FloatArray  # (k,) [s]
    travel: FloatArray  # (k,) [rad]
    gain: FloatArray  # (k,) v2 - v1 [rad/s]
    nodes: FloatArray  # (k, m) speeds through each window, equally spaced in time [rad/s]
    speed_covariance: FloatArray  # (k, k) of the gain [(rad/s)^2]
    impulse_variance: FloatArray  # (k,) from the samples' white scatter [(N m s)^2]

    def residual(self, inertia: float, law: tuple[float, float, float, float, float]) -> FloatArray:
        """Momentum that the law leaves unexplained (k,) [N m s]; law: F_c, dF, v_s, b, beta."""
        coulomb, stribeck, velocity, damping, shape = law
        fading = np.exp(-((self.nodes / velocity) ** shape)).mean(axis=1) * self.duration
        friction = coulomb * self.duration + stribeck * fading + damping * self.travel
        return np.asarray(self.impulse - friction - inertia * self.gain)


def momentum(recording: Recording, start: Breakaway) -> Momentum | None:
    """The windows of the motion after one breakaway; None where it is too short or coarse to tell speeds."""
    first, past = start.onset, min(_first_jump(recording, start), start.end)
    part = slice(first, past)
    time = recording.time[part]
    position = start.direction * recording.position[part]
    torque = start.direction * recording.torque[part]
    half = _half_width(position, grain(recording))
    if half is None:
        return None
    edges = _edges(time.size, half)
    if edges is None:
        return None
    fits = [_local_motion(time, position, edge, half, grain(recording)) for edge in edges]
    place = np.array([fit[0] for fit in fits])
    speed = np.array([fit[1] for fit in fits])
    variance = np.array([fit[2] for fit in fits])
    if np.any(speed <= 0):
        return None
    step = np.diff(time, append=2 * time[-1] - time[-2])
    pushed = np.concatenate([[0.0], np.cumsum(torque * step)])
    scatter = float(np.mean(np.diff(torque) ** 2)) / 2.0
    windows = np.diff(np.eye(edges.size), axis=0)
    nodes = np.array([np.linspace(a, b, NODES) for a, b in itertools.pairwise(edges)])
    return Momentum(
        log=recording.log,
        direction=start.direction,
        impulse=np.diff(pushed[edges]),
        duration=np.diff(time[edges]),
        travel=np.diff(place),
        gain=np.diff(speed),
        nodes=_chord_speeds(time, position, nodes, half),
        speed_covariance=windows @ np.diag(variance) @ windows.T,
        impulse_variance=np.diff(time[edges]) * recording.sample_period * scatter,
    )


def _first_jump(recording: Recording, start: Breakaway) -> int:
    """First sample at which the torque leaves its ramp in one step."""
    torque = recording.torque[start.onset - 1 : start.end]
    change = np.abs(np.diff(torque))
    noise = 1.4826 * float(np.median(change))
    jumps = np.flatnonzero(change > max(8.0 * noise, JUMP * abs(start.torque)))
    return start.onset + (int(jumps[0]) if jumps.size else torque.size)


def _half_width(position: FloatArray, resolution: float) -> int | None:
    """Half the number of samples that a speed is read from, which span a dozen counts at the mean speed."""
    if position.size < 3 * LEAST_SAMPLES:
        return None
    widest = position.size // 6
    per_sample = (position[-1] - position[0]) / (position.size - 1)
    wanted = max(LEAST_SAMPLES // 2, int(np.ceil(0.5 * LEAST_COUNTS * resolution / max(per_sample, 1e-300))))
    wanted = max(wanted, position.size // 80)
    return wanted if wanted <= widest else None


def _edges(samples: int, half: int) -> FloatArray | None:
    windows = min(WINDOWS, (samples - 1 - 2 * half) // (2 * half))
    if windows < 1:
        return None
    return np.linspace(half, samples - 1 - half, windows + 1).astype(np.int64)


def _chord_speeds(time: FloatArray, position: FloatArray, nodes: FloatArray, half: int) -> FloatArray:
    """Speeds (k, m) at nodes (k, m), in samples, from chords across 2 half samples [rad/s]."""
    samples = np.arange(time.size, dtype=np.float64)
    start, end = np.maximum(nodes - half, 0.0), np.minimum(nodes + half, samples[-1])
    run = np.interp(end, samples, position) - np.interp(start, samples, position)
    duration = np.interp(end, samples, time) - np.interp(start, samples, time)
    return np.asarray(np.maximum(run / duration, 0.0))


def _local_motion(
    time: FloatArray, position: FloatArray, middle: int, half: int, resolution: float
) -> tuple[float, float, float]:
    """Position, speed and the speed's variance from a cubic through 2 half + 1 samples."""
    part = slice(middle - half, middle + half + 1)
    centred = time[part] - time[middle]
    width = max(float(centred[-1]), float(np.finfo(np.float64).tiny))
    basis = np.vander(centred / width, 4, increasing=True)
    origin = position[middle]
    coefficient, *_ = np.linalg.lstsq(basis, position[part] - origin, rcond=None)
    residual = position[part] - origin - basis @ coefficient
    scatter = max(resolution**2 / 12.0, float(residual @ residual) / max(centred.size - 4, 1))
    inverse = np.linalg.inv(basis.T @ basis)
    return (
        float(origin + coefficient[0]),
        float(coefficient[1] / width),
        float(scatter * inverse[1, 1] / width**2),
    )

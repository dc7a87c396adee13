r"""The motion after breakaway as a balance of momentum, which holds the inertia.

Eq (1) integrated over a window [t1, t2] of motion in one direction, magnitudes along the motion:

    J (v2 - v1) = int u dt - b (q2 - q1) - F_c (t2 - t1) - dF int exp(-(v/v_s)^beta) dt.

Nothing is differentiated twice, and the law enters as it stands. The torque is held between samples, so its
integral is a sum. Speeds come from `data.differentiation` (a kinematic model, filtered and smoothed) with
their standard errors, on at most a few hundred samples of the motion.

Windows of a ramp share the speeds at their common ends: their errors are correlated, and the covariance
below says so. What the model of noise leaves out (ripple, a friction that differs from place to place) is
scaled afterwards, with each ramp as one datum.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data.differentiation import differentiate
from data.recording import FloatArray, Recording
from ident.evidence.breakaway import Breakaway
from ident.evidence.segmentation import grain

WINDOWS = 8  # a ramp
LEAST_COUNTS = 12.0  # of travel in the window that a speed is read from
LEAST_SAMPLES = 5  # in it
SMOOTHED = 400  # samples of a motion that are smoothed, at most
RUN_IN = 4  # part of the motion by which the smoothing begins before it: one in so many
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
    places: FloatArray  # (k, m) positions at the nodes, as logged [rad]
    speed_covariance: FloatArray  # (k, k) of the gain [(rad/s)^2]
    impulse_variance: FloatArray  # (k,) from the samples' white scatter [(N m s)^2]

    def residual(self, inertia: float, law: tuple[float, float, float, float, float]) -> FloatArray:
        """Momentum that the law leaves unexplained (k,) [N m s]; law: F_c, dF, v_s, b, beta."""
        coulomb, stribeck, velocity, damping, shape = law
        fading = np.exp(-((self.nodes / velocity) ** shape))
        fading = np.trapezoid(fading, axis=1) / (NODES - 1) * self.duration
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
    speeds, errors = _smoothed_speeds(recording, first, past)
    speeds *= start.direction
    speed, variance = speeds[edges], errors[edges] ** 2
    if np.any(speed <= 0):
        return None
    step = np.diff(time, append=2 * time[-1] - time[-2])
    pushed = np.concatenate([[0.0], np.cumsum(torque * step)])
    scatter = float(np.mean(np.diff(torque) ** 2)) / 2.0
    windows = np.diff(np.eye(edges.size), axis=0)
    samples = np.arange(time.size)
    nodes = np.array([np.linspace(a, b, NODES) for a, b in itertools.pairwise(edges)])
    return Momentum(
        log=recording.log,
        direction=start.direction,
        impulse=np.diff(pushed[edges]),
        duration=np.diff(time[edges]),
        travel=np.diff(position[edges]),
        gain=np.diff(speed),
        nodes=np.maximum(np.interp(nodes, samples, speeds), 0.0),
        places=start.direction * np.interp(nodes, samples, position),
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


def _smoothed_speeds(recording: Recording, first: int, past: int) -> tuple[FloatArray, FloatArray]:
    """Speed and its standard error at samples first to past (n,) [rad/s], from every few of a long motion.

    The rest before it goes in as well: it tells the smoother where the motion came from.
    """
    before = max(first - (past - first) // RUN_IN, 0)
    kept = np.arange(before, past, -(-(past - before) // SMOOTHED))
    # Where the position is noisier than its counts, the noise is taken from the log.
    counted = recording.resolution is not None and grain(recording) <= recording.resolution
    resolution = recording.resolution if counted else None
    motion = differentiate(recording.time[kept], recording.position[kept], resolution=resolution)
    samples = np.arange(first, past)
    return np.interp(samples, kept, motion.velocity), np.interp(samples, kept, motion.velocity_stderr)

"""A bench for a simulated link: torque ramps, a speed loop, and free torque signals, sample by sample.

Each function plays one protocol on a robot under held torque (`ident.response`) and returns the true
motion; what the log makes of it is `data.instruments`' affair. The controllers see the position in encoder
counts, as real ones do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray
from ident.response import advance_with_ripple
from ident.simulation.compiled import compiled
from pipelines.settings.virtual_rig import SpeedLoopSettings

REST = 0.5  # before a ramp and after it [s]


@dataclass(frozen=True)
class Bench:
    """The simulated link and what drives it."""

    plant: FloatArray  # (14,), `ident.response.plant_array`
    period: float  # [s]
    resolution: float  # one encoder count [rad]
    torque_limit: float  # [N m]


@dataclass(frozen=True)
class Motion:
    """A run at its samples; every array is (n,)."""

    position: FloatArray  # true [rad]
    velocity: FloatArray  # true [rad/s]
    torque: FloatArray  # held from this sample to the next [N m]
    reference: FloatArray  # q_r [rad]; 0 where nothing is followed


@compiled
def _ramp(
    plant: FloatArray,
    bench: tuple[float, float],
    ramp: tuple[float, float],
    position: float,
    rows: FloatArray,
) -> int:
    """Rest, ramp, brake, rest into `rows` (3, n); how many samples of it were needed."""
    period, limit = bench
    rate, travel = ramp
    velocity, start, wait = 0.0, position, int(np.rint(REST / period))
    ramped, resting, moving = 0, 0, True
    for k in range(rows.shape[1]):
        torque = 0.0
        if k >= wait and moving:
            ramped += 1
            torque = min(max(rate * ramped * period, -limit), limit)
            stuck = abs(torque) == limit and velocity == 0.0 and ramped * abs(rate) * period > 1.2 * limit
            moving = abs(position - start) < travel and not stuck
        rows[0, k], rows[1, k], rows[2, k] = position, velocity, torque
        position, velocity = advance_with_ripple(position, velocity, torque, period, plant)
        if not moving:
            resting = resting + 1 if velocity == 0.0 else 0
            if resting >= wait:
                return k + 1
    return int(rows.shape[1])


def play_ramps(bench: Bench, *, rate: float, ramps: int, travel: float, start: float) -> Motion:
    """Several torque ramps from rest, each from where the last one left the link.

    `rate` [N m/s] carries the direction; a ramp is ended after `travel` [rad], or at the torque limit, and
    the torque is then 0 until the link has rested. `start` [rad] is where the first one begins.
    """
    static = max(bench.plant[1], bench.plant[6])
    longest = int((3.0 * static / abs(rate) + 30.0) / bench.period)
    pieces: list[FloatArray] = []
    position = start
    for _ in range(ramps):
        rows = np.empty((3, longest))
        n = _ramp(bench.plant, (bench.period, bench.torque_limit), (rate, travel), position, rows)
        pieces.append(rows[:, :n])
        position = float(rows[0, n - 1])
    whole = np.concatenate(pieces, axis=1)
    return Motion(whole[0], whole[1], whole[2], np.zeros(whole.shape[1]))


@compiled
def _follow(
    plant: FloatArray,
    bench: tuple[float, float, float],
    loop: tuple[float, float, float, float],
    course: tuple[float, float, int],
    rows: FloatArray,
) -> None:
    """Follow a constant speed into `rows` (4, n), after `settling` samples that are not kept."""
    period, resolution, limit = bench
    damping, stiffness, integral, corner = loop
    speed, position, settling = course
    velocity = filtered = speed
    side = 1 if speed > 0.0 else 6
    ratio = abs(speed) / plant[side + 2]
    friction = plant[side + 1] + (plant[side] - plant[side + 1]) * np.exp(-(ratio ** plant[side + 4]))
    sign = 1.0 if speed > 0.0 else -1.0
    summed = (sign * friction + plant[side + 3] * speed) / integral
    weight = -np.expm1(-corner * period)
    origin = last = position
    for k in range(-settling, rows.shape[1]):
        measured = resolution * np.rint(position / resolution)
        if k == -settling:
            origin = last = measured
        else:
            filtered += weight * ((measured - last) / period - filtered)
        last = measured
        reference = origin + speed * (k + settling) * period
        error = reference - measured
        summed += error * period
        torque = damping * (speed - filtered) + stiffness * error + integral * summed
        torque = min(max(torque, -limit), limit)
        if k >= 0:
            rows[0, k], rows[1, k], rows[2, k], rows[3, k] = position, velocity, torque, reference
        position, velocity = advance_with_ripple(position, velocity, torque, period, plant)


def play_speed(
    bench: Bench, *, speed: float, duration: float, loop: SpeedLoopSettings, start: float, settling: float
) -> Motion:
    """A constant `speed` [rad/s] held by the speed loop for `duration` [s].

    The log begins `settling` [s] after the link was handed over at that speed, from about `start` [rad].
    """
    rows = np.empty((4, int(duration / bench.period) + 1))
    _follow(
        bench.plant,
        (bench.period, bench.resolution, bench.torque_limit),
        (loop.damping, loop.stiffness, loop.integral, loop.filter),
        (speed, start, int(settling / bench.period)),
        rows,
    )
    return Motion(rows[0], rows[1], rows[2], rows[3])


@compiled
def _push(
    plant: FloatArray,
    bench: tuple[float, float, float],
    hold: tuple[float, float, float],
    signal: FloatArray,
    rows: FloatArray,
) -> None:
    """Apply a torque signal, with a slow hold of a mean speed, into `rows` (3, n); the first samples are
    not kept.
    """
    period, resolution, limit = bench
    position, speed, damping = hold
    velocity = filtered = speed
    weight = -np.expm1(-20.0 * period)
    last = resolution * np.rint(position / resolution)
    lead = signal.size - rows.shape[1]
    for k in range(signal.size):
        measured = resolution * np.rint(position / resolution)
        if k > 0:
            filtered += weight * ((measured - last) / period - filtered)
        last = measured
        torque = min(max(signal[k] + damping * (speed - filtered), -limit), limit)
        if k >= lead:
            rows[0, k - lead], rows[1, k - lead], rows[2, k - lead] = position, velocity, torque
        position, velocity = advance_with_ripple(position, velocity, torque, period, plant)


def play_torque(
    bench: Bench, signal: FloatArray, *, lead: int, start: float, speed: float = 0.0, hold: float = 0.0
) -> Motion:
    """A torque signal (n,) [N m] on a link that moves at `speed` [rad/s]; the first `lead` samples are not
    kept.

    `hold` [N m s/rad] is a slow feedback that keeps the mean speed; its torque is part of the logged one.
    """
    rows = np.empty((3, signal.size - lead))
    settings = (bench.period, bench.resolution, bench.torque_limit)
    _push(bench.plant, settings, (start, speed, hold), signal, rows)
    return Motion(rows[0], rows[1], rows[2], np.zeros(rows.shape[1]))

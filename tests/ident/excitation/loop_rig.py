"""The independent rig of the estimators' tests under a position loop: what an excitation log holds."""

from __future__ import annotations

import math

import numpy as np

from data.recording import FloatArray, Recording
from ident.simulation.compiled import owning
from tests.ident.rigs import Rig, _sample


def followed(
    rig: Rig,
    reference: FloatArray,
    generator: np.random.Generator,
    *,
    log: str = "motion",
    bandwidth: float = 30.0,
    offset: float = 0.0,
) -> Recording:
    """The log of a loop that follows a reference (n,) [rad]; `offset` [N m] acts against the torque."""
    stiffness = rig.robot.inertia * bandwidth**2
    position, torque = _loop(
        rig.law(),
        reference,
        rig.period,
        rig.substeps(),
        stiffness,
        1.4 * rig.robot.inertia * bandwidth,
        rig.resolution,
        3.0 * bandwidth,
        rig.torque_limit,
        offset,
    )
    return rig.recorded(log, "excitation", position=position, torque=torque, generator=generator)


def swings(rig: Rig, *, duration: float, amplitude: float = 2.0, slowest: float = 0.3) -> FloatArray:
    """A multisine reference (n,) [rad] with turns of all sizes."""
    time = rig.period * np.arange(round(duration / rig.period))
    parts = [np.sin(2 * np.pi * slowest * ratio * time + ratio) / ratio for ratio in (1.0, 2.3, 3.9, 5.2)]
    wave = np.sum(parts, axis=0)
    return np.asarray(amplitude * (wave - wave[0]) / np.max(np.abs(wave)))


@owning
def _loop(
    law: FloatArray,
    reference: FloatArray,
    period: float,
    steps: int,
    stiffness: float,
    damping: float,
    resolution: float,
    corner: float,
    limit: float,
    offset: float,
) -> tuple[FloatArray, FloatArray]:
    position, torque = np.empty(reference.size), np.empty(reference.size)
    q, v, seen_before, speed = reference[0], 0.0, reference[0], 0.0
    keep = math.exp(-corner * period)
    for k in range(reference.size):
        seen = round(q / resolution) * resolution
        speed = keep * speed + (1.0 - keep) * (seen - seen_before) / period
        seen_before = seen
        wanted = (reference[k] - reference[k - 1]) / period if k > 0 else 0.0
        u = stiffness * (reference[k] - seen) + damping * (wanted - speed)
        u = max(-limit, min(limit, u))
        position[k], torque[k] = q, u
        q, v = _sample(law, q, v, u - offset, period, steps, 0.0, 0.0)
    return position, torque

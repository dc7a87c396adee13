"""Steady runs in blocks, torque over position: what `ident.evidence.position_ripple` reads waves from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray, Recording
from ident.evidence.friction_map import SteadyRun
from ident.evidence.segmentation import grain

BLOCKS = 300  # a run, at most
LEAST_BLOCKS = 24
SAMPLES = 4  # a block, at least


@dataclass(frozen=True)
class Trace:
    """A run in blocks, its mean and trend taken off. m blocks."""

    direction: int
    position: FloatArray  # (m,) [rad]
    torque: FloatArray  # (m,) [N m]
    smooth: FloatArray  # (m, 2) orthonormal: what mean and trend span [-]
    stride: float  # travel of a block [rad]
    grain: float = 0.0  # what the position cannot resolve [rad]

    @property
    def travel(self) -> float:
        """[rad]."""
        return float(np.ptp(self.position))

    def waves(self, wavenumber: FloatArray) -> FloatArray:
        """cos k q, sin k q less their mean and trend (m, 2, w), as block means."""
        phase = self.position[:, None] * wavenumber
        fading = np.sinc(0.5 * self.stride * wavenumber / np.pi)
        basis = np.stack([np.cos(phase), np.sin(phase)], axis=1) * fading
        return np.asarray(
            basis - np.einsum("ms,sxw->mxw", self.smooth, np.einsum("ms,mxw->sxw", self.smooth, basis))
        )


def traces_of(
    recordings: Sequence[Recording], runs: Sequence[SteadyRun], inertia: float | None
) -> tuple[Trace, ...]:
    """The used runs in blocks, those that are too short left out."""
    by_name = {recording.log: recording for recording in recordings}
    slopes = _slopes(runs)
    found = [
        trace(by_name[run.log], run, inertia=inertia, slope=slope)
        for run, slope in zip(runs, slopes, strict=True)
        if run.why is None
    ]
    return tuple(own for own in found if own is not None)


def _slopes(runs: Sequence[SteadyRun]) -> FloatArray:
    """The law's slope at each run (n,) [N m s/rad], roughly: from the runs next to it in speed."""
    slopes = np.zeros(len(runs))
    for direction in (1, -1):
        own = [n for n, run in enumerate(runs) if run.why is None and run.direction == direction]
        own.sort(key=lambda n: abs(runs[n].velocity))
        speed = np.array([abs(runs[n].velocity) for n in own])
        torque = np.array([abs(runs[n].torque) for n in own])
        for place, n in enumerate(own):
            low, high = max(place - 1, 0), min(place + 1, len(own) - 1)
            if speed[high] > 1.1 * speed[low]:
                slopes[n] = (torque[high] - torque[low]) / (speed[high] - speed[low])
    return slopes


def trace(recording: Recording, run: SteadyRun, *, inertia: float | None, slope: float = 0.0) -> Trace | None:
    """A steady run in blocks; None where it is too short. `slope` is the law's there [N m s/rad]."""
    first, past = np.searchsorted(recording.time, [run.start_time, run.end_time])
    size = int(past - first)
    blocks = min(BLOCKS, size // SAMPLES)
    if blocks < LEAST_BLOCKS or run.travel == 0.0:
        return None
    each = size // blocks
    kept = slice(int(first), int(first) + blocks * each)
    position = recording.position[kept].reshape(blocks, each).mean(axis=1)
    torque = recording.torque[kept].reshape(blocks, each).mean(axis=1)[1:-1]
    index = np.arange(blocks - 2, dtype=np.float64)
    smooth, _ = np.linalg.qr(np.column_stack([np.ones_like(index), index]))
    torque = torque - smooth @ (smooth.T @ torque)
    if inertia is not None:
        span = each * recording.sample_period
        swaying = 0.5 * (position[2:] - position[:-2]) / span
        driven = torque - inertia * np.diff(position, 2) / span**2 - slope * swaying
        driven = driven - smooth @ (smooth.T @ driven)
        # An acceleration that is mostly rounding would only hide what is there.
        torque = driven if np.var(driven) < 1.5 * np.var(torque) else torque
    return Trace(
        run.direction, position[1:-1], torque, np.asarray(smooth), run.travel / blocks, grain(recording)
    )

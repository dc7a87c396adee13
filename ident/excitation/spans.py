"""An excitation log cut into spans that can be filtered: evenly sampled, without a gap.

A zero-phase filter smears whatever it meets over its own length, so it must never run across lost samples.
Samples whose torque is not the one that acted (saturation) stay in their span, since the filter needs the
motion around them, and are marked.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from data.recording import FloatArray, Recording
from data.screening.clock import GAP
from data.screening.torque import AT_LIMIT

JITTER = 0.01  # of a step, below which samples count as evenly spaced
FEWEST = 64  # samples of a span


@dataclass(frozen=True)
class Span:
    """Evenly sampled signals (n,) without a gap."""

    log: str
    period: float  # h [s]
    position: FloatArray  # [rad]
    torque: FloatArray  # [N m]
    reference: FloatArray | None  # q_r [rad]
    saturated: NDArray[np.bool_]  # the logged torque is not the one that acted
    resolution: float | None  # one count [rad]

    @property
    def duration(self) -> float:
        """[s]."""
        return self.position.size * self.period


def spans(recording: Recording) -> tuple[Span, ...]:
    """The log without its gaps; stretches of under 64 samples are left out."""
    period = recording.sample_period
    breaks = np.flatnonzero(np.diff(recording.time) > GAP * period) + 1
    bounds = [0, *breaks.tolist(), recording.time.size]
    pieces = (_span(recording, a, b, period) for a, b in pairwise(bounds) if b - a >= FEWEST)
    return tuple(pieces)


def _span(recording: Recording, first: int, past: int, period: float) -> Span:
    time = recording.time[first:past]
    position, torque = recording.position[first:past], recording.torque[first:past]
    reference = None if recording.reference is None else recording.reference[first:past]
    saturated = _saturated(recording)[first:past]
    own = float(time[-1] - time[0]) / (time.size - 1)  # a clock may drift; a span has its own mean step
    even = time[0] + own * np.arange(time.size)
    if np.max(np.abs(time - even)) > JITTER * period:
        position = np.asarray(CubicSpline(time, position)(even))  # a line between samples has no acceleration
        torque = np.interp(even, time, torque)
        reference = None if reference is None else np.interp(even, time, reference)
        saturated = np.interp(even, time, saturated.astype(np.float64)) > 0.0
    return Span(recording.log, own, position, torque, reference, saturated, recording.resolution)


def _saturated(recording: Recording) -> NDArray[np.bool_]:
    """Samples at the torque's limit: the declared one, or the flat top that the screening found."""
    limit = np.inf if recording.torque_limit is None else recording.torque_limit
    return np.asarray(np.abs(recording.torque) >= AT_LIMIT * limit)

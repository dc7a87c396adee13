"""Signals of different topics brought onto one clock.

The position's stamps are the run's clock. A signal that was sampled with it (as many messages, each within
half a sample of the position's) is taken message by message. Anything else is a value that holds until its
next message, as a command or a reference does: at each position sample the last message before it counts.
Positions before a signal's first message have no value of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]


@dataclass(frozen=True)
class Aligned:
    """A signal at the position's stamps."""

    values: FloatArray  # (n,) [as logged]; NaN before its first message
    together: bool  # sampled with the position, message by message
    longest_hold: float  # [s] the longest time that a value stood in for newer ones


def align(clock: TimeArray, stamp: TimeArray, values: FloatArray) -> Aligned:
    """Bring values (m,) stamped (m,) [ns] onto the stamps `clock` (n,) [ns]."""
    if clock.shape == stamp.shape:
        half = 0.5 * float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
        if np.all(np.abs(clock - stamp) <= half):
            return Aligned(values, together=True, longest_hold=0.0)
    order = np.argsort(stamp, kind="stable")
    last = np.searchsorted(stamp[order], clock, side="right") - 1
    held = np.where(last >= 0, values[order][np.maximum(last, 0)], np.nan)
    age = np.where(last >= 0, clock - stamp[order][np.maximum(last, 0)], 0)
    return Aligned(held, together=False, longest_hold=float(age.max()) * 1e-9 if age.size else 0.0)

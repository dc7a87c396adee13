"""What a row of stamps says of the clock that made them: rate, jitter, gaps, and whether it runs at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
GAP: Final = 3.0  # median steps
_SHOWN_GAPS: Final = 5


@dataclass(frozen=True)
class ClockReport:
    """One clock over one run."""

    samples: int
    start: float  # [s] as logged
    duration: float  # [s]
    period: float  # [s] median step; 0 for fewer than two samples
    jitter: float  # [s] half the width that holds the middle 95 % of the steps
    gaps: int  # steps of over three medians
    longest_gaps: tuple[tuple[float, float], ...]  # (at [s] from the start, length [s]), the longest first
    stalls: int  # steps of zero or backwards
    first_stall: float | None  # [s] from the start

    @property
    def rate(self) -> float:
        """[Hz]; 0 where there is none."""
        return 1.0 / self.period if self.period > 0.0 else 0.0


def clock_report(seconds: FloatArray, *, start: float = 0.0, steps: FloatArray | None = None) -> ClockReport:
    """Describe stamps (n,) [s] counted from `start` [s], in the order of the file.

    `steps` (n - 1,) [s] between them, where they are known more exactly than the stamps tell.
    """
    step = np.diff(seconds) if steps is None else steps
    if not step.size:
        return ClockReport(int(seconds.size), start, 0.0, 0.0, 0.0, 0, (), 0, None)
    median = float(np.median(step))
    low, high = (float(q) for q in np.percentile(step, (2.5, 97.5)))
    wide = np.flatnonzero(step > GAP * median) if median > 0.0 else np.zeros(0, np.intp)
    longest = wide[np.argsort(-step[wide], kind="stable")][:_SHOWN_GAPS]
    stalls = np.flatnonzero(step <= 0.0)
    return ClockReport(
        samples=int(seconds.size),
        start=start + float(seconds[0]),
        duration=float(seconds.max() - seconds.min()),
        period=max(median, 0.0),
        jitter=0.5 * (high - low),
        gaps=int(wide.size),
        longest_gaps=tuple((float(seconds[k] - seconds[0]), float(step[k])) for k in longest),
        stalls=int(stalls.size),
        first_stall=float(seconds[stalls[0]] - seconds[0]) if stalls.size else None,
    )


def clock_report_ns(stamps: NDArray[np.int64]) -> ClockReport:
    """Describe stamps (n,) [ns]; differences are taken before they become floats."""
    first = int(stamps[0]) if stamps.size else 0
    return clock_report((stamps - first) / 1e9, start=first * 1e-9, steps=np.diff(stamps) / 1e9)

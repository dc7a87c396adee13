"""What a row of stamps says of the clock that made them: rate, jitter, gaps, and whether it runs at all.

A clock should advance from sample to sample. Where it does not, one of three things has happened:

- A sample came late: its stamp fills a hole that earlier stamps left. The samples are sorted by their stamps.
- A stamp is wrong (it repeats the last one, or was never set), and the next ones go on as if it had advanced:
  the instant of that sample is not known, and it is left out.
- The clock was set back, or stood still: how long the motion took across it is not known, and the run is
  taken apart there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.intp]
GAP: Final = 3.0  # median steps
HOLE: Final = 0.6  # of its share of median steps that a late sample needs between its neighbours
GOES_ON: Final = 0.5  # median steps by which stamps on both sides of a wrong one may miss their distance
DRIFT: Final = 5e-4  # of the time by which two clocks drift apart: more than a network slews them by
DRIFTED: Final = 5.0  # times the jitter between two clocks, that their drift over a run has to be
STILL: Final = 1e-6  # median steps: rounding lets a clock that stands still advance by as little
BETWEEN: Final = 10.0  # median steps put between two parts of a run: a gap to everyone who looks for one
_SHOWN_GAPS: Final = 5
_LOOK_AHEAD: Final = 1024  # samples in which the end of a part is looked for first


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


@dataclass(frozen=True)
class Advancing:
    """The samples of a run in an order in which time advances, and what that took."""

    kept: IndexArray  # (m,) samples, in order
    time: FloatArray  # (m,) strictly increasing [s]; counted on over a break, whose length is not known
    breaks: tuple[int, ...]  # places in `kept` at which a new part begins
    late: int  # samples that were sorted in
    wrong: int  # samples left out since their stamps say nothing
    short: int  # samples left out since their part is too short
    first: tuple[int, float] | None  # the first sample whose stamp does not advance, and its step [s]


def advancing(seconds: FloatArray, *, fewest: int) -> Advancing:
    """Make stamps (n,) [s] advance; parts of under `fewest` samples are left out, and none may be left."""
    step = np.diff(seconds)
    every = np.arange(seconds.size)
    median = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 0.0
    bad = np.flatnonzero(step <= STILL * median)
    if not bad.size:
        return Advancing(every, seconds, (), 0, 0, 0, None)
    if median == 0.0:
        return Advancing(every[:0], seconds[:0], (), 0, 0, seconds.size, (1, float(step[0])))
    sound = every[~_wrong(seconds, median)]
    parts, late = _parts(seconds[sound], median)
    long = [sound[part] for part in parts if part.size >= fewest]
    times: list[FloatArray] = []
    for part in long:
        shift = float(times[-1][-1] + BETWEEN * median - seconds[part[0]]) if times else 0.0
        times.append(seconds[part] + shift)
    sizes = [part.size for part in long]
    return Advancing(
        kept=np.concatenate(long) if long else every[:0],
        time=np.concatenate(times) if times else seconds[:0],
        breaks=tuple(int(place) for place in np.cumsum(sizes)[:-1]),
        late=late,
        wrong=seconds.size - sound.size,
        short=sound.size - sum(sizes),
        first=(int(bad[0]) + 1, float(step[bad[0]])),
    )


def _wrong(seconds: FloatArray, median: float) -> NDArray[np.bool_]:
    """Single stamps (n,) out of turn, between two that are as far apart as if it were not.

    One that has a place of its own among the others came late, or early.
    """
    wrong = np.zeros(seconds.size, np.bool_)
    around = seconds[2:] - seconds[:-2]
    out = (seconds[1:-1] <= seconds[:-2]) | (seconds[1:-1] >= seconds[2:])
    fits = np.abs(around - 2.0 * median) <= GOES_ON * median
    inside = (seconds > seconds.min()) & (seconds < seconds.max())
    placed = inside & (_apart(seconds) >= GOES_ON * median)
    wrong[1:-1] = out & fits & ~placed[1:-1]
    return wrong


def _apart(seconds: FloatArray) -> FloatArray:
    """How far the nearest other of stamps (n,) [s] is from each [s]."""
    order = np.argsort(seconds, kind="stable")
    steps = np.diff(seconds[order], prepend=-np.inf, append=np.inf)
    apart = np.empty(seconds.size)
    apart[order] = np.minimum(steps[:-1], steps[1:])
    return apart


def _parts(seconds: FloatArray, median: float) -> tuple[list[IndexArray], int]:
    """Samples of each part of stamps (n,) [s], in the order of their stamps, and how many came late."""
    parts: list[IndexArray] = []
    begin, late = 0, 0
    while begin < seconds.size:
        reach = _LOOK_AHEAD
        size, own = _advance(seconds[begin : begin + reach], median)
        while size == reach and begin + reach < seconds.size:
            reach *= 4
            size, own = _advance(seconds[begin : begin + reach], median)
        parts.append(begin + np.argsort(seconds[begin : begin + size], kind="stable"))
        begin, late = begin + size, late + own
    return parts, late


def _advance(seconds: FloatArray, median: float) -> tuple[int, int]:
    """How many of the stamps (n,) [s] advance once those that came late are sorted in, and how many did."""
    highest = np.maximum.accumulate(seconds)
    advances = seconds[1:] > highest[:-1] + STILL * median
    behind = np.flatnonzero(~advances) + 1
    if not behind.size:
        return seconds.size, 0
    ahead = seconds[np.concatenate(([True], advances))]
    place = np.searchsorted(ahead, seconds[behind])
    inside = (place > 0) & (place < ahead.size)
    above, below = ahead[np.minimum(place, ahead.size - 1)], ahead[np.maximum(place, 1) - 1]
    _, hole, sharers = np.unique(place, return_inverse=True, return_counts=True)
    fills = inside & (above - below >= HOLE * (sharers[hole] + 1) * median)
    fills &= (above - seconds[behind] > STILL * median) & (_apart(seconds[behind]) > STILL * median)
    if fills.all():
        return seconds.size, int(behind.size)
    first = int(np.argmin(fills))
    return int(behind[first]), first


@dataclass(frozen=True)
class Drift:
    """How two clocks that stamped the same samples run apart."""

    rate: float  # of the second against the first, per second of the first [-]
    total: float  # over the run [s]


def drift(first: FloatArray, second: FloatArray) -> Drift | None:
    """How the second of two clocks (n,) [s] drifts from the first; None where it is not clear of its jitter.

    Delays between the two jitter, in one direction mostly: the medians of the first and the last fifth of
    the run are compared.
    """
    fifth = first.size // 5
    duration = float(first[-1] - first[0]) if first.size else 0.0
    if fifth < 2 or duration <= 0.0:
        return None
    ahead = second - first
    begin, end = slice(0, fifth), slice(first.size - fifth, None)
    apart = float(np.median(first[end]) - np.median(first[begin]))
    if apart <= 0.0:
        return None
    rate = float(np.median(ahead[end]) - np.median(ahead[begin])) / apart
    left = ahead - rate * first
    jitter = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    period = float(np.median(np.diff(first)))
    clear = abs(rate) * duration > DRIFTED * max(jitter, period)
    return Drift(rate, rate * duration) if abs(rate) > DRIFT and clear else None

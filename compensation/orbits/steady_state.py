"""Equilibrium or limit cycle, from positions over time alone, simulated or recorded.

A record says three things at most: that the link came to rest, that it goes on turning in the same way,
or neither. What counts as the same is measured in the record's own noise: encoder counts, and the
scatter that remains after smoothing. Turns are counted by a hysteresis wider than that noise, so that
counts that flicker at rest are no cycle, and a cycle of ten counts is one.

- Rest: the position stays within the noise of its last value, for at least `REST_SHARE` of the record
  and clearly longer than any pause or half turn seen before (a limit cycle may stick in every turn).
- Limit cycle: at least two full turns at the end repeat, in both extremes; where more turns are recorded,
  the amplitude must have no trend. Between two turns only a small change is allowed, since a slow decay
  changes little from turn to turn.
- Undecided: all else, with a sentence why.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray, Signs

Verdict = Literal["equilibrium", "limit_cycle", "undecided"]

FEWEST_SAMPLES: Final = 20
REST_SHARE: Final = 0.12  # of the record that a rest must last
REST_PAUSES: Final = 1.5  # times the longest half turn before
SMOOTHED_PARTS: Final = 1000  # a record with noise is averaged over this part of its samples
NOISE_WIDTH: Final = 8.0  # standard deviations of smoothed noise that are no motion
COUNTS: Final = 2.0  # encoder counts that are no motion
ROUNDING: Final = 1e-8  # of the largest position, that are no motion in an exact record
SAME_TURN: Final = 0.06  # relative spread of the amplitudes of turns that repeat
SAME_AS_LAST: Final = 0.02  # relative change between the last two turns
TREND: Final = 0.003  # relative change a turn that is a trend, where significant


@dataclass(frozen=True)
class SteadyState:
    """Where a trajectory ends up. What a verdict does not have is None."""

    verdict: Verdict
    position_error: float | None  # [rad] rest position - reference
    amplitude: float | None  # [rad] max|q - reference| over the last period
    period: float | None  # [s]
    why: str


def classify(
    time: ArrayLike, position: ArrayLike, *, reference: float = 0.0, resolution: float = 0.0
) -> SteadyState:
    """Verdict on a record: `time` (n,) [s], ascending, even or not; `position` (n,) [rad].

    `resolution` is one encoder count [rad]; 0 where unknown or continuous (counts are then recognised).
    Samples that are not finite are left out. Raises `ValueError` for what is no number, or times that run
    backwards.
    """
    t, q = _samples("time", time), _samples("position", position)
    if not (math.isfinite(reference) and 0.0 <= resolution < math.inf):
        raise ValueError(
            f"reference is {reference} rad, resolution {resolution} rad: finite, resolution >= 0 (figure 9)"
        )
    if t.ndim != 1 or t.shape != q.shape:
        return _undecided(f"{t.size} times and {q.size} positions do not belong together")
    finite = np.isfinite(t) & np.isfinite(q)
    t, error = t[finite], q[finite] - reference
    backwards = np.flatnonzero(np.diff(t) < 0.0)
    if backwards.size:
        before, after = t[backwards[0] : backwards[0] + 2]
        raise ValueError(f"time must ascend: {after:g} s follows {before:g} s (periods of figure 9)")
    if t.size < FEWEST_SAMPLES or not t[-1] > t[0]:
        return _undecided(f"too short: {t.size} samples, at least {FEWEST_SAMPLES} are needed")
    smooth, band = _without_noise(error, resolution)
    turns = _Turns.of(t, smooth, band)
    return _rest(t, smooth, band, turns) or _cycle(t, error, smooth, band, turns)


def _samples(name: str, values: ArrayLike) -> FloatArray:
    found = np.asarray(values)
    if found.dtype.kind not in "fiu":
        raise ValueError(f"{name} holds {found.dtype} values: real numbers (x1 over time, figure 9)")
    return found.astype(np.float64, copy=False)


def _undecided(why: str) -> SteadyState:
    return SteadyState("undecided", None, None, None, why)


def _without_noise(error: FloatArray, resolution: float) -> tuple[FloatArray, float]:
    """Positions smoothed as far as they are noisy, and the width [rad] of what is no motion in them."""
    counts = max(resolution, _recognised_count(error))
    noise = _scatter(error)
    width = max(1, error.size // SMOOTHED_PARTS) if noise > 0.2 * counts and noise > 0 else 1
    smooth = _moving_mean(error, width)
    band = COUNTS * counts + NOISE_WIDTH * noise / math.sqrt(width) * (width > 1 or counts == 0.0)
    return smooth, max(band, ROUNDING * float(np.max(np.abs(error))))


def _recognised_count(error: FloatArray) -> float:
    """The count of a quantised record whose resolution was not told, else 0."""
    values = np.unique(error)
    if values.size < 3 or values.size > error.size // 4:
        return 0.0
    gaps = np.diff(values)
    count = float(gaps.min())
    spread = float(values[-1] - values[0])
    if count < 1e-9 * spread:
        return 0.0
    multiples = gaps / count
    return count if float(np.max(np.abs(multiples - np.round(multiples)))) < 0.05 else 0.0


def _scatter(error: FloatArray) -> float:
    """Standard deviation [rad] of white noise that the record can hold: the least over orders of differences.

    Differencing k times leaves white noise with the variance binomial(2k, k) and takes away what is smooth.
    """
    least = math.inf
    differences = error
    for order in range(1, 5):
        differences = np.diff(differences)
        middle = float(np.median(np.abs(differences)))
        least = min(least, middle / 0.6745 / math.sqrt(math.comb(2 * order, order)))
    return least


def _moving_mean(values: FloatArray, width: int) -> FloatArray:
    if width <= 1:
        return values
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    sums = np.cumsum(np.concatenate([[0.0], padded]))
    mean: FloatArray = (sums[width:] - sums[:-width]) / width
    return mean


@compiled
def _turning_points(values: FloatArray, band: float, at: Signs) -> int:
    """Indices of alternating extremes more than `band` apart, into `at`; returns how many.

    The last one is only what was reached so far.
    """
    found = 0
    low = high = 0
    direction = 0
    for i in range(values.size):
        if values[i] > values[high]:
            high = i
        if values[i] < values[low]:
            low = i
        if direction >= 0 and values[high] - values[i] > band:
            at[found] = high
            found += 1
            direction, low = -1, i
            high = i
        elif direction <= 0 and values[i] - values[low] > band:
            at[found] = low
            found += 1
            direction, high = 1, i
            low = i
    return found


@dataclass(frozen=True)
class _Turns:
    """The extremes that alternate in a record, the very start left out."""

    time: FloatArray  # (k,) [s]
    value: FloatArray  # (k,) [rad]

    @classmethod
    def of(cls, time: FloatArray, smooth: FloatArray, band: float) -> _Turns:
        at = np.empty(smooth.size, np.int64)
        found = _turning_points(smooth, band, at)
        where = at[:found]
        where = where[where > 0]
        return cls(time[where], smooth[where])

    @property
    def longest_half(self) -> float:
        """[s] between successive extremes, 0 where there are not two."""
        return float(np.max(np.diff(self.time))) if self.time.size > 1 else 0.0


def _rest(t: FloatArray, smooth: FloatArray, band: float, turns: _Turns) -> SteadyState | None:
    last = t[-1] - 0.5 * REST_SHARE * (t[-1] - t[0])
    place = float(np.median(smooth[t >= last]))
    away = np.flatnonzero(np.abs(smooth - place) > band)
    since = float(t[away[-1]]) if away.size else float(t[0])
    lasted = float(t[-1]) - since
    needed = max(REST_SHARE * float(t[-1] - t[0]), REST_PAUSES * turns.longest_half)
    if lasted < needed:
        return None
    place = float(np.median(smooth[t >= since + 0.2 * lasted]))
    return SteadyState("equilibrium", place, None, None, f"at rest for the last {lasted:.3g} s")


def _cycle(t: FloatArray, error: FloatArray, smooth: FloatArray, band: float, turns: _Turns) -> SteadyState:
    if turns.time.size < 4:
        return _too_few_turns(t, error, band, turns)
    tops, bottoms = turns.value[-1::-2][::-1], turns.value[-2::-2][::-1]
    pairs = min(tops.size, bottoms.size)
    first, second = tops[-pairs:], bottoms[-pairs:]
    half_widths = 0.5 * np.abs(first - second)
    middles = 0.5 * (first + second)
    last = float(np.median(half_widths[-3:]))
    noise = band / last
    same = np.abs(half_widths - last) <= (SAME_TURN + noise) * last
    same &= np.abs(middles - np.median(middles[-3:])) <= (SAME_TURN + noise) * last
    settled = int(pairs - 1 - np.flatnonzero(~same)[-1]) if not np.all(same) else pairs
    change = float(half_widths[-1] - half_widths[-2]) / last
    if settled < 2:
        return _undecided(f"turns do not repeat: amplitude changed by {change:+.1%} in the last turn")
    trend, certain = _trend(half_widths[-settled:] / last)
    word = "growing" if trend > 0 else "decaying"
    if settled >= 4 and abs(trend) > TREND and certain:
        return _undecided(f"still {word}: amplitude changes by {trend:+.1%} a turn over {settled} turns")
    if settled < 4 and abs(change) > SAME_AS_LAST + 0.5 * noise:
        return _undecided(f"still {word}: amplitude changed by {change:+.1%} in the last turn")
    drift, certain = _trend(middles[-settled:] / last)
    if settled >= 4 and abs(drift) > TREND and certain:
        return _undecided(f"drifting: the middle moves by {drift * last:.3g} rad a turn")
    period = _period(t, smooth, turns.time[-2 * settled :], float(np.median(middles[-settled:])))
    amplitude = float(np.max(np.abs(error[t >= t[-1] - period])))
    return SteadyState(
        "limit_cycle", None, amplitude, period, f"{settled} turns of {period:.3g} s repeat at the end"
    )


def _too_few_turns(t: FloatArray, error: FloatArray, band: float, turns: _Turns) -> SteadyState:
    if turns.time.size > 1:
        return _undecided(f"too short: {turns.time.size / 2:g} turns in {t[-1] - t[0]:.3g} s, and no rest")
    tail = error[t >= t[-1] - REST_SHARE * (t[-1] - t[0])]
    moved = float(np.ptp(tail))
    if moved > band:
        return _undecided(f"drifting: moved {moved:.3g} rad in the last {REST_SHARE:.0%} of the record")
    return _undecided("too short: came to rest too shortly before the end")


def _trend(values: FloatArray) -> tuple[float, bool]:
    """Slope a turn, and whether it stands out of the scatter by three standard errors."""
    n = values.size
    if n < 3:
        return float(values[-1] - values[0]) / max(1, n - 1), False
    x = np.arange(n) - 0.5 * (n - 1)
    slope = float(x @ values / (x @ x))
    rest = values - values.mean() - slope * x
    stderr = math.sqrt(float(rest @ rest) / (n - 2) / float(x @ x))
    return slope, abs(slope) > 3.0 * stderr


def _period(t: FloatArray, smooth: FloatArray, extremes: FloatArray, middle: float) -> float:
    """Mean time of a full turn, between passages through the middle: extremes may be long and flat.

    `extremes` (2 k,) are the times of those of the settled turns, tops and bottoms in turn.
    """
    passages = []
    for begin, end in itertools.pairwise(extremes):
        inside = np.flatnonzero((t >= begin) & (t <= end))
        rises = smooth[inside[-1]] > smooth[inside[0]]
        beyond = smooth[inside] >= middle if rises else smooth[inside] <= middle
        passages.append(t[inside[int(np.argmax(beyond))]])
    times = np.array(passages)
    return float(np.mean(times[2:] - times[:-2])) if times.size > 2 else 2.0 * float(times[-1] - times[0])

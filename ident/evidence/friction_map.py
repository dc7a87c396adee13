"""Recordings into points of the friction map: torque against velocity, each with its standard error.

At constant speed eq (1) leaves u = b v + F(v): the mean torque of a steady run is the friction at the run's
speed. The speed is the slope of the position over the run, never the mean of differences: with 2000 counts
a revolution at 1 kHz, 99.7 % of the differences at 0.01 rad/s are zero. What little the speed still
changes within the run is taken off as J times the slope of the speed, once J is known.

A run is one datum however many samples it has, since neighbouring samples share the ripple and the speed
loop's hunting. Its own few blocks cannot tell its error either: that comes from a variance model pooled
over all runs (`ident.fit.variance_model`), for which each run hands on the white part of its noise.

What a run has to survive:

- E-QUANT: it must travel 20 counts, or its speed is the encoder's rounding;
- E-STEADY: run-in and run-out are cut off, and what is left of a speed that drifts is its calmest part;
  under half left, the run is left out;
- E-SAT: with the torque at its limit in over 2 % of it, it is not what held the speed;
- E-STICKSLIP: with the link at rest in over 2 % of it, its mean torque is not the friction at its mean speed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.protocols import ProtocolName
from data.recording import FloatArray, Recording
from ident.evidence.hunting import Swing, swing
from ident.evidence.segmentation import AT_LIMIT, Stretch, grain, plateaus, rests, stretches

LEAST_COUNTS = 20.0
BLOCKS = 20  # a window is judged in twentieths
STILL_SHARE = 0.02
TINY = float(np.finfo(np.float64).tiny)
RESOLVED_COUNTS = 6.0  # travel that tells motion from rest
KEPT = 0.8  # part of a run that is left, below which its trimming is told
LEAST_KEPT = 0.5
SPEED_DRIFT = 0.03  # part of the speed by which it may change over a run
TORQUE_DRIFT = 0.25  # part of the torque: a place may change it by as much
CLEAR = 5.0  # standard errors of a slope that is one
STRAIGHT = 0.8  # part of the way between two rests that a constant speed makes at least
LIMITED_SHARE = 0.02
ROUNDED = 3.0  # counts that two roundings and a slope through few counts may err by


@dataclass(frozen=True)
class MapPoint:
    """One point of the friction map, or the run that gave none and why; a row of friction_map.csv."""

    log: str
    protocol: ProtocolName
    direction: int  # +1 or -1
    velocity: float  # signed [rad/s]; 0 for a breakaway
    torque: float  # signed [N m], as logged less inertia times acceleration; of a breakaway at its onset
    fitted: float | None  # what the law is fitted to: at zero ramp rate, without offset [N m]; None if unused
    stderr: float | None  # of the torque [N m]
    velocity_stderr: float | None  # [rad/s]
    ramp_rate: float | None  # signed [N m/s], breakaway only
    start_time: float  # [s] from the log's first sample
    end_time: float  # [s]
    used: bool
    why: str | None = None


@dataclass(frozen=True)
class SteadyRun:
    """A stretch of constant speed. Signs are those of the log."""

    log: str
    velocity: float  # [rad/s]
    velocity_stderr: float  # [rad/s]
    torque: float  # mean as logged [N m]
    acceleration: float  # slope of the speed [rad/s^2]
    white_stderr: float  # of the mean torque, were the samples' scatter all [N m]
    block_ratio: float  # variance of block means over what white scatter gives them [-]
    travel: float  # [rad], > 0
    swing: Swing  # of the torque within the run
    start_time: float  # [s]
    end_time: float  # [s]
    why: str | None = None  # why it is left out, beginning with its code
    place_stderr: float = 0.0  # of the mean torque, from what varies with position [N m]
    trimmed: str | None = None  # what was cut off of a run that is used, beginning with its code
    momentum_variance: float = 0.0  # that a hunting speed loop gives within the run [(N m s)^2]
    torque_change: float = math.nan  # from end to end of the run, along a line; NaN if unknown [N m]
    scatter: float = math.inf  # standard deviation of the torque within the run; infinite if unknown [N m]

    @property
    def direction(self) -> int:
        """+1 or -1."""
        return 1 if self.velocity > 0 else -1


def steady_runs(recording: Recording) -> tuple[SteadyRun, ...]:
    """Every plateau of a constant-velocity log, those that are left out included, in order of time."""
    chain = stretches(recording)
    still = rests(recording, chain)
    steps = plateaus(recording, chain)
    if not steps:
        return (_nothing_moved(recording),)
    if _sticks_and_slips(recording, still, steps):
        whole = Stretch(
            0, recording.time.size, recording.duration, _travel(recording, 0, recording.time.size)
        )
        share = sum(rest.duration for rest in still) / recording.duration
        return (
            replace(
                _measure(recording, whole),
                why=f"E-STICKSLIP: the link rests {len(still)} times, in {100 * share:.0f} % of the log, "
                "between "
                "slips: the mean torque is not the friction at the mean speed. Raise the speed or the speed "
                "loop's damping.",
            ),
        )
    steps = tuple(_without_bends(recording, steps))
    if len(steps) == 1:  # then all motion of the log was meant as this speed
        resting = sum(rest.last - rest.first for rest in still)
        return (_steady_run(recording, steps[0], meant=recording.time.size - resting),)
    return tuple(_steady_run(recording, step, meant=step.last - step.first) for step in steps)


def _without_bends(recording: Recording, steps: Sequence[Stretch]) -> list[Stretch]:
    """Neighbours between which the speed bends and does not jump are one run whose speed drifts."""
    joined: list[Stretch] = []
    for step in steps:
        last = joined[-1] if joined else None
        if last is not None and last.last == step.first and last.travel * step.travel > 0.0:
            (_, before), (after, _) = _end_speeds(recording, last), _end_speeds(recording, step)
            if abs(after - before) < 0.5 * abs(step.velocity - last.velocity):
                joined[-1] = Stretch(
                    last.first, step.last, last.duration + step.duration, last.travel + step.travel
                )
                continue
        joined.append(step)
    return joined


def _end_speeds(recording: Recording, step: Stretch) -> tuple[float, float]:
    """Speeds at the two ends of a step [rad/s], were they a line in time."""
    middle = (step.first + step.last) // 2
    end = min(step.last, recording.time.size - 1)
    first, second = (
        _travel(recording, a, b) / max(float(recording.time[b] - recording.time[a]), TINY)
        for a, b in ((step.first, middle), (middle, end))
    )
    return first - 0.5 * (second - first), second + 0.5 * (second - first)


def _too_few(counts: float) -> str:
    return (
        f"E-QUANT: {counts:.1f} counts of travel, under {LEAST_COUNTS:.0f}: the speed is the encoder's "
        "rounding. Record it for longer."
    )


def _steady_run(recording: Recording, step: Stretch, *, meant: int) -> SteadyRun:
    """A step as a run, `meant` the number of samples that were to be of its speed."""
    counts = abs(step.travel) / grain(recording)
    if counts < LEAST_COUNTS:
        return replace(_measure(recording, step), why=_too_few(counts))
    share = _share_at_rest(recording, step)
    if share > STILL_SHARE:
        return replace(
            _measure(recording, step),
            why=f"E-STICKSLIP: the link is at rest in {100 * share:.0f} % of the run: its mean torque is "
            "not the friction at its mean speed. Raise the speed or the speed loop's damping.",
        )
    window = _steady_window(recording, step)
    left = (window.last - window.first) / (step.last - step.first)
    run = _measure(recording, window)
    if left < LEAST_KEPT:
        return replace(
            run,
            why=f"E-STEADY: speed and torque are steady in only {100 * left:.0f} % of the run: its mean "
            "torque is not the friction at one speed. Record it for longer, or set `window` to its steady "
            "part.",
        )
    kept = abs(run.velocity) * (run.end_time - run.start_time) / grain(recording)
    if kept < LEAST_COUNTS:
        evenly = counts * (run.end_time - run.start_time) / step.duration
        if abs(kept - evenly) < ROUNDED:
            return replace(run, why=_too_few(kept))
        return replace(
            run,
            why=f"E-STICKSLIP: the link moves {kept:.1f} counts in the steady part of the run, from "
            f"{run.start_time:.3g} s to {run.end_time:.3g} s, and more outside it: it stops on the way, or "
            "its position was not updated. Record it again.",
        )
    limited = _share_at_limit(recording, window)
    if limited > LIMITED_SHARE:
        return replace(
            run,
            why=f"E-SAT: the torque is at its limit of {recording.torque_limit:.4g} in {100 * limited:.0f} % "
            "of the run: it is not what would hold the speed. Raise the limit, or run slower.",
        )
    left = (window.last - window.first) / meant
    if left > KEPT:
        return run
    text = (
        f"E-STEADY: speed and torque are steady in {100 * left:.0f} % of the run at {run.velocity:.3g} (from "
        f"{run.start_time:.3g} s to {run.end_time:.3g} s); the rest was cut off, or it would have biased the "
        "friction at this speed. Set `window` to say so."
    )
    return replace(run, trimmed=text)


def _share_at_limit(recording: Recording, window: Stretch) -> float:
    """Part of a window's samples at which the torque is at its limit; 0 where none is known."""
    if recording.torque_limit is None:
        return 0.0
    torque = np.abs(recording.torque[window.first : window.last])
    return float(np.mean(torque >= AT_LIMIT * recording.torque_limit))


def _measure(recording: Recording, window: Stretch) -> SteadyRun:
    """Speed, torque and their scatter over a window of a log."""
    part = slice(window.first, window.last)
    time, position, torque = recording.time[part], recording.position[part], recording.torque[part]
    centred = (time - time.mean()) / max(window.duration, recording.sample_period)
    # Legendre-like basis: the quadratic leaves the slope at the middle of the window untouched.
    basis = np.column_stack([np.ones_like(centred), centred, centred**2 - np.mean(centred**2)])
    offset = position - position[0]
    (_, slope, bend), *_ = np.linalg.lstsq(basis, offset, rcond=None)
    duration = max(window.duration, recording.sample_period)
    if time.size < 3:
        slope, bend = offset[-1], 0.0
    rounding = grain(recording) / duration * _rounding_share(recording, window)
    hunting = _slope_scatter(centred, offset - basis @ np.array([offset.mean(), slope, bend])) / duration
    bend_error = 12.0 * rounding / duration
    acceleration = 2.0 * bend / duration**2
    (_, change, _), *_ = np.linalg.lstsq(basis, torque, rcond=None)
    white_stderr, block_ratio = torque_scatter(torque)
    return SteadyRun(
        log=recording.log,
        velocity=float(slope / duration),
        velocity_stderr=float(np.hypot(rounding, hunting)),
        torque=float(torque.mean()),
        acceleration=float(acceleration) if abs(acceleration) > 2.0 * bend_error else 0.0,
        white_stderr=white_stderr,
        block_ratio=block_ratio,
        travel=abs(_travel(recording, window.first, window.last)),
        swing=swing(recording, window),
        start_time=float(time[0]),
        end_time=float(time[-1]),
        torque_change=float(change) if time.size >= 3 else math.nan,
        scatter=float(torque.std()),
    )


def _rounding_share(recording: Recording, window: Stretch) -> float:
    """Standard error that rounding gives a slope, in grains over the window.

    Over many counts the rounding is white: 1/sqrt(n) for n samples. Over few it is a sawtooth in step with
    the window, of which a part of one count is left; two roundings at the ends are the worst of all.
    """
    counts = abs(_travel(recording, window.first, window.last)) / grain(recording)
    samples = window.last - window.first
    return float(min(6.0**-0.5, np.hypot(1.5 / max(counts, 1.0), samples**-0.5)))


def _slope_scatter(centred: FloatArray, residual: FloatArray) -> float:
    """Standard error of a slope over one unit of time, from block means of the residual (n,)."""
    blocks = min(BLOCKS, residual.size // 2)
    if blocks < 4:
        return 0.0
    means = np.array([piece.mean() for piece in np.array_split(residual - residual.mean(), blocks)])
    middles = np.array([piece.mean() for piece in np.array_split(centred, blocks)])
    return float(np.sqrt(np.sum(means**2) / (blocks - 3) / np.sum(middles**2)))


def torque_scatter(torque: FloatArray) -> tuple[float, float]:
    """`white_stderr` [N m] and `block_ratio` of the torque (n,) [N m] of a steady run."""
    scatter = float(np.mean(np.diff(torque) ** 2)) / 2.0 if torque.size > 1 else 0.0
    white_stderr = float(np.sqrt(scatter / torque.size))
    blocks = min(BLOCKS, torque.size // 4)
    if blocks < 4 or scatter == 0.0:
        return white_stderr, 1.0
    means = np.array([piece.mean() for piece in np.array_split(torque, blocks)])
    return white_stderr, float(np.var(means, ddof=1) / (scatter * blocks / torque.size))


def _steady_window(recording: Recording, step: Stretch) -> Stretch:
    """The step without its run-in and run-out.

    A twentieth is cut at each end, where a corner's place is not exact; further blocks go as long as their
    speed or torque stands out from the middle half of the run.
    """
    edges = np.linspace(step.first, step.last, BLOCKS + 1).astype(int)
    if np.any(np.diff(edges) < 2):
        return step
    last = np.minimum(edges[1:], recording.time.size - 1)
    duration = recording.time[last] - recording.time[edges[:-1]]
    speed = (recording.position[last] - recording.position[edges[:-1]]) / duration
    torque = np.array([recording.torque[a:b].mean() for a, b in itertools.pairwise(edges)])
    middle = slice(BLOCKS // 4, BLOCKS - BLOCKS // 4)
    rounding = 2.0 * grain(recording) / duration
    tolerance = np.maximum(rounding, 0.05 * abs(float(np.median(speed[middle]))))
    odd = np.abs(speed - np.median(speed[middle])) > np.maximum(tolerance, 5.0 * _spread(speed[middle]))
    odd |= np.abs(torque - np.median(torque[middle])) > np.maximum(
        0.02 * abs(float(np.median(torque[middle]))), 5.0 * _spread(torque[middle])
    )
    start, end = 1, BLOCKS - 1
    while start < end and odd[start]:
        start += 1
    while end > start and odd[end - 1]:
        end -= 1
    drifting = ((speed, SPEED_DRIFT, float(np.median(rounding))), (torque, TORQUE_DRIFT, 0.0))
    for values, allowed, least in drifting:
        start, end = _calmest(values, start, end, allowed=allowed, error=least)
    first, past = int(edges[start]), int(edges[end])
    if past - first < 2:
        return Stretch(step.first, step.first + 2, float(duration[0]), 0.0)
    return Stretch(
        first,
        past,
        float(recording.time[min(past, recording.time.size - 1)] - recording.time[first]),
        _travel(recording, first, past),
    )


def _calmest(values: FloatArray, start: int, end: int, *, allowed: float, error: float) -> tuple[int, int]:
    """The longest part of blocks start to end (exclusive) over which a line through them changes by no more
    than `allowed` of its mean; all of them where the change is not clear of its error. `error` is a block's
    least.
    """

    def change(a: int, b: int) -> tuple[float, float]:
        number = np.arange(b - a) - 0.5 * (b - a - 1)
        own = values[a:b]
        slope = float(number @ own / (number @ number))
        left = own - own.mean() - slope * number
        scatter = max(float(np.sqrt(left @ left / max(b - a - 2, 1))), error)
        return abs(slope) * (b - a), scatter * (b - a) / float(np.sqrt(number @ number))

    if end - start < 4:
        return start, end
    most = allowed * abs(float(values[start:end].mean()))
    whole, unsure = change(start, end)
    if whole <= most or whole <= CLEAR * unsure:
        return start, end
    for size in range(end - start - 1, 1, -1):
        parts = [(change(a, a + size)[0], a) for a in range(start, end - size + 1)]
        least, a = min(parts)
        if least <= most:
            return a, a + size
    return start, start + 1


def _spread(values: FloatArray) -> float:
    """Standard deviation from the median absolute deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _share_at_rest(recording: Recording, step: Stretch) -> float:
    """Part of the step in which the link moves under a tenth of what its mean speed asks for.

    Judged over windows in which the mean speed covers six counts, so that counting is not taken for sticking.
    """
    time, position = recording.time[step.first : step.last], recording.position[step.first : step.last]
    expected = RESOLVED_COUNTS * grain(recording)
    windows = int(min(abs(step.travel) / expected, 2000, time.size // 2))
    if windows < 2:
        return 0.0
    edges = np.linspace(0, time.size - 1, windows + 1).astype(int)
    moved = np.abs(np.diff(position[edges]))
    asked = abs(step.velocity) * np.diff(time[edges])
    return float(np.mean(moved <= 0.1 * asked + grain(recording)))


def _sticks_and_slips(recording: Recording, still: tuple[Stretch, ...], steps: tuple[Stretch, ...]) -> bool:
    """Whether the log alternates between rests and slips of changing speed, always the same way.

    A staircase with rests has one straight stretch a span that is most of it; a slip is bent throughout, or
    in several parts.
    """
    moving_one_way = abs(sum(step.travel for step in steps)) > 0.9 * sum(abs(step.travel) for step in steps)
    if len(still) < 4 or not moving_one_way:
        return False
    bends = [_bend(recording, step) for step in steps]
    bent = len(steps) >= 2 * (len(still) - 1) and float(np.median(bends)) > 0.025
    largest = []
    for before, after in itertools.pairwise(still):
        slip = abs(_travel(recording, before.last, after.first))
        own = [abs(step.travel) for step in steps if before.last <= step.first and step.last <= after.first]
        largest.append(max(own, default=0.0) / max(slip, TINY))
    return bent or float(np.median(largest)) < STRAIGHT


def _bend(recording: Recording, step: Stretch) -> float:
    """Relative change of speed from the first half of a step to the second."""
    middle = (step.first + step.last) // 2
    first = _travel(recording, step.first, middle) / max(middle - step.first, 1)
    second = _travel(recording, middle, step.last) / max(step.last - middle, 1)
    return abs(second - first) / max(abs(first), abs(second), float(np.finfo(np.float64).tiny))


def _travel(recording: Recording, first: int, last: int) -> float:
    end = min(last, recording.time.size - 1)
    return float(recording.position[end] - recording.position[first])


def _nothing_moved(recording: Recording) -> SteadyRun:
    whole = Stretch(0, recording.time.size, recording.duration, 0.0)
    counts = (recording.position.max() - recording.position.min()) / grain(recording)
    return replace(
        _measure(recording, whole),
        why=f"E-QUANT: the link moves {counts:.1f} counts in the whole log: there is no speed to speak of.",
    )

"""A recorded motion cut into stretches of constant speed, and those into rest, plateau and transition.

A staircase of speeds spans three decades, so no window in time and no threshold in speed finds all of its
plateaus. In the (t, q) plane a plateau is a straight line whatever its slope, and a change of speed is a
corner: the Ramer-Douglas-Peucker polyline of the position finds the corners. A stretch is accepted as
straight when the position stays within a hundredth of the stretch's own travel of its chord (a speed that
changes by 8 % bends the chord by just that), or within the grain of the position where that is larger.

The grain is what the position cannot resolve: one encoder count, or the noise of an unquantised signal.
Every length below is in grains or in parts of the travel, every duration in samples or in parts of the run:
no number belongs to one rig.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray, Recording

MOST_KNOTS = 4000  # block means of the position that stand for a log, however long
BEND = 0.01  # largest deviation from the chord, in parts of the travel
REST_TRAVEL = 3.0  # grains that a link at rest may show
SLOW = 0.02  # part of the fastest speed of a breakaway log
AT_LIMIT = 0.99  # part of the torque limit, from which on the torque is at it
LEAST_SHARE = 0.2  # of the typical plateau's duration or travel: less is a transition


@dataclass(frozen=True)
class Stretch:
    """Samples first to last (exclusive) of a log, over which the position is a straight line."""

    first: int
    last: int
    duration: float  # [s]
    travel: float  # signed [rad]

    @property
    def velocity(self) -> float:
        """Slope of the chord [rad/s]."""
        return self.travel / self.duration


def grain(recording: Recording) -> float:
    """What the position of a log cannot resolve [rad]: a count, or its noise where that is larger.

    Where the encoder is not declared, a count is the smallest step that the position makes.
    """
    position = recording.position
    noise = (
        1.4826 * float(np.median(np.abs(np.diff(position, 2)))) / np.sqrt(6.0) if position.size > 2 else 0.0
    )
    if recording.resolution:
        return max(recording.resolution, 3.0 * noise)
    step = np.abs(np.diff(position))
    rounding = 1e-12 * float(np.max(np.abs(position), initial=0.0))
    step = step[step > rounding]
    count = float(np.percentile(step, 1.0)) if step.size else 0.0
    return max(count, 3.0 * noise, rounding, float(np.finfo(np.float64).tiny))


def stretches(recording: Recording) -> tuple[Stretch, ...]:
    """The log as a chain of straight stretches, in order, without gaps between them."""
    time, position = recording.time, recording.position
    block = max(1, -(-time.size // MOST_KNOTS))
    edges = np.append(np.arange(0, time.size - block + 1, block), time.size)
    weights = np.diff(edges)
    knot_time = np.add.reduceat(time, edges[:-1]) / weights
    knot_position = np.add.reduceat(position, edges[:-1]) / weights
    resolution = grain(recording)
    corners = _corners(knot_time, knot_position, 1.5 * resolution)
    corners = _without_weak_corners(knot_time, knot_position, corners, 1.5 * resolution)
    chain = []
    for start, end in itertools.pairwise(corners):
        first = int(edges[start]) if start else 0
        last = int(edges[end]) if end < knot_time.size - 1 else time.size
        chain.append(_stretch(recording, first, last))
    return tuple(chain)


def rests(recording: Recording, chain: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
    """Stretches in which the link does not move, neighbours joined."""
    still = REST_TRAVEL * grain(recording)
    found: list[Stretch] = []
    for piece in chain:
        if abs(piece.travel) > still or not _is_slow(piece, chain):
            continue
        if found and found[-1].last == piece.first:
            joined = _stretch(recording, found[-1].first, piece.last)
            if abs(joined.travel) <= 2.0 * still:
                found[-1] = joined
                continue
        found.append(piece)
    return tuple(found)


def slow_spans(recording: Recording, chain: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
    """Spans between sustained motions: rest and creep, slow against the fastest motion of the log.

    Pre-sliding covers many counts of a fine encoder, so rest is told from motion by speed and not by travel.
    """
    fastest = max(abs(piece.velocity) for piece in chain)
    found: list[Stretch] = []
    for piece in chain:
        if abs(piece.velocity) > SLOW * fastest and abs(piece.travel) > REST_TRAVEL * grain(recording):
            continue
        if found and found[-1].last == piece.first:
            found[-1] = _stretch(recording, found[-1].first, piece.last)
        else:
            found.append(piece)
    return tuple(found)


def plateaus(recording: Recording, chain: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
    """Stretches that were meant as a constant speed: long in time or far in travel against the others.

    Plateaus may be equal in duration or equal in travel; a transition is short in both.
    """
    still = REST_TRAVEL * grain(recording)
    # A rest with a wrinkle of a few counts is no speed.
    least = {True: 2.0 * still, False: still}
    moving = [piece for piece in chain if abs(piece.travel) > least[_is_slow(piece, chain)]]
    if not moving:
        return ()
    duration = np.array([piece.duration for piece in moving])
    travel = np.array([abs(piece.travel) for piece in moving])
    typical_duration = _weighted_median(duration, duration)
    typical_travel = _weighted_median(travel, travel)
    return tuple(
        piece
        for piece, own_time, own_travel in zip(moving, duration, travel, strict=True)
        if own_time >= LEAST_SHARE * typical_duration or own_travel >= LEAST_SHARE * typical_travel
    )


def _stretch(recording: Recording, first: int, last: int) -> Stretch:
    end = min(last, recording.time.size - 1)
    return Stretch(
        first=first,
        last=last,
        duration=float(recording.time[end] - recording.time[first]),
        travel=float(recording.position[end] - recording.position[first]),
    )


def _is_slow(piece: Stretch, chain: tuple[Stretch, ...]) -> bool:
    fastest = max(abs(other.velocity) for other in chain)
    return fastest == 0.0 or abs(piece.velocity) <= 0.05 * fastest


def _corners(time: FloatArray, position: FloatArray, least: float) -> list[int]:
    """Indices of the polyline's corners, the two ends included (Ramer 1972; Douglas and Peucker 1973)."""
    corners = {0, time.size - 1}
    open_spans = [(0, time.size - 1)]
    while open_spans:
        start, end = open_spans.pop()
        if end - start < 2:
            continue
        deviation = _deviation(time, position, start, end)
        worst = int(np.argmax(deviation))
        if deviation[worst] > max(least, BEND * abs(position[end] - position[start])):
            corner = start + 1 + worst
            corners.add(corner)
            open_spans += [(start, corner), (corner, end)]
    return sorted(corners)


def _without_weak_corners(
    time: FloatArray, position: FloatArray, corners: list[int], least: float
) -> list[int]:
    """Corners whose neighbours a single chord explains as well are dropped: greedy splitting leaves some."""
    kept = corners[:1]
    for corner, after in itertools.pairwise(corners[1:]):
        deviation = float(np.max(_deviation(time, position, kept[-1], after), initial=0.0))
        if deviation > max(least, BEND * abs(position[after] - position[kept[-1]])):
            kept.append(corner)
    return kept + corners[-1:]


def _deviation(time: FloatArray, position: FloatArray, start: int, end: int) -> FloatArray:
    inner = slice(start + 1, end)
    slope = (position[end] - position[start]) / (time[end] - time[start])
    return np.asarray(np.abs(position[inner] - position[start] - slope * (time[inner] - time[start])))


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])

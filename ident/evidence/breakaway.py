r"""Breakaway: the torque at which a link at rest begins to move, eq (4)'s F_s.

A threshold on speed or on travel finds the instant late, and by then the ramp has risen: the torque read
there is biased upwards. So the detection is made part of the model instead. From sustained motion one goes
back to the instant t_x at which the link has left its place of rest by x, a few counts; the torque u(t_x)
is read off a line through the ramp. Under a pure set-valued law the link starts exactly at F_s, and from
there needs the time d(u', x) to travel x under a ramp of u' [N m/s] (`ident.response.breakaway_delay`):

    u(t_x) = F_s + u' d(u', x).

That is the residual of the joint fit; for small v/v_s the delay is tau ln(...) with tau = J / (dF/v_s - b).

A motion is sustained if it covers 20 counts. Less, from one rest to the next, is pre-sliding or creep
(E-CREEP). A start without a ramp (a step of torque, the end of a move) is no breakaway experiment. A start
at the torque limit, or a rest under a torque held there, is censored: it says F_s >= limit and gives no
number (E-SAT). Where no limit is declared, a flat top at the log's largest torque is one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from data.recording import FloatArray, Recording
from ident.evidence.segmentation import AT_LIMIT, Stretch, grain, slow_spans, stretches

SUSTAINED_COUNTS = 20.0
ONSET_COUNTS = 3.5  # the first reading beyond is the onset
LEAST_SAMPLES = 12  # of a ramp
STRAIGHT = 0.001  # part of the torque by which a ramp may bend off its line
KEPT = 0.7  # part of the longest straight stretch that the line goes through
PUSHED = 0.1  # part of the log's largest torque, from which on a link that creeps is pushed
TAKEN_BACK = 0.3  # part of a rest's largest torque by which a ramp that was given up falls
FLAT = 0.3  # part of the band next to the log's largest torque by which a flat top may rise


@dataclass(frozen=True)
class RampLine:
    """The torque of a ramp as a line in time, up to its end."""

    torque: float  # at the end [N m]
    stderr: float  # of it [N m]
    rate: float  # [N m/s]
    start_time: float  # [s]


@dataclass(frozen=True)
class Breakaway:
    """One start from rest. Signs are those of the log."""

    log: str
    direction: int  # +1 or -1
    line: RampLine  # its torque is that of t_x
    travel: float  # x [rad], > 0
    travel_stderr: float  # [rad]
    place: float  # position of rest [rad]
    onset_time: float  # t_x [s]
    onset: int  # first sample at or after t_x
    end: int  # past the last sample of the motion that follows
    end_time: float  # [s]
    why: str | None = None  # why it is left out, beginning with its code
    place_stderr: float = 0.0  # of the torque, from what varies with position [N m]

    @property
    def torque(self) -> float:
        """u(t_x), signed [N m]."""
        return self.line.torque

    @property
    def is_censored(self) -> bool:
        """Whether it only says that F_s is at least this torque."""
        return self.why is not None and self.why.startswith("E-SAT")


def breakaways(recording: Recording) -> tuple[Breakaway, ...]:
    """Every start from rest in a log, those that are no breakaway included, in order of time."""
    still = slow_spans(recording, stretches(recording))
    found = []
    for number, rest in enumerate(still):
        after = still[number + 1].first if number + 1 < len(still) else recording.time.size
        found += _abandoned(recording, rest)
        start = _start(recording, rest, after)
        moved = None if start is None or start.travel == 0.0 else start.direction
        until = rest.last if start is None or moved is None else start.onset
        held = [_held_at_limit(recording, rest.first, until, sign) for sign in (1, -1) if sign != moved]
        found += [own for own in held if own is not None]
        if start is not None and (moved or not any(held)):
            found.append(start)
    return tuple(found)


def _held_at_limit(recording: Recording, first: int, past: int, direction: int) -> Breakaway | None:
    """The censored start of a link that rests under the torque limit in a direction; None where it does not.

    Judged on means over a few samples, so that noise alone reaches no limit.
    """
    if past - first < 2 * LEAST_SAMPLES:
        return None
    smooth = np.convolve(direction * recording.torque, np.full(LEAST_SAMPLES, 1 / LEAST_SAMPLES), "valid")
    limit = recording.torque_limit
    top = float(np.max(smooth)) if limit is None else limit
    own = smooth[first : past - LEAST_SAMPLES + 1]
    noise, _ = _texture(recording.torque)
    near = AT_LIMIT * top - (3.0 * noise * LEAST_SAMPLES**-0.5 if limit is None else 0.0)
    reached = _longest_run(own >= near)
    if (
        top <= 0.0
        or reached.size == 0
        or (limit is None and not _flat(recording, first + reached, top - near))
    ):
        return None
    where = first + int(reached[0])
    at_least = float(np.mean(own[reached]))
    return Breakaway(
        log=recording.log,
        direction=direction,
        line=RampLine(direction * at_least, float("nan"), 0.0, float(recording.time[first])),
        travel=0.0,
        travel_stderr=0.0,
        place=float(np.median(recording.position[where : where + LEAST_SAMPLES])),
        onset_time=float(recording.time[where]),
        onset=where,
        end=past,
        end_time=float(recording.time[min(past, recording.time.size) - 1]),
        why=f"E-SAT: the link rests at the torque limit: F_s >= {at_least:.4g}, not a number. "
        "Raise the limit.",
    )


def _longest_run(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Indices of the longest stretch over which it holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    runs = edges.reshape(-1, 2)
    if runs.size == 0:
        return np.zeros(0, dtype=np.int64)
    first, past = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return np.arange(first, past, dtype=np.int64)


def _flat(recording: Recording, reached: NDArray[np.int64], band: float) -> bool:
    """Whether the torque surely stays over the samples (n,) next to its top: a ramp would cross the band, and
    one that is taken back at once would fall again.
    """
    if reached.size < 5 * LEAST_SAMPLES:
        return False
    part = slice(int(reached[0]) + LEAST_SAMPLES, int(reached[-1]))
    line, _ = _line(recording.time[part], recording.torque[part], 0.0, 0.0)
    thirds = [float(piece.mean()) for piece in np.array_split(recording.torque[part], 3)]
    return 2.0 * line.stderr < FLAT * band and max(thirds) - min(thirds) < FLAT * band


def _start(recording: Recording, rest: Stretch, after: int) -> Breakaway | None:
    """The start from one rest; None where the link only settles."""
    resolution = grain(recording)
    late = recording.position[rest.last - max(1, (rest.last - rest.first) * 3 // 10) : rest.last]
    place = float(np.median(late))
    away = recording.position[rest.first : max(after, rest.last)] - place
    scatter = 3.0 * 1.4826 * float(np.median(np.abs(late - place)))
    least = (ONSET_COUNTS + np.ceil(scatter / resolution)) * resolution
    searched = rest.last - late.size - rest.first
    far = np.flatnonzero(np.abs(away[searched:]) >= max(SUSTAINED_COUNTS * resolution, 2.0 * least))
    if far.size == 0:
        return _creep(recording, rest, place, float(np.ptp(away)) / resolution)
    sustained = int(far[0]) + searched
    direction = 1 if away[sustained] > 0 else -1
    near = np.flatnonzero(direction * away[: sustained + 1] < least)
    if near.size == 0:
        return None  # it was never at the place that it left: a rest of wrong samples
    before = int(near[-1])
    onset = rest.first + before + 1
    end = _end_of_motion(recording, rest.first + sustained, after, direction)
    start = Breakaway(
        log=recording.log,
        direction=direction,
        line=_ramp_line(recording, rest.first, onset),
        travel=_travel_at(recording, onset, direction * float(away[before + 1])),
        travel_stderr=0.4 * resolution,  # two roundings
        place=place,
        onset_time=float(recording.time[onset]),
        onset=onset,
        end=end,
        end_time=float(recording.time[end - 1]),
    )
    # The torque is held: it follows the line through its samples half a sample late.
    later = start.onset_time - 0.5 * recording.sample_period - recording.time[onset - 1]
    line = replace(start.line, torque=float(start.line.torque + start.line.rate * later))
    return replace(start, line=line, why=_objection(recording, start))


def _objection(recording: Recording, start: Breakaway) -> str | None:
    """Why a start is no breakaway experiment; None if it is one."""
    line = start.line
    if recording.torque_limit is not None and abs(line.torque) >= AT_LIMIT * recording.torque_limit:
        return (
            f"E-SAT: the torque is at its limit when the link moves: F_s >= {abs(line.torque):.4g}, not a "
            "number. "
            "Raise the limit or reduce the friction."
        )
    if not np.isfinite(line.stderr) or line.rate * start.direction <= 0:
        return (
            "no ramp: the torque does not rise along a line before the link moves at "
            f"{start.onset_time:.3g} s, "
            "so its value there is not F_s. Ramp it slowly from rest."
        )
    return None


def _abandoned(recording: Recording, rest: Stretch) -> list[Breakaway]:
    """Ramps within a rest that were taken back before the link ran, though it had crept under them."""
    size = LEAST_SAMPLES
    if rest.last - rest.first < 4 * size:
        return []
    torque = np.convolve(recording.torque[rest.first : rest.last], np.full(size, 1 / size), "valid")
    tops, about = find_peaks(np.abs(torque), prominence=TAKEN_BACK * float(np.max(np.abs(torque))))
    found = []
    for top, base in zip(tops + size // 2, about["left_bases"] + size // 2, strict=True):
        first, last = rest.first + int(base), rest.first + int(top)
        place = float(np.median(recording.position[max(rest.first, first - size) : first + 1]))
        counts = abs(float(np.median(recording.position[last - size // 2 : last + 1])) - place)
        creep = _creep(recording, Stretch(first, last + 1, 0.0, 0.0), place, counts / grain(recording))
        found += [creep] if creep else []
    return found


def _creep(recording: Recording, rest: Stretch, place: float, counts: float) -> Breakaway | None:
    """A rest that ends in no sustained motion, though it has crept under a ramp; None without either."""
    last = min(rest.last, recording.time.size) - 1
    if counts < ONSET_COUNTS or not np.isfinite(_ramp_line(recording, rest.first, last + 1).stderr):
        return None
    torque = float(np.mean(recording.torque[max(rest.first, last - LEAST_SAMPLES) : last + 1]))
    if abs(torque) < PUSHED * float(np.max(np.abs(recording.torque))):
        return None  # it still settles
    return Breakaway(
        log=recording.log,
        direction=1 if torque > 0 else -1,
        line=RampLine(torque, float("nan"), 0.0, float(recording.time[rest.first])),
        travel=0.0,
        travel_stderr=0.0,
        place=place,
        onset_time=float(recording.time[last]),
        onset=last,
        end=last + 1,
        end_time=float(recording.time[last]),
        why=f"E-CREEP: {counts:.0f} counts of travel and no sustained motion: pre-sliding, not a breakaway. "
        "Ramp on until the link runs.",
    )


def _travel_at(recording: Recording, onset: int, reading: float) -> float:
    """Displacement at the onset's sample [rad], from its reading.

    A reading of k counts that has only just come about means k - 1/2; in a motion of several counts a sample
    the true position lies anywhere in its count, and k is the best guess.
    """
    resolution = grain(recording)
    last = min(onset + 1, recording.time.size - 1)
    first = max(onset - 1, 0)
    counts = abs(recording.position[last] - recording.position[first]) / resolution / max(last - first, 1)
    return float(reading - 0.5 * resolution * (1.0 - min(counts, 1.0)))


def _end_of_motion(recording: Recording, sustained: int, after: int, direction: int) -> int:
    """Index past the last sample before the link turns back, or rests."""
    moved = direction * recording.position[sustained:after]
    if moved.size == 0:
        return sustained + 1
    highest = np.maximum.accumulate(moved)
    back = np.flatnonzero(moved < highest - 2.0 * grain(recording))
    return sustained + (int(back[0]) if back.size else moved.size)


def _ramp_line(recording: Recording, first: int, onset: int) -> RampLine:
    """Line through the longest part of the ramp before a sample that is straight; its value there.

    The torque is the line's at sample onset - 1; an unknown stderr (nan) says that there is no ramp.
    """
    time, torque = recording.time[first:onset], recording.torque[first:onset]
    none = RampLine(
        float(torque[-1]) if torque.size else 0.0, float("nan"), 0.0, float(recording.time[first])
    )
    noise, step = _texture(torque)
    longest, size = 0, LEAST_SAMPLES
    while size <= torque.size:
        _, misfit = _line(time[-size:], torque[-size:], noise, step)
        if misfit <= 1.0:
            longest = size
        elif misfit > 3.0:
            break
        size = size + max(1, size // 4)
    # The last step may have gone past the start of the ramp by less than the test sees.
    size = max(LEAST_SAMPLES, int(KEPT * longest))
    if longest == 0:
        return none
    line, _ = _line(time[-size:], torque[-size:], noise, step)
    rise = abs(line.rate) * (time[-1] - time[-size])
    return line if rise > 5.0 * line.stderr + STRAIGHT * abs(line.torque) else none


def _texture(torque: FloatArray) -> tuple[float, float]:
    """Standard deviation of a torque's noise [N m], and the size of its steps where it rises in steps.

    Both are medians, which the one jump of a torque that is switched on leaves alone.
    """
    change = np.abs(np.diff(torque))
    if change.size == 0:
        return 0.0, 0.0
    typical = float(np.median(change))
    if typical > 0.0:
        return 1.4826 * typical / float(np.sqrt(2.0)), 0.0
    steps = change[change > 0.0]
    return 0.0, float(np.median(steps)) if steps.size > LEAST_SAMPLES else 0.0


def _line(time: FloatArray, torque: FloatArray, noise: float, step: float) -> tuple[RampLine, float]:
    """Least-squares line, and its lack of straightness: 1 where block means just stray as far as allowed."""
    centred = time - time[-1]
    basis = np.column_stack([np.ones_like(centred), centred])
    coefficient, *_ = np.linalg.lstsq(basis, torque, rcond=None)
    residual = torque - basis @ coefficient
    blocks = np.array([piece.mean() for piece in np.array_split(residual, 6)])
    allowed = 3.0 * noise * np.sqrt(6.0 / time.size) + STRAIGHT * abs(float(coefficient[0])) + step
    misfit = float(np.max(np.abs(blocks))) / max(allowed, float(np.finfo(np.float64).tiny))
    scatter = max(noise, float(np.std(residual)))
    at_end = np.linalg.inv(basis.T @ basis)[0, 0]
    line = RampLine(
        torque=float(coefficient[0]),
        stderr=float(scatter * np.sqrt(at_end)),
        rate=float(coefficient[1]),
        start_time=float(time[0]),
    )
    return line, misfit

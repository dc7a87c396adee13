r"""Torque that depends on the place: ripple and cogging, found in the steady runs and taken out.

A motor's cogging, an eccentric gear or a belt's teeth add to eq (1) a torque r(q) that a run at constant
speed shows as a wave in position. A long run averages it out; a slow run sees one phase of it, and runs that
all start from home see the same phase: an error that no scatter between them betrays. So it is measured
where it shows, in the runs that travel over whole waves, and taken out everywhere.

Each run is cut into short blocks. In block j, less the link's own acceleration where J is known and the
friction that follows its change of speed,

    u_j - J a_j - F'(v) (v_j - v) = (mean and trend) + sum over waves of A_d cos k q_j + B_d sin k q_j,

with one wavenumber k [rad^-1, or m^-1] a wave for all runs and A, B of each direction d: a torque ripple is
the same both ways, a friction ripple flips. Both directions are pooled where they agree. k is searched for
on a continuous grid and beyond its ends, strongest wave first, and taken as whole where the positions are
angles and a whole one explains as much (gravity: one in a turn); a wave has to be long against an
encoder's count (the torque of a speed loop follows the counts themselves), has to stand far out of the
neighbouring wavenumbers, and the runs have to agree on its phase, or positions are not absolute from log to
log. A wave on whose phase they do not agree cannot be taken out: its size then is an error of each run and
each breakaway.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.evidence.traces import Trace
from ident.evidence.wave_sums import wave_sums

GRID = 3000  # wavenumbers that are tried, at most
STEP = 0.2  # of the wavenumbers' grid, in cycles over the longest run
LEAST_WAVES = 1.5  # in the longest run
SHORTEST_WAVES = 0.6  # in the longest run: part of a wave that is still told from a bend
REFINEMENTS = 4  # quarterings of the grid's step
MOST_LOOKS = 30  # for the top of a wave's power
AS_MUCH = 0.995  # of a wave's power, that a whole wavenumber has to explain
OWN_WAVES = 1.0  # in a run that is asked for a phase of its own
FEWEST_COUNTS = 24.0  # of the encoder in a wave: the answer of a speed loop to single counts is no friction
FINEST = 1.2  # largest phase that a block may cover
NEIGHBOURS = 150  # wavenumbers on each side of a wave whose power is the background
STANDS_OUT = 50.0  # power of a wave over the background, where 4 are expected of noise
HEARD = 6.0  # power of a wave in one run over the background, which noise has in 5 % of the runs
AGREE = 0.8  # part of the runs' own power that the common phase keeps
MOST_WAVES = 4
APART = 2.0  # waves over the typical run by which two differ
SAME = 9.2  # chi-square of two numbers under which two directions agree


@dataclass(frozen=True)
class Wave:
    """One wave of r(q). Where it is not coherent only its size is known."""

    wavenumber: float  # k [rad^-1]
    wavenumber_stderr: float  # [rad^-1]
    centre: float  # mean position of the data, where phases are known best [rad]
    coefficients: dict[int, FloatArray]  # direction -> A, B [N m]
    covariance: dict[int, FloatArray]  # direction -> (2, 2)
    amplitude: float  # [N m]
    coherent: bool

    @property
    def wavelength(self) -> float:
        """[rad]."""
        return 2 * np.pi / self.wavenumber

    def torque(self, position: FloatArray, direction: int) -> FloatArray:
        """What the actuator has to add at positions (n,) [N m]; 0 where the phase is unknown."""
        if not self.coherent:
            return np.zeros_like(position)
        a, b = self.coefficients[direction]
        phase = self.wavenumber * position
        return np.asarray(a * np.cos(phase) + b * np.sin(phase))

    def mean_variance(self, position: FloatArray, direction: int) -> float:
        """Variance of the mean over positions (n,) that is left after the correction [(N m)^2]."""
        phase = self.wavenumber * position
        mean = np.array([np.cos(phase).mean(), np.sin(phase).mean()])
        if not self.coherent:
            return 0.5 * self.amplitude**2 * float(mean @ mean)
        a, b = self.coefficients[direction]
        slope = float(np.mean((position - self.centre) * (b * np.cos(phase) - a * np.sin(phase))))
        own = float(mean @ self.covariance[direction] @ mean)
        return own + (slope * self.wavenumber_stderr) ** 2


def find_waves(traces: Sequence[Trace], *, turns: bool = False) -> tuple[Wave, ...]:
    """The waves that stand out, strongest first; one that is not coherent ends the search.

    With `turns`, positions are angles: a wave that may as well go into the turn a whole number of times does.
    """
    long = [own for own in traces if own.travel > 0]
    if not long:
        return ()
    grid = _grid(long)
    left, found, noise = long, list[float](), _noise(long)
    for _ in range(MOST_WAVES):
        common, separate = _power(left, grid, noise)
        common = np.where(_near(grid, found, long), 0.0, common)
        peak = int(np.argmax(common / _background(common)))
        wavenumber = _refined(left, float(grid[peak]), float(grid[1] - grid[0]), noise)
        wavenumber = _in_a_turn(left, wavenumber, noise) if turns else wavenumber
        after = _without(long, [*found, wavenumber], noise)
        quiet = _noise(after)
        # Judged against what is left, since a strong wave leaks over its neighbours and is noise of its own.
        beside = slice(max(peak - NEIGHBOURS, 0), peak + NEIGHBOURS + 1)
        background = float(_background(_power(after, grid[beside], quiet)[0])[peak - beside.start])
        power = float(_power(left, np.array([wavenumber]), quiet)[0][0])
        around = np.append(grid[_near(grid, [wavenumber], long)], wavenumber)
        own = float(np.max(_power(left, around, quiet)[1], initial=0.0))
        askable = 2 * sum(wavenumber * run.travel > 2 * np.pi * OWN_WAVES for run in long)
        agreed = power - 4 > AGREE * (own - askable)
        if min(power, own) < STANDS_OUT * background or not agreed:
            return (*_waves(long, found, noise), *_incoherent(left, grid, noise, separate))
        found, left, noise = [*found, wavenumber], after, quiet
    return tuple(_waves(long, found, noise))


def _near(grid: FloatArray, found: Sequence[float], traces: Sequence[Trace]) -> NDArray[np.bool_]:
    """Wavenumbers (w,) that the runs hardly tell from one that is found: what is left there is its misfit."""
    width = 2 * np.pi * APART / float(np.median([own.travel for own in traces]))
    near = np.zeros(grid.size, dtype=bool)
    for wavenumber in found:
        near |= np.abs(grid - wavenumber) < min(width, 0.3 * wavenumber)
    return near


def _noise(traces: Sequence[Trace]) -> list[float]:
    """Mean square of each run [(N m)^2]."""
    return [float(np.mean(own.torque**2)) for own in traces]


def _grid(traces: Sequence[Trace]) -> FloatArray:
    longest = max(own.travel for own in traces)
    finest = sorted(own.stride for own in traces)[len(traces) // 4]
    coarsest = max(own.grain for own in traces)
    step = 2 * np.pi * STEP / longest
    first = 2 * np.pi * LEAST_WAVES / longest
    last = min(FINEST / finest, 2 * np.pi / (FEWEST_COUNTS * coarsest) if coarsest else np.inf)
    count = int(min(GRID, max((last - first) / step, 2)))
    return np.asarray(first + step * np.arange(count))


Sums = tuple[FloatArray, FloatArray]


def _sums(own: Trace, grid: FloatArray, noise: float) -> Sums:
    """Weighted projections (w, 2) of a run on the waves, and their products (w, 2, 2)."""
    seen = grid * own.stride < FINEST
    right, left = np.zeros((grid.size, 2)), np.zeros((grid.size, 2, 2))
    if noise > 0 and np.any(seen):
        sums = wave_sums(
            grid[seen], position=own.position, torque=own.torque, smooth=own.smooth, stride=own.stride
        )
        right[seen], left[seen] = (each / noise for each in sums)
    return right, left


def _explained(right: FloatArray, left: FloatArray) -> FloatArray:
    """Fall of chi-square (w,) by amplitude and phase."""
    (a, b), (aa, ab, bb) = right.T, (left[:, 0, 0], left[:, 0, 1], left[:, 1, 1])
    determinant = aa * bb - ab**2
    sound = determinant > 1e-6 * (aa + bb) ** 2
    fall = (bb * a**2 - 2 * ab * a * b + aa * b**2) / np.where(sound, determinant, 1.0)
    return np.where(sound, fall, 0.0)


def _power(
    traces: Sequence[Trace], grid: FloatArray, noise: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """Chi-square explained by phases common to a direction (w,), and by those of each run."""
    common, separate = np.zeros_like(grid), np.zeros_like(grid)
    for direction in (1, -1):
        right, left = np.zeros((grid.size, 2)), np.zeros((grid.size, 2, 2))
        for own, variance in zip(traces, noise, strict=True):
            if own.direction != direction:
                continue
            r, g = _sums(own, grid, variance)
            right, left = right + r, left + g
            whole = grid * own.travel > 2 * np.pi * OWN_WAVES
            separate += np.where(whole, _explained(r, g), 0.0)
        common += _explained(right, left)
    return common, separate


def _background(power: FloatArray) -> FloatArray:
    """Power of the neighbours (w,), such that noise has 1 of it: the median of chi-square(4) is 3.36."""
    reach = range(power.size)
    medians = [
        np.median(power[max(k - NEIGHBOURS, 0) : k + NEIGHBOURS + 1]) for k in reach[:: NEIGHBOURS // 10]
    ]
    return np.maximum(np.interp(reach, reach[:: NEIGHBOURS // 10], medians) / 3.36, 1.0)


def _refined(traces: Sequence[Trace], wavenumber: float, step: float, noise: Sequence[float]) -> float:
    """The wavenumber of the greatest power near one of the grid's.

    Where the power still rises at the edge of what was looked at, it is followed: a wave longer than the
    grid's longest, as gravity's often is, shows at the grid's end.
    """
    least = 2 * np.pi * SHORTEST_WAVES / max(own.travel for own in traces)
    finest = step / 4**REFINEMENTS
    for _ in range(MOST_LOOKS):
        near = np.maximum(wavenumber + step * np.linspace(-1.0, 1.0, 11), least)
        power, _ = _power(traces, near, noise)
        best = int(np.argmax(power))
        inside = 0 < best < near.size - 1 or near[best] == least
        wavenumber, step = float(near[best]), step / 4 if inside else step
        if step <= finest:
            break
    return wavenumber


def _in_a_turn(traces: Sequence[Trace], wavenumber: float, noise: Sequence[float]) -> float:
    """The whole wavenumber next to one, where it explains as much: what turns repeats with a turn."""
    whole = float(max(round(wavenumber), 1))
    own, other = _power(traces, np.array([wavenumber, whole]), noise)[0]
    return whole if other >= AS_MUCH * own else wavenumber


def _solved(
    traces: Sequence[Trace], found: Sequence[float], noise: Sequence[float], direction: int
) -> tuple[FloatArray, FloatArray]:
    """A, B of all waves in a direction (2 w,) and their covariance."""
    size = 2 * len(found)
    right, left = np.zeros(size), np.zeros((size, size))
    for own, variance in zip(traces, noise, strict=True):
        if own.direction == direction and variance > 0:
            waves = own.waves(np.array(found)).transpose(0, 2, 1).reshape(own.torque.size, size)
            right += waves.T @ own.torque / variance
            left += waves.T @ waves / variance
    covariance = np.linalg.pinv(left, hermitian=True)
    return np.asarray(covariance @ right), np.asarray(covariance)


def _without(traces: Sequence[Trace], found: Sequence[float], noise: Sequence[float]) -> list[Trace]:
    """The runs less their waves."""
    solved = {direction: _solved(traces, found, noise, direction)[0] for direction in (1, -1)}
    left = []
    for own in traces:
        waves = own.waves(np.array(found)).transpose(0, 2, 1).reshape(own.torque.size, -1)
        torque = own.torque - waves @ solved[own.direction]
        left.append(replace(own, torque=torque))
    return left


def _waves(traces: Sequence[Trace], found: Sequence[float], noise: Sequence[float]) -> list[Wave]:
    if not found:
        return []
    solved = {direction: _solved(traces, found, noise, direction) for direction in (1, -1)}
    widened = _disagreement(traces, found, noise)
    place = np.concatenate([own.position for own in traces])
    weight = np.concatenate(
        [np.full(own.torque.size, 1 / v if v > 0 else 0.0) for own, v in zip(traces, noise, strict=True)]
    )
    centre = float(np.average(place, weights=weight))
    spread = float(np.average((place - centre) ** 2, weights=weight)) ** 0.5
    waves = []
    for number, wavenumber in enumerate(found):
        part = slice(2 * number, 2 * number + 2)
        both = {d: (x[part], widened * c[part, part]) for d, (x, c) in solved.items()}
        both = _pooled(both)
        amplitude = max(float(np.hypot(*x)) for x, _ in both.values())
        error = min(float(np.trace(c)) for _, c in both.values()) ** 0.5
        waves.append(
            Wave(
                wavenumber=wavenumber,
                wavenumber_stderr=error / amplitude / spread,
                centre=centre,
                coefficients={d: x for d, (x, _) in both.items()},
                covariance={d: c for d, (_, c) in both.items()},
                amplitude=amplitude,
                coherent=True,
            )
        )
    return waves


def _disagreement(traces: Sequence[Trace], found: Sequence[float], noise: Sequence[float]) -> float:
    """Chi-square a number by which the runs' own phases and sizes differ from the common ones, at least 1.

    A speed loop turns the phase of what it answers to, and blocks are not independent: the runs among
    themselves tell what their errors are.
    """
    grid = np.array(found)
    fall, numbers = 0.0, 0
    for own, variance in zip(_without(traces, found, noise), noise, strict=True):
        right, left = _sums(own, grid, variance)
        whole = (grid * own.travel > 2 * np.pi * OWN_WAVES) & (grid * own.stride < FINEST)
        fall += float(np.sum(_explained(right, left)[whole]))
        numbers += 2 * int(np.count_nonzero(whole))
    return max(1.0, fall / max(numbers, 1))


Solved = dict[int, tuple[FloatArray, FloatArray]]


def _pooled(both: Solved) -> Solved:
    """One torque ripple where the two directions agree on it, or the one flipped where friction ripples."""
    (ahead, ahead_error), (back, back_error) = both[1], both[-1]
    if not (np.any(ahead_error) and np.any(back_error)):
        seen = both[1] if np.any(ahead_error) else both[-1]
        return {1: seen, -1: seen}
    for sign in (1.0, -1.0):
        apart = ahead - sign * back
        if float(apart @ np.linalg.solve(ahead_error + back_error, apart)) < SAME:
            joint = np.linalg.inv(np.linalg.inv(ahead_error) + np.linalg.inv(back_error))
            mean = joint @ (np.linalg.solve(ahead_error, ahead) + sign * np.linalg.solve(back_error, back))
            return {1: (mean, joint), -1: (sign * mean, joint)}
    return both


def _incoherent(
    traces: Sequence[Trace], grid: FloatArray, noise: Sequence[float], own: FloatArray
) -> list[Wave]:
    """A wave on whose phase the runs do not agree, of the amplitude that they show.

    A run, or two at one speed, may owe a wave to their time, as a speed loop's swing or the encoder's counts
    under its samples: half of the runs have to show it.
    """
    peak = int(np.argmax(own))
    at = grid[peak : peak + 1]
    after, squares, whole = [], [], []
    for run, variance in zip(traces, noise, strict=True):
        torque = run.torque
        if at[0] * run.travel > 2 * np.pi * OWN_WAVES and at[0] * run.stride < FINEST and variance > 0:
            right, left = _sums(run, at, variance)
            both = np.linalg.solve(left[0], right[0])
            torque = torque - run.waves(at)[:, :, 0] @ both
            squares.append(float(both @ both))
            whole.append(run)
        after.append(replace(run, torque=torque))
    quiet = _noise(after)
    background = float(_background(_power(after, grid, quiet)[1])[peak])
    heard = [
        float(_explained(*_sums(run, at, variance))[0])
        for run, variance in zip(traces, quiet, strict=True)
        if any(run is own for own in whole)
    ]
    showing = sum(power > HEARD * background for power in heard)
    if len(heard) < 2 or 2 * showing < len(heard) or sum(heard) < 2.0 * STANDS_OUT * background:
        return []
    nothing: dict[int, FloatArray] = {}
    amplitude = float(np.median(squares)) ** 0.5
    return [Wave(float(at[0]), 0.0, 0.0, nothing, nothing, amplitude, coherent=False)]

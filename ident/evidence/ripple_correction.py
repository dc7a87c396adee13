"""The waves of the torque over position taken out of everything that a fit uses.

A steady run loses their mean over its way, a breakaway their value at its place, a motion their integral over
its time. What a wave's own error leaves behind, or all of a wave whose phase is unknown, stays in the weights
and is not left to the spread between runs, which runs that share a place would not show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from data.findings import Finding, Severity
from data.recording import Axis, FloatArray, Recording
from ident.evidence.breakaway import Breakaway
from ident.evidence.friction_map import SteadyRun, torque_scatter
from ident.evidence.momentum import Momentum
from ident.evidence.position_ripple import Wave

TURN = 0.1  # by which the cycles a turn of gravity may differ from one
NODES = 2000  # places of a run over which a wave is averaged


def corrected_runs(
    recordings: Sequence[Recording], runs: Sequence[SteadyRun], waves: Sequence[Wave]
) -> tuple[SteadyRun, ...]:
    """The runs less the waves' mean over each."""
    by_name = {recording.log: recording for recording in recordings}
    corrected = []
    for run in runs:
        recording = by_name[run.log]
        first, past = np.searchsorted(recording.time, [run.start_time, run.end_time])
        place = recording.position[first : past + 1 : max(1, (past - first) // NODES)]
        torque, error = _mean(waves, place, run.direction)
        error = float(np.hypot(run.place_stderr, error))
        corrected.append(replace(run, torque=run.torque - torque, place_stderr=error))
    return tuple(corrected)


def without_wave_scatter(
    recordings: Sequence[Recording], runs: Sequence[SteadyRun], waves: Sequence[Wave]
) -> tuple[SteadyRun, ...]:
    """The runs with the scatter of their torque as all waves leave it, or a wave that is known and taken out
    would count a second time, as noise.
    """
    if not any(wave.coherent for wave in waves):
        return tuple(runs)
    by_name = {recording.log: recording for recording in recordings}
    rescattered = []
    for run in runs:
        recording = by_name[run.log]
        first, past = np.searchsorted(recording.time, [run.start_time, run.end_time])
        place = recording.position[first : past + 1]
        known = sum((wave.torque(place, run.direction) for wave in waves), np.zeros_like(place))
        white, ratio = torque_scatter(recording.torque[first : past + 1] - known)
        rescattered.append(replace(run, white_stderr=white, block_ratio=ratio))
    return tuple(rescattered)


def corrected_starts(starts: Sequence[Breakaway], waves: Sequence[Wave]) -> tuple[Breakaway, ...]:
    """The breakaways less the waves at their places."""
    corrected = []
    for start in starts:
        torque, error = _mean(waves, np.array([start.place]), start.direction)
        line = replace(start.line, torque=start.line.torque - torque)
        corrected.append(replace(start, line=line, place_stderr=float(np.hypot(start.place_stderr, error))))
    return tuple(corrected)


def corrected_motions(momenta: Sequence[Momentum], waves: Sequence[Wave]) -> tuple[Momentum, ...]:
    """The motions less the waves' impulse in each window; their variance is that of windows of their own."""
    corrected = []
    for motion in momenta:
        mean, error = np.array([_mean(waves, window, motion.direction) for window in motion.places]).T
        corrected.append(
            replace(
                motion,
                impulse=motion.impulse - motion.direction * mean * motion.duration,
                impulse_variance=motion.impulse_variance + (error * motion.duration) ** 2,
            )
        )
    return tuple(corrected)


def ripple_findings(waves: Sequence[Wave], axis: Axis) -> tuple[Finding, ...]:
    """A finding for each wave."""
    torque, length = ("N m", "rad") if axis == "rotary" else ("N", "m")
    turn = axis == "rotary"
    found = []
    for wave in waves:
        seen = (
            f"the torque varies with position, with an amplitude of {wave.amplitude:.3g} {torque} and a "
            f"wavelength of {wave.wavelength:.3g} {length}"
            + (", one turn: an unbalanced link under gravity" if turn and is_turn(wave) else "")
        )
        if wave.coherent:
            text = (
                f"{seen}: taken out of steady runs, breakaways and motion, its error kept in their weights."
            )
        else:
            text = (
                f"{seen}, its phase differing from log to log: it is an error of every run that is short "
                "against it and of every breakaway. Home the axis before each log, or run over whole waves."
            )
        found.append(Finding("E-POSITION", Severity.WARN, text))
    return tuple(found)


def is_turn(wave: Wave) -> bool:
    """Whether a wave goes once around a turn [rad], as gravity does."""
    return abs(wave.wavenumber - 1.0) < TURN


def _mean(waves: Sequence[Wave], place: FloatArray, direction: int) -> tuple[float, float]:
    """Mean torque of the waves over places (n,) [N m], and its error [N m]."""
    torque = sum(float(np.mean(wave.torque(place, direction))) for wave in waves)
    variance = sum(wave.mean_variance(place, direction) for wave in waves)
    return float(torque), float(variance) ** 0.5

r"""The motion after each breakaway, simulated with a law that has not seen its log.

The link starts at rest under the recorded torque: the line of the ramp up to the onset, since noise on a
torque that is held at F_s would start it early, and the samples from there. Two answers:

- with the law's own F_s, how much too early or too late the link starts. F_s differs from place to place, and
  on a ramp of u' a difference of dF_s is a time of dF_s / u';
- with the F_s of that ramp, how well the motion itself is met: the root mean square of the position error, in
  rad and in encoder counts, over the travel that followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray, Recording
from ident.evidence.breakaway import Breakaway
from ident.evidence.gathering import Evidence
from ident.evidence.segmentation import grain
from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import direction_of
from ident.fit.one_way_robot import robot_one_way
from ident.response import breakaway_delay, respond
from ident.validation.held_out import CrossValidation

LONGEST = 50_000  # samples of a motion that are simulated


@dataclass(frozen=True)
class RampMotion:
    """One motion after breakaway, predicted. Magnitudes along the motion."""

    log: str
    direction: int
    onset_time: float  # recorded, of the first counts of travel [s]
    onset_error: float  # predicted less recorded [s]
    travel: float  # that was compared [rad]
    position_rms: float  # of predicted less recorded, from the ramp's own F_s [rad]
    counts_rms: float  # the same, in counts or in the grain of an encoder that is not declared [-]


def predicted_motions(
    recordings: Sequence[Recording], evidence: Evidence, validation: CrossValidation
) -> tuple[RampMotion, ...]:
    """Every breakaway whose log a fold has left out, in the order of the logs."""
    by_name = {recording.log: recording for recording in recordings}
    found = []
    for start in evidence.used_starts:
        fits = [fold.fit for fold in validation.folds if start.log in fold.logs]
        motion = _predicted(by_name[start.log], start, fits[0]) if fits else None
        found += [motion] if motion is not None else []
    return tuple(found)


def _predicted(recording: Recording, start: Breakaway, fit: FrictionFit) -> RampMotion | None:
    """One motion; None where the fit is no robot's or the motion is too short."""
    past = min(start.end, start.onset + LONGEST)
    rate, period = abs(start.line.rate), recording.sample_period
    direction = direction_of(start.direction)
    own = robot_one_way(fit, direction)
    if own is None or past - start.onset < 3:
        return None
    lead = rate * breakaway_delay(own, direction=direction, ramp_rate=rate, travel=start.travel)
    static = abs(start.torque) - lead
    robot = robot_one_way(fit, direction, static_torque=static)
    if robot is None:
        return None
    late = (getattr(own.friction, direction).static_torque - static) / rate
    time, position, torque = _along(recording, start, past)
    # From where the ramp's line passes F_s, which leaves no sample before the onset out.
    before = int(np.ceil(lead / rate / period)) + 1
    line = abs(start.torque) + rate * period * (np.arange(-before, 0) + 0.5)
    moved, _ = respond(robot, start=(0.0, 0.0), torque=np.concatenate([line, torque]), period=period)
    simulated = start.onset_time + period * (np.arange(moved.size) - before)
    error = np.interp(time, simulated, moved) - position
    rms = float(np.sqrt(np.mean(error**2)))
    return RampMotion(
        log=start.log,
        direction=start.direction,
        onset_time=start.onset_time,
        onset_error=late,
        travel=float(position[-1]),
        position_rms=rms,
        counts_rms=rms / (recording.resolution or grain(recording)),
    )


def _along(recording: Recording, start: Breakaway, past: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times [s], displacement from rest [rad] and torque [N m] from the onset, along the motion.

    The torque is held from sample to sample of an even clock, as the log's own median period has it.
    """
    part = slice(start.onset, past)
    time = recording.time[part]
    displacement = start.direction * (recording.position[part] - start.place)
    even = np.arange(start.onset_time, time[-1], recording.sample_period)
    sample = np.clip(np.searchsorted(time, even, side="right") - 1, 0, time.size - 1)
    return time, displacement, np.asarray(start.direction * recording.torque[part][sample])

"""What the recordings of a campaign hold, before any law is fitted to it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from data.findings import Finding, LogError, Severity
from data.protocols import IDENTIFIES, ProtocolName
from data.recording import Recording
from ident.estimate import RunUse
from ident.evidence.breakaway import Breakaway, breakaways
from ident.evidence.frequency_response import FrequencyInertia, frequency_inertia
from ident.evidence.friction_map import SteadyRun, steady_runs
from ident.evidence.hunting import SAMPLES, hunts, momentum_variance, sensor_noise
from ident.evidence.momentum import Momentum, momentum
from ident.evidence.position_ripple import Wave, find_waves
from ident.evidence.ripple_correction import (
    corrected_motions,
    corrected_runs,
    corrected_starts,
    without_wave_scatter,
)
from ident.evidence.traces import traces_of

NEAR = 3.0  # ratio of speeds within which friction is of one size
STOPS = (1e-4, 1e7)  # [rad/s^2] or [m/s^2], deceleration by friction that some rig may have
ABSURD = 50.0  # ratio of two torques, or two inertias, that ought to be of one size


class IdentificationError(LogError):
    """Recordings from which no friction law can be had; the message says what to record."""


@dataclass(frozen=True)
class Evidence:
    """Everything that was found, used or not."""

    runs: tuple[SteadyRun, ...]
    starts: tuple[Breakaway, ...]
    momenta: tuple[Momentum, ...]
    response: FrequencyInertia | None
    response_reasons: dict[str, str]  # log -> why it gave no inertia
    waves: tuple[Wave, ...] = ()  # of the torque over position; the rest is corrected for them

    @property
    def used_runs(self) -> tuple[SteadyRun, ...]:
        """Steady runs that the fit takes."""
        return tuple(run for run in self.runs if run.why is None)

    @property
    def used_starts(self) -> tuple[Breakaway, ...]:
        """Breakaways that the fit takes."""
        return tuple(start for start in self.starts if start.why is None)


def gather(recordings: Sequence[Recording]) -> Evidence:
    """Segment every log by its protocol."""
    runs: list[SteadyRun] = []
    starts: list[Breakaway] = []
    momenta: list[Momentum] = []
    for part in chain.from_iterable(recording.parts() for recording in recordings):
        if part.protocol == "constant_velocity":
            runs += steady_runs(part)
        elif part.protocol == "breakaway":
            own = breakaways(part)
            starts += own
            motions = (momentum(part, start) for start in own if start.why is None)
            momenta += [motion for motion in motions if motion is not None]
    response, reasons = frequency_inertia(_of(recordings, "frequency_response"))
    inertia = response.inertia if response is not None else _rough_inertia(runs, momenta)
    steady = tuple(runs) if inertia is None else _without_hunting(recordings, runs, inertia)
    turns = any(recording.axis == "rotary" for recording in recordings)
    waves = find_waves(traces_of(recordings, steady, inertia), turns=turns)
    return Evidence(
        corrected_runs(recordings, without_wave_scatter(recordings, steady, waves), waves),
        corrected_starts(starts, waves),
        corrected_motions(momenta, waves),
        response,
        reasons,
        waves,
    )


def _rough_inertia(runs: Sequence[SteadyRun], momenta: Sequence[Momentum]) -> float | None:
    """J within a factor of two, from the motion after breakaway with the typical torque as friction."""
    torques = [abs(run.torque) for run in runs if run.why is None]
    if not torques or not momenta:
        return None
    friction = float(np.median(torques))
    found = [float((m.impulse - friction * m.duration).sum() / m.gain.sum()) for m in momenta]
    typical = float(np.median(found))
    return typical if typical > 0 else None


def _without_hunting(
    recordings: Sequence[Recording], runs: Sequence[SteadyRun], inertia: float
) -> tuple[SteadyRun, ...]:
    """The runs, those in which the speed loop hunts left out with the reason (`ident.evidence.hunting`)."""
    logs = [*_of(recordings, "constant_velocity"), *_of(recordings, "breakaway")]
    noise = sensor_noise([recording.torque for recording in logs]) if logs else 0.0
    return tuple(run if run.why is not None else _hunted(run, inertia, noise) for run in runs)


def _hunted(run: SteadyRun, inertia: float, noise: float) -> SteadyRun:
    """A run with what swings its speed, or left out for it."""
    speed, torque = abs(run.velocity), abs(run.torque)
    if not hunts(run.swing, speed=speed, torque=torque, inertia=inertia, noise=noise):
        return replace(run, momentum_variance=momentum_variance(run.swing, torque=torque, noise=noise))
    why = (
        f"E-STICKSLIP: the torque swings by {run.swing.torque**0.5:.3g} about {torque:.3g} within {SAMPLES} "
        f"samples, enough to stop a link of this inertia at {speed:.3g}: the speed loop hunts from count to "
        "count, and the mean torque is not the friction at the mean speed. Use a finer encoder or a softer "
        "loop."
    )
    return replace(run, why=why)


def require_evidence(recordings: Sequence[Recording], evidence: Evidence) -> None:
    """Raise `IdentificationError` without a steady run, or where the torque has the wrong sign or unit."""
    _require_a_direction(recordings, evidence)
    _require_sign(evidence)
    _require_one_unit(evidence)


def run_uses(recordings: Sequence[Recording], evidence: Evidence) -> tuple[RunUse, ...]:
    """Every log once: whether it was used, and if not, or only what was salvaged of it, why."""
    used = {run.log for run in evidence.used_runs} | {start.log for start in evidence.used_starts}
    reasons: dict[str, list[str]] = {}
    for log, why, _ in _once(_left_out(evidence)):
        reasons.setdefault(log, []).append(why)
    if evidence.response is not None:
        used |= {fit.log for fit in evidence.response.fits}
    uses = []
    for recording in recordings:
        log = recording.log
        if log in used:
            lost = "; ".join(f.text for f in recording.findings if f.severity is Severity.WITHHOLD)
            uses.append(RunUse(log, recording.sha256, recording.protocol, used=True, why=lost or None))
            continue
        if recording.protocol == "set_point":
            why = "a set-point run: the prediction is held against it, nothing is fitted to it"
        elif recording.protocol == "excitation":
            why = "an excitation run: it is fitted apart from the friction map"
        else:
            nothing = "no start from rest under a ramp was found"
            why = evidence.response_reasons.get(log) or "; ".join(reasons.get(log, [nothing]))
        uses.append(RunUse(log, recording.sha256, recording.protocol, used=False, why=why))
    return tuple(uses)


def log_findings(recordings: Sequence[Recording]) -> list[Finding]:
    """What the reader and the screening saw."""
    return [finding for recording in recordings for finding in recording.findings]


def run_findings(evidence: Evidence) -> tuple[Finding, ...]:
    """A finding for each run or start that is left out under a code."""
    found = []
    for log, why, where in _once(_left_out(evidence)):
        code, colon, text = why.partition(": ")
        if not colon or not code.startswith("E-"):
            continue
        severity = Severity.WARN if code in {"E-CREEP", "E-SAT"} else Severity.WITHHOLD
        found.append(Finding(code, severity, f"{log}, {where:.3g} s: {text}", log))
    trimmed = [run for run in evidence.used_runs if run.trimmed is not None]
    for run in trimmed:
        code, _, text = str(run.trimmed).partition(": ")
        found.append(Finding(code, Severity.WARN, f"{run.log}: {text}", run.log))
    return tuple(found)


def _left_out(evidence: Evidence) -> list[tuple[str, str, float]]:
    """Log, reason and instant [s] of each run and each start that is left out."""
    runs = [(run.log, run.why, run.start_time) for run in evidence.runs if run.why is not None]
    starts = [(start.log, start.why, start.onset_time) for start in evidence.starts if start.why is not None]
    return runs + starts


def _once(left_out: Sequence[tuple[str, str, float]]) -> list[tuple[str, str, float]]:
    """Each code of a log once, with the number of times; reasons without a code once each."""
    alike: dict[tuple[str, str], list[tuple[str, str, float]]] = {}
    for log, why, where in left_out:
        code, colon, _ = why.partition(": ")
        alike.setdefault((log, code if colon and code.startswith("E-") else why), []).append(
            (log, why, where)
        )
    return [
        (log, f"{why} So {len(own)} times in this log." if len(own) > 1 else why, where)
        for own in alike.values()
        for log, why, where in own[:1]
    ]


def _of(recordings: Iterable[Recording], protocol: ProtocolName) -> list[Recording]:
    return [recording for recording in recordings if recording.protocol == protocol]


def _require_a_direction(recordings: Sequence[Recording], evidence: Evidence) -> None:
    if evidence.used_runs:
        return
    seen = sorted({recording.protocol for recording in recordings})
    logs = sum(recording.protocol == "constant_velocity" for recording in recordings)
    reasons = {why.partition(": ")[0]: why for _, why, _ in _left_out(evidence)}
    bounds = [abs(start.torque) for start in evidence.starts if start.is_censored]
    also = f" What was left out: {'; '.join(reasons.values())}" if reasons else ""
    also += f" All that is known: F_s >= {max(bounds):.4g}." if bounds else ""
    raise IdentificationError(
        f"E-DIRECTION: no usable constant-velocity run in either direction ({logs} constant_velocity log(s); "
        f"protocols seen: {', '.join(seen) or 'none'}).{also} Record constant speeds with positive and with "
        f"negative velocity, in ratio from slow to fast; they give {IDENTIFIES['constant_velocity']}."
    )


def _require_sign(evidence: Evidence) -> None:
    against = []
    for sign in (1, -1):
        own = [run.torque * sign for run in evidence.used_runs if run.direction == sign]
        against += [sum(own) < 0] if own else []
    if all(against):
        run = evidence.used_runs[0]
        raise IdentificationError(
            f"E-SIGN: the torque acts against the motion in every direction (for example {run.log}: "
            f"{run.torque:.4g} N m at {run.velocity:.4g} rad/s): friction would drive the link. Set `sign = "
            "-1` for "
            "torque or for position in [signals]."
        )


def _require_one_unit(evidence: Evidence) -> None:
    """E-UNIT: the torque of some logs in another unit than that of the others.

    Friction at rest and in motion, and the inertia by two protocols, differ by parts and not by a hundred.
    """
    steady = [(abs(run.velocity), abs(run.torque), run.log) for run in evidence.used_runs]
    typical = float(np.median([torque for _, torque, _ in steady]))
    for speed, torque, log in steady:
        near = [own for other, own, name in steady if name != log and NEAR**-1 < other / speed < NEAR]
        if len(near) >= 3:
            _require_same(
                torque, float(np.median(near)), f"{log}: the torque at {speed:.3g} rad/s", "other logs"
            )
    starts = [abs(start.torque) for start in evidence.used_starts]
    if starts and typical > 0.0:
        log = evidence.used_starts[0].log
        _require_same(float(np.median(starts)), typical, f"{log}: the breakaway torque", "constant speeds")
    rough = _rough_inertia(evidence.runs, evidence.momenta)
    inertia = rough if evidence.response is None else evidence.response.inertia
    if inertia is not None:
        require_possible_inertia(inertia, typical)
    if evidence.response is not None and rough is not None:
        log = evidence.response.fits[0].log
        _require_same(evidence.response.inertia, rough, f"{log}: the implied inertia", "breakaways")


def require_possible_inertia(inertia: float, friction: float) -> None:
    """E-UNIT: refuse an inertia [kg m^2] that friction [N m] would stop as no rig's is stopped."""
    if not (inertia > 0.0 and friction > 0.0) or STOPS[0] < friction / inertia < STOPS[1]:
        return
    raise IdentificationError(
        f"E-UNIT: the implied inertia is {inertia:.4g} kg m^2 (kg for a linear axis) under a friction of "
        f"{friction:.4g}: it would stop at {friction / inertia:.2g} rad/s^2 (m/s^2), which no rig does (from "
        f"{STOPS[0]:g} to {STOPS[1]:g}). The time looks like ms or us that were read as s, or the position "
        "like another unit; J, b and v_s would be off by powers of ten. Correct `unit` of the time or of the "
        "position in [signals]."
    )


def _require_same(own: float, others: float, what: str, source: str) -> None:
    ratio = own / others if others > 0.0 else 1.0
    if ABSURD**-1 < ratio < ABSURD:
        return
    raise IdentificationError(
        f"E-UNIT: {what} is {own:.4g}, that of the {source} {others:.4g}: {ratio:.4g} times. No friction or "
        "inertia of one rig changes so much: the torque of one of them looks like another unit (mN m, or A "
        "without its torque constant), and all torques and the inertia would be off by such a factor. "
        "Correct `unit` or `scale` of the torque for those logs, or exclude them."
    )

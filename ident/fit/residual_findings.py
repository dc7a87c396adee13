r"""What the residuals of the settled fit betray: drift, errors of speed, a law that does not fit.

A cause that the law leaves out is tested as a column added to it (`ident.fit.added_columns`).

- E-DRIFT: friction that grows or falls with time, in parts of itself, or an offset of the torque that does;
  over the recording, or within the runs, all alike (signed ranks: Wilcoxon 1945).
- E-LACKOFFIT: runs at one speed that scatter less about each other than about the law; residuals that keep
  their sign over many speeds; or that follow slow waves over the ranks of the speeds, as those of a law of
  another shape do (a smooth test: Eubank and Hart 1992).
- E-SPEEDERR: the error of a run's speed, times the law's slope, is a large part of its torque's. It is in the
  weights already; what is lost is said.
"""

from __future__ import annotations

from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import rankdata, wilcoxon

from data.findings import Finding, Severity
from data.recording import Axis, FloatArray
from ident.evidence.gathering import Evidence
from ident.fit.added_columns import CHANCE, Added, added
from ident.fit.circumstances import Circumstances
from ident.fit.law_model import SIGN
from ident.fit.parameters import UNITS
from ident.fit.predictions import directions, measured, predicted
from ident.fit.residual_tests import runs_test
from ident.fit.weighting import Weighted, law_slopes

WAVES = 6  # slow ones over the ranks of the speeds
DRIFT_CHANCE = 2e-3  # of a drift, of those that are large enough to matter
DRIFT_MATTERS = 0.005  # part of the friction by which a drift over the recording is worth a word
WITHIN_MATTERS = 0.02  # and one within runs, which still may settle
LEAST_ALIKE = 12  # runs that may change alike by chance
SAME_SPEED = 0.02  # relative difference of speeds that are replicates
LEAST_REPLICATES = 3  # degrees of freedom within speeds
SPEED_SHARE = 0.3  # of the torque's error


def residual_findings(
    evidence: Evidence, weighted: Weighted, seen: Circumstances, axis: Axis
) -> tuple[Finding, ...]:
    """Everything that the residuals betray."""
    found = [
        *_drift(weighted, seen, axis),
        *_drift_within(evidence, axis),
        *_replicates(weighted),
        *_bends(weighted),
        *_speed_errors(evidence, weighted),
    ]
    return tuple(found)


def _drift(weighted: Weighted, seen: Circumstances, axis: Axis) -> list[Finding]:
    time, groups = np.zeros_like(seen.time), []
    for number in np.unique(seen.group):
        own = seen.group == number
        time[own] = seen.time[own] - np.mean(seen.time[own])
        groups.append(own.astype(np.float64))
    span = float(np.ptp(time))
    if span == 0.0:
        return []
    size = predicted(weighted.data, weighted.fit.values)
    sign, unit = directions(weighted.data), UNITS[axis]["torque_offset"]
    # The mean of one group is the law's; those of many logs are not, or drift between them would count.
    means = np.column_stack(groups) if len(groups) > 1 else np.zeros((time.size, 0))
    friction = added(weighted, (time / span * size)[:, None], groups=means * size[:, None])
    offset = added(weighted, (time / span * sign)[:, None], groups=means * sign[:, None])
    over = f"over {span:.3g} s of recording" if len(groups) == 1 else f"within logs, over {span:.3g} s"
    advice = "Warm the rig up, repeat the first speed at the end, and mix the order of the speeds."
    typical = float(np.median(size))
    if _drifts(friction, DRIFT_MATTERS):
        part = float(friction.coefficients[0])
        text = (
            f"friction changes by {100 * part:+.2g} % ({part * typical:+.2g} {unit}) {over} "
            f"(p = {friction.chance:.1g}): the law is that of the middle of the recording, and where speeds "
            f"were run in order the change bends b and F_c. {advice}"
        )
        return [Finding("E-DRIFT", Severity.WARN, text)]
    if _drifts(offset, DRIFT_MATTERS * typical):
        text = (
            f"an offset of the torque changes by {float(offset.coefficients[0]):+.2g} {unit} {over} "
            f"(p = {offset.chance:.1g}): F_c and F_s of the two directions are moved against each other. "
            f"Zero the torque sensor. {advice}"
        )
        return [Finding("E-DRIFT", Severity.WARN, text)]
    return []


def _drifts(column: Added | None, least: float) -> TypeGuard[Added]:
    """Whether a column is no chance, and so large that it matters."""
    return column is not None and column.chance < DRIFT_CHANCE and abs(float(column.coefficients[0])) > least


def _drift_within(evidence: Evidence, axis: Axis) -> list[Finding]:
    """Runs over which the torque changes alike; where waves over the position are known, those explain it."""
    runs = [run for run in evidence.used_runs if np.isfinite(run.torque_change)]
    if evidence.waves or len(runs) < LEAST_ALIKE:
        return []
    change = np.array([run.torque_change for run in runs])
    sign = np.array([run.direction for run in runs])
    size = np.array([abs(run.torque) for run in runs])
    for what, own in (("friction", sign * change), ("an offset of the torque", change)):
        chance = float(wilcoxon(own / size).pvalue)
        typical = float(np.median(own))
        if chance < DRIFT_CHANCE and abs(typical) > WITHIN_MATTERS * float(np.median(size)):
            text = (
                f"{what} changes by {typical:+.2g} {UNITS[axis]['torque_offset']} within each run, in most "
                f"of {len(runs)} alike (p = {chance:.1g}): the law is that of the middle of the runs, and a "
                "breakaway or a motion is met by another. Warm the rig up and let each speed run in, or "
                "look for what varies with the position if all runs begin at one place."
            )
            return [Finding("E-DRIFT", Severity.WARN, text)]
    return []


def _replicates(weighted: Weighted) -> list[Finding]:
    """The lack-of-fit F test (Draper and Smith 1998, sec. 2.1) on runs at equal speeds."""
    data = weighted.data
    runs = slice(0, data.torque.size)
    residual = (measured(data) - predicted(data, weighted.fit.values))[runs] / data.run_stderr
    within, degrees = 0.0, 0
    for own in _equal_speeds(data.run_direction * data.speed):
        weight = data.run_stderr[own] ** -2.0
        mean = float(np.sum(residual[own] * weight**0.5) / np.sum(weight))
        within += float(np.sum((residual[own] - mean * weight**0.5) ** 2))
        degrees += own.size - 1
    law = sum(name != "inertia" for name in weighted.fit.free)
    spare = residual.size - degrees - law
    if degrees < LEAST_REPLICATES or spare < 1 or within <= 0.0:
        return []
    lack = max(float(np.sum(residual**2)) - within, 0.0)
    chance = float(fisher.sf(lack / spare / (within / degrees), spare, degrees))
    if chance >= CHANCE:
        return []
    times = float(np.sqrt(lack / spare / (within / degrees)))
    text = (
        f"runs repeated at one speed scatter {times:.2g} times less about each other than speeds do about "
        f"the law (F test, p = {chance:.1g}): the law does not fit, and values and intervals are conditional "
        "on it. Try --free-beta, and look for drift and for speeds that a loop or a resonance disturbs."
    )
    return [Finding("E-LACKOFFIT", Severity.WARN, text)]


def _equal_speeds(velocity: FloatArray) -> list[NDArray[np.int64]]:
    """Indices of runs at equal signed speeds (n,), groups of at least two."""
    order = np.argsort(velocity)
    steps = np.diff(velocity[order]) > SAME_SPEED * np.abs(velocity[order][1:])
    return [own for own in np.split(order, np.flatnonzero(steps) + 1) if own.size > 1]


def _bends(weighted: Weighted) -> list[Finding]:
    """Order of a direction's residuals over its speeds."""
    data = weighted.data
    residual = (data.torque - predicted(data, weighted.fit.values)[: data.torque.size]) / data.run_stderr
    found = []
    for direction in data.model.directions:
        own = data.run_direction == SIGN[direction]
        signs = runs_test(residual[own], data.speed[own], name=direction)
        smooth = added(weighted, _slow_waves(data.speed, own, data.start_torque.size))
        chances = [test.chance for test in (signs, smooth) if test is not None]
        if not chances or min(chances) >= 0.5 * CHANCE:
            continue
        text = (
            f"{direction} direction: over {int(own.sum())} speeds the residuals follow each other "
            f"(p = {min(chances):.1g}), {_typical(residual[own] * data.run_stderr[own]):.2g} in size: the "
            "law does not follow the measured curve, and values and intervals are conditional on it. Try "
            "--free-beta; look at figure 2 for the speeds that stand off."
        )
        found.append(Finding("E-LACKOFFIT", Severity.WARN, text))
    return found


def _slow_waves(speed: FloatArray, own: NDArray[np.bool_], starts: int) -> FloatArray:
    """cos(pi k s), k = 1 ... WAVES, s the rank of a direction's speeds from 0 to 1 (n + m, WAVES) [-]."""
    rank = (rankdata(speed[own]) - 0.5) / max(int(own.sum()), 1)
    columns = np.zeros((speed.size + starts, WAVES))
    columns[: speed.size][own] = np.cos(np.pi * np.outer(rank, np.arange(1, WAVES + 1)))
    return columns


def _typical(residual: FloatArray) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _speed_errors(evidence: Evidence, weighted: Weighted) -> list[Finding]:
    speed = np.array([run.velocity_stderr for run in evidence.used_runs])
    from_speed = np.abs(law_slopes(weighted.data, weighted.fit)) * speed
    rest = np.sqrt(np.maximum(weighted.data.run_stderr**2 - from_speed**2, 0.0))
    large = from_speed > SPEED_SHARE * rest
    if not np.any(large):
        return []
    worst = int(np.argmax(from_speed / np.maximum(weighted.data.run_stderr, 1e-300)))
    run = evidence.used_runs[worst]
    text = (
        f"{int(large.sum())} of {large.size} runs: the error of the speed, times the slope of the law, is "
        f"over {SPEED_SHARE:g} of the torque's other errors; most in {run.log} at {run.velocity:.3g}, with "
        f"{from_speed[worst]:.2g} beside {rest[worst]:.2g}. These runs are given that error too, and v_s and "
        "F_s are less well known for it. Record slow speeds for longer, or with a finer encoder."
    )
    return [Finding("E-SPEEDERR", Severity.WARN, text)]

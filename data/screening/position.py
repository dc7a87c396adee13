"""E-WRAP and E-SPIKE: positions that wrap, and single ones that are wrong."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from data.findings import Finding, LogError
from data.screening.run import FloatArray, Run, warning

LONG: Final = 1.5  # sample periods, from which on a step is one over lost samples
_BESIDE: Final = 20  # steps on either side whose speed it may have had
_SPIKE_WINDOW: Final = 25  # samples on either side for the local spread


def unwrap(run: Run, resolution: float | None) -> tuple[Run, tuple[Finding, ...]]:
    """E-WRAP: undo jumps by a turn, or by a power of two counts."""
    steps = np.diff(run.position)
    typical = float(np.median(np.abs(steps)))
    largest = float(np.max(np.abs(steps)))
    moved = _moved(run, steps)
    for modulus in _moduli(resolution, largest):
        sizes = np.abs(steps - moved)
        alone = np.maximum(np.roll(sizes, 1), np.roll(sizes, -1)) < 0.5 * modulus  # or it is a fast motion
        jumps = np.flatnonzero((np.abs(sizes - modulus) < 0.02 * modulus) & alone)
        if not jumps.size or typical > 0.05 * modulus or jumps.size > 0.02 * steps.size + 4:
            continue
        mended = steps.copy()
        mended[jumps] -= np.sign((steps - moved)[jumps]) * modulus
        around = np.abs(np.stack((np.roll(mended, 1), np.roll(mended, -1))))
        fits = np.abs(mended - moved) <= 3.0 * around.max(axis=0) + 4.0 * (resolution or 0.0) + 1e-9 * modulus
        if not np.all(fits[jumps]):
            k = int(jumps[~fits[jumps]][0])
            raise LogError(
                f"{run.log}: E-WRAP refuse: the position jumps by {steps[k]:.6g} at t = {run.time[k]:.6g} s, "
                f"near a turn of {modulus:.6g}, but the speeds on both sides do not fit; every speed across "
                "it would be wrong. Cut the run there with `window`"
            )
        position = run.position[0] + np.concatenate(([0.0], np.cumsum(mended)))
        position = run.position + np.rint((position - run.position) / modulus) * modulus
        text = (
            f"the position wraps {jumps.size} times by {modulus:.6g}, first at t = "
            f"{run.time[jumps[0]]:.6g} s; it was unwrapped, which leaves every speed as it was"
        )
        return replace(run, position=position), (warning("E-WRAP", text, run),)
    return run, ()


def _moved(run: Run, steps: FloatArray) -> FloatArray:
    """How far the link went in each step (n - 1,) that lasts long [rad], at the speed beside it; else 0."""
    lasted = np.diff(run.time)
    size, moved = np.abs(steps), np.zeros_like(steps)
    for k in np.flatnonzero(lasted > LONG * float(np.median(lasted))).tolist():
        near = np.r_[max(k - _BESIDE, 0) : k, k + 1 : min(k + 1 + _BESIDE, steps.size)]
        near = near[size[near] <= 3.0 * float(np.median(size[near]))] if near.size else near  # no wrap there
        gone = float(np.sum(lasted[near]))
        moved[k] = float(np.sum(steps[near])) / gone * lasted[k] if gone > 0.0 else 0.0
    return moved


def _moduli(resolution: float | None, largest: float) -> list[float]:
    """Sizes of a wrap that the largest step may be: a turn, or 2^n counts from 8 bits on."""
    sizes = [2.0 * math.pi]
    if resolution is not None and largest > 200.0 * resolution:
        sizes.append(resolution * 2.0 ** round(math.log2(largest / resolution)))
    return sizes


def drop_spikes(run: Run, resolution: float | None) -> tuple[Run, tuple[Finding, ...]]:
    """E-SPIKE: drop single samples that leave the path and come back.

    A sample is wrong when it lies off the mean of its neighbours by more than six counts and eight times the
    local spread of that distance, and each neighbour lies half as far off on the other side: the mark that a
    single sample leaves, and that neither an impact nor an onset of motion does.
    """
    q = run.position
    off = q[1:-1] - 0.5 * (q[:-2] + q[2:])
    distance = np.abs(off)
    floor = 6.0 * (resolution or _smallest_step(q)) + 1e-9 * float(np.ptp(q))
    beside = np.stack((np.roll(off, 1), np.roll(off, -1)))
    alone = np.all(np.abs(beside + 0.5 * off) < 0.2 * distance, axis=0)
    suspects = np.flatnonzero(alone & (distance > floor) & (distance > 8.0 * float(np.median(distance))))
    wrong: list[int] = []
    for k in suspects.tolist():
        window = distance[max(0, k - _SPIKE_WINDOW) : k + _SPIKE_WINDOW + 1]
        quiet = np.sort(window)[: int(0.75 * window.size)]
        spread = 1.4826 * float(np.median(window))
        if distance[k] > max(8.0 * spread, 4.0 * float(quiet[-1])):
            wrong.append(k + 1)
    if not wrong:
        return run, ()
    share = len(wrong) / q.size
    seen = (
        f"{len(wrong)} single positions of {q.size} lie off the path of their neighbours, the first by "
        f"{off[wrong[0] - 1]:.3g} at t = {run.time[wrong[0]]:.6g} s"
    )
    if share > 0.01 and len(wrong) > 2:
        raise LogError(
            f"{run.log}: E-SPIKE refuse: {seen}; with so many wrong samples no speed can be trusted. "
            "Mend the encoder's cable and record the run again"
        )
    keep = np.ones(q.size, np.bool_)
    keep[wrong] = False
    return run.keep(keep), (warning("E-SPIKE", f"{seen}; they were dropped", run),)


def _smallest_step(position: FloatArray) -> float:
    """The smallest step of positions (n,) [rad]: a count, where they have too few values to show one."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-12 * float(np.max(np.abs(position), initial=0.0))]
    return float(steps.min()) if steps.size else 0.0

"""E-CLOCK and E-GAP: time that does not advance, leaps, or has holes."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from data.clocks import Advancing, advancing
from data.findings import Finding, LogError
from data.protocols import IDENTIFIES
from data.screening.run import FloatArray, Run, warning

# Protocols of which each part of a split run says something by itself.
TAKEN_APART: Final = frozenset({"breakaway", "constant_velocity", "excitation"})
FEWEST_SAMPLES: Final = 10
GAP: Final = 3.0  # median steps
_YEARS: Final = 1e8  # [s] between two samples of no run


def advance(run: Run, clock: str) -> tuple[Run, tuple[Finding, ...]]:
    """E-CLOCK: a run whose clock stands still, jumps back or is out of order, put right or taken apart."""
    found = advancing(run.time, fewest=FEWEST_SAMPLES)
    if found.first is None:
        _require_one_epoch(run, np.diff(run.time), clock)
        return run, ()
    k, step = found.first
    back = f"jumps back by {-step:.6g} s" if step < -1e-12 else "stands still"
    places = int(np.count_nonzero(np.diff(run.time) <= 0.0))
    seen = f"the clock ({clock}) {back} at sample {k}, t = {run.time[k - 1]:.6f} s" + (
        f", and at {places - 1} more places" if places > 1 else ""
    )
    if not found.kept.size:
        raise LogError(
            f"{run.log}: E-CLOCK refuse: {seen}; no part of the run in which it advances has "
            f"{FEWEST_SAMPLES} samples, so that no speed can be told, and nothing of "
            f"{IDENTIFIES[run.protocol]}. Choose another `clock` or time signal, or record it again"
        )
    lost = {int(np.argmax(found.kept >= place)) for place in run.breaks if place <= found.kept.max()}
    breaks = tuple(sorted({*found.breaks, *lost} - {0}))
    mended = replace(run.taken(found.kept), time=found.time, breaks=breaks)
    done = [*_said(found)]
    if found.breaks and run.protocol not in TAKEN_APART:
        edges = np.array([0, *breaks, found.kept.size])
        longest = int(np.argmax(np.diff(edges)))
        mended = mended.taken(np.arange(edges[longest], edges[longest + 1]))
        done.append(f"of its parts only the longest is used, from t = {mended.time[0]:.6g} s")
    _require_one_epoch(mended, np.diff(mended.time), clock)
    return mended, (warning("E-CLOCK", f"{seen}; {'; '.join(done)}", run),)


def long_parts(run: Run) -> tuple[Run, tuple[Finding, ...]]:
    """E-GAP: a run of which samples were lost, without the parts that are too short to say anything."""
    if not run.breaks:
        return run, ()
    sizes = np.diff([0, *run.breaks, run.time.size])
    kept = sizes >= FEWEST_SAMPLES
    if run.protocol not in TAKEN_APART:
        kept &= np.arange(sizes.size) == np.argmax(sizes)
    if kept.all():
        return run, ()
    samples = np.repeat(kept, sizes)
    if not samples.any():
        raise LogError(
            f"{run.log}: E-GAP refuse: what is lost leaves no part of the run with {FEWEST_SAMPLES} samples, "
            f"so that no speed can be told, and nothing of {IDENTIFIES[run.protocol]}. Exclude the log"
        )
    text = (
        f"what is lost takes the run apart; {np.count_nonzero(kept)} of its {sizes.size} parts are used, "
        f"{np.count_nonzero(~samples)} samples in the others left out"
    )
    return run.keep(samples), (warning("E-GAP", text, run),)


def _said(found: Advancing) -> list[str]:
    """What was done about a clock that does not advance."""
    done = []
    if found.late:
        done.append(f"{found.late} samples that came late were sorted in by their stamps")
    if found.wrong:
        done.append(f"{found.wrong} samples with a wrong stamp between two right ones were left out")
    if found.breaks:
        done.append(
            f"the run was split into {len(found.breaks) + 1} parts: how long the motion between them took is "
            "not known, no speed is taken across, and the time is counted on from part to part"
        )
    if found.short:
        done.append(f"{found.short} samples in parts of under {FEWEST_SAMPLES} were left out")
    return done


def _require_one_epoch(run: Run, step: FloatArray, clock: str) -> None:
    k = int(np.argmax(step))
    if step[k] < _YEARS:
        return
    raise LogError(
        f"{run.log}: E-CLOCK refuse: the clock ({clock}) jumps ahead by {step[k]:.6g} s, over three years, "
        f"at sample {k + 1}, t = {run.time[k]:.6g} s: some of its stamps were never set, or count from "
        "another date; the motion across it cannot be told. Choose another `clock` or time signal, or keep "
        "one side with `window`"
    )


def gaps(run: Run, clock: str) -> tuple[Finding, ...]:
    """E-GAP: steps of over three medians."""
    step = np.diff(run.time)
    median = float(np.median(step))
    step[np.array(run.breaks, np.intp) - 1] = median
    wide = np.flatnonzero(step > GAP * median)
    if not wide.size:
        return ()
    k = int(wide[np.argmax(step[wide])])
    text = (
        f"{wide.size} steps of the clock ({clock}) exceed {GAP:g} times the median of {median:.6g} s, the "
        f"longest {step[k]:.6g} s at t = {run.time[k]:.6g} s; no derivative is taken across them"
    )
    return (warning("E-GAP", text, run),)

r"""Where one run of the sampled loop ends up, watched no longer than it takes.

A run is watched in stretches, each going on where the last one ended, until its verdict stands:

- *at rest for good* or *run away*: the loop itself ends the run (`sampled_loop`), nothing is left to judge;
- else what it has shown so far is judged as a recording would be (`orbits.steady_state`), and a run that is
  still undecided is watched for longer, as long as its samples last.

The samples of a run are bounded because time is: a loop that turns a thousand times slower, or samples a
hundred times faster, than another must not take a thousand times longer to answer for. A run whose
samples are spent stays undecided, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from compensation.controller import Controller
from compensation.orbits.steady_state import SteadyState, classify
from compensation.sampled_loop import LongRun, Sampling
from ident.model.friction import ModelError
from ident.model.numbers import is_count, is_number, real_array, shown
from ident.model.robot import OneLinkRobot

FloatArray = NDArray[np.float64]
MOST_SAMPLES: Final = 300_000  # of a run that is watched for longer than its first stretch
SHORT_OF: Final = 0.5  # of a stretch: so much of it is worth watching where the samples do not last for all


@dataclass(frozen=True)
class SampledEnd:
    """Where a run ends up."""

    state: SteadyState
    x1_min: float | None  # [rad] at rest, or over the last period; None: undecided
    x1_max: float | None  # [rad]
    samples: int  # that were run


def sampled_end(
    robot: OneLinkRobot,
    controller: Controller,
    sampling: Sampling,
    *,
    start: float,
    stretches: Sequence[float],
    reference: float = 0.0,
    most_samples: int = MOST_SAMPLES,
) -> SampledEnd:
    """Watch a run from rest at `start` (q [rad]) until one of the times `stretches` [s], rising, decides it.

    The first stretch is always watched; the others as far as `most_samples` samples last. Raises `ModelError`
    for a start or stretches that are none.
    """
    if not is_number(start):
        raise ModelError(f"start is {start!r}: a finite q [rad] (eq 1)")
    times = real_array(stretches)
    if times is None or times.ndim != 1 or times.size == 0 or not _rise(times):
        raise ModelError(
            f"stretches are {shown(stretches)}: rising, finite numbers of seconds > 0 (eq 8, as sampled)"
        )
    if not (is_count(most_samples) and most_samples >= 1):
        raise ModelError(f"most_samples is {most_samples!r}: a whole number >= 1 (eq 8, as sampled)")
    run = LongRun(robot, controller, sampling, start=(start, 0.0), reference=reference)
    x1 = np.empty(0)
    made = 0
    state = SteadyState("undecided", None, None, None, "not watched")
    for number, stretch in enumerate(stretches):
        until = math.floor(stretch / sampling.period * (1 + 1e-12)) + 1
        if number > 0:
            until = min(until, most_samples)
            if until - x1.size < SHORT_OF * x1.size:
                return _given_up(state, made, x1.size * sampling.period)
        rows = np.empty((1, until - x1.size))
        more = run.fill(rows)
        made += more
        if run.end == "runs away":
            return SampledEnd(_run_away(made, controller, sampling), None, None, made)
        x1 = np.concatenate((x1, rows[0] - reference))
        if run.end == "at rest for good":
            return _at_rest(float(x1[-1]), made, sampling)
        time = sampling.period * np.arange(x1.size, dtype=np.float64)
        state = classify(time, x1, resolution=sampling.resolution)
        if state.verdict != "undecided":
            break
    return _judged(state, x1, sampling.period, made)


def _rise(times: FloatArray) -> bool:
    return bool(np.all(np.isfinite(times)) and times[0] > 0.0 and np.all(np.diff(times) > 0.0))


def _at_rest(place: float, made: int, sampling: Sampling) -> SampledEnd:
    why = f"rests for good after {made * sampling.period:.3g} s"
    return SampledEnd(SteadyState("equilibrium", place, None, None, why), place, place, made)


def _run_away(made: int, controller: Controller, sampling: Sampling) -> SteadyState:
    product = controller.gains.observer * sampling.period
    why = (
        f"the sampled controller is unstable: its estimate runs away within {made * sampling.period:.3g} s "
        f"(L h = {product:.3g}). Sample faster, or lower L or n1"
    )
    return SteadyState("undecided", None, None, None, why)


def _given_up(state: SteadyState, made: int, watched: float) -> SampledEnd:
    why = f"{state.why}; watched for {watched:.4g} s, {made} samples, and no longer"
    return SampledEnd(replace(state, why=why), None, None, made)


def _judged(state: SteadyState, x1: FloatArray, period: float, made: int) -> SampledEnd:
    if state.verdict == "equilibrium":
        return SampledEnd(state, state.position_error, state.position_error, made)
    if state.verdict == "undecided" or state.period is None:
        return SampledEnd(state, None, None, made)
    last = x1[max(0, x1.size - 1 - math.floor(state.period / period)) :]
    return SampledEnd(state, float(last.min()), float(last.max()), made)

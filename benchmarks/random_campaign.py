"""Random starts, gains and laws: nothing may loop for ever, break off or end for a wrong reason.

Laws differ by direction, robot and model differ, beta is 0.5 to 2 (1 for half of them, where series serve), r
is 0 to 2. An end reason is checked by a restart: from an equilibrium the link must not move any more.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from compensation.loop_parameters import COLUMNS, ROWS, mode_table
from compensation.loop_runs import run_for
from compensation.many_trajectories import run_every
from ident.simulation.integrate import EQUILIBRIUM, TIME_REACHED

DURATION: Final = 5.0  # [s]
AFTERWARDS: Final = 1.0  # [s] of the restart
TOLERANCE: Final = 1e-9
MOVED: Final = 1e-7  # [rad] that a link at rest may not move

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Failures:
    """How many of the trajectories failed, and how."""

    unfinished: int  # neither time reached nor equilibrium
    not_finite: int
    not_at_rest: int  # an equilibrium that moves on a restart


def run_campaign(count: int, generator: np.random.Generator) -> Failures:
    """`count` random trajectories."""
    tables, starts = random_tables(count, generator), generator.normal(size=(count, 3))
    starts[:, 0] *= 0.5
    ends, reasons = _run(tables, starts, DURATION)
    resting = reasons == EQUILIBRIUM
    later, _ = _run(tables[resting], ends[resting], AFTERWARDS)
    moved = np.abs(later[:, 0] - ends[resting, 0])
    return Failures(
        unfinished=int(np.sum((reasons != TIME_REACHED) & ~resting)),
        not_finite=int(np.sum(~np.isfinite(ends).all(axis=1))),
        not_at_rest=int(np.sum(~(moved <= MOVED))),
    )


def random_tables(count: int, generator: np.random.Generator) -> FloatArray:
    """Mode parameters (count, 6, 16) of random robots under random controllers."""
    laws = np.empty((count, 4, 5))  # robot positive, negative, model positive, negative
    laws[..., 1] = generator.uniform(0.05, 0.6, (count, 4))
    laws[..., 0] = laws[..., 1] * generator.uniform(1.0, 1.8, (count, 4))
    laws[..., 2] = np.exp(generator.uniform(np.log(0.01), np.log(0.5), (count, 4)))
    laws[..., 3] = generator.uniform(0.0, 0.2, (count, 4))
    shape = np.where(generator.random((count, 1)) < 0.5, 1.0, generator.uniform(0.5, 2.0, (count, 1)))
    laws[..., 4] = shape
    same = generator.random(count) < 0.3  # the model is the robot
    laws[same, 2:] = laws[same, :2]
    inertia = generator.uniform(0.01, 0.1, (count, 2))
    inertia[same, 1] = inertia[same, 0]
    gains = np.column_stack(
        [
            generator.uniform(0.05, 2.0, count),
            generator.uniform(0.0, 0.1, count),
            generator.uniform(1.0, 150.0, count),
            np.where(generator.random(count) < 0.1, 1.0, generator.uniform(0.0, 2.0, count)),
        ]
    )
    tables = np.zeros((count, ROWS, COLUMNS))
    for i in range(count):
        mode_table(laws[i], inertia[i], gains[i], tables[i])
    return tables


def _run(tables: FloatArray, starts: FloatArray, duration: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Ends (n, 3) and reasons (n,)."""
    ends = starts.copy()
    times, states = np.empty(0), np.empty((starts.shape[0], 0, 3))
    end_times, reasons = np.empty(starts.shape[0]), np.empty(starts.shape[0], np.int64)
    runs = np.array([run_for(table) for table in tables])
    parts = os.cpu_count() or 1

    def run_part(part: int) -> None:
        run_every(runs, tables, part, parts, TOLERANCE, duration, ends, times, states, end_times, reasons)

    with ThreadPoolExecutor(parts) as threads:
        list(threads.map(run_part, range(parts)))
    return ends, reasons

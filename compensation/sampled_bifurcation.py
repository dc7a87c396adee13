r"""Where the sampled loop ends up over r or L: limit cycles found by simulation.

The continuous loop's branches can be continued, see `bifurcation`. The loop as a rig runs it, with a sample
period and encoder counts, is a discrete map with rounding: its cycles are found by running it. At every value
of the parameter it runs from two starts, far out on either side, until it is known what becomes of it
(`sampled_ends`). The larger cycle of the two counts.
Where neighbouring values end up differently the onset between them is bisected.

Its rests: between samples nothing distinguishes a sampled from a continuous controller once the link and the
estimate are still, so the equilibrium sets are those of the continuous loop, up to a count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from compensation.bifurcation import Bifurcation, Branch, Point
from compensation.controller import Controller, with_gain
from compensation.sampled_ends import MOST_SAMPLES, SampledEnd, sampled_end
from compensation.sampled_loop import Map, Sampling
from ident.model.friction import ModelError
from ident.model.numbers import real_array, shown
from ident.model.robot import OneLinkRobot

_TURNS: Final = 40.0  # of the undamped loop, 2 pi sqrt(J/n1), that a run lasts
_START: Final = 1.2  # of F_s/n1, the largest rest error without compensation
_STRETCHES: Final = (0.5, 1.0)  # of that time, after which a run is judged
_BATCH: Final = 8  # values between two ticks
_BISECTIONS: Final = 7  # of the interval of the sweep that an onset lies in
_ONSET: Final = "onset of limit cycling (sampled)"


@dataclass(frozen=True)
class SampledCycles:
    """The limit cycles of a sampled loop over a parameter, and where they set in."""

    branches: tuple[Branch, ...]
    onsets: tuple[Bifurcation, ...]
    undecided: tuple[float, ...]  # [parameter's unit] values where a run was neither rest nor cycle
    duration: float  # of a run, at most [s]
    starts: tuple[float, ...]  # x1 [rad], with v = 0


def sampled_cycles(
    robot: OneLinkRobot,
    controller: Controller,
    sampling: Sampling,
    *,
    parameter: Literal["r", "L"],
    values: Sequence[float],
    map: Map = map,
    tick: Callable[[int], None] | None = None,
) -> SampledCycles:
    """Limit cycles over `values` of r [-] or L [1/s], rising; `tick` hears how many values are done.

    Raises `ModelError` for another parameter, or values that are no rising gains.
    """
    grid = real_array(values)
    if grid is None or grid.ndim != 1 or grid.size == 0 or not np.all(np.diff(grid) > 0.0):
        raise ModelError(f"values of {parameter} are {shown(values)}: a list of rising numbers (eqs 6-7)")
    for value in grid[[0, -1]].tolist():
        with_gain(controller, parameter, value)  # refuses what is no gain
    most = MOST_SAMPLES * sampling.period
    duration = min(settling_time(robot, controller), most)
    far = _START * max(_static(robot)) / controller.gains.proportional
    starts = (far, -far)

    def ends(batch: Sequence[float]) -> list[Point | str]:
        runs = [(with_gain(controller, parameter, value), x1) for value in batch for x1 in starts]
        found = list(map(watched, runs))
        return [
            _larger([_judged(value, run) for run in found[2 * k : 2 * k + 2]])
            for k, value in enumerate(batch)
        ]

    def watched(run: tuple[Controller, float]) -> SampledEnd:
        stretches = [part * duration for part in _STRETCHES]
        return sampled_end(robot, run[0], sampling, start=run[1], stretches=stretches)

    found: list[Point | str] = []
    for first in range(0, len(values), _BATCH):
        batch = values[first : first + _BATCH]
        found += ends(batch)
        if tick is not None:
            tick(len(batch))
    return SampledCycles(
        branches=_branches(found),
        onsets=_onsets(values, found, ends),
        undecided=tuple(value for value, end in zip(values, found, strict=True) if end == "undecided"),
        duration=duration,
        starts=starts,
    )


def settling_time(robot: OneLinkRobot, controller: Controller) -> float:
    """How long a run lasts [s]: many turns of the loop, several time constants of its damping."""
    inertia, gains = robot.inertia, controller.gains
    turn = 2.0 * math.pi * math.sqrt(inertia / gains.proportional)
    damping = gains.derivative + min(
        robot.friction.positive.viscous_damping, robot.friction.negative.viscous_damping
    )
    return max(_TURNS * turn, 10.0 * damping / gains.proportional)


def _static(robot: OneLinkRobot) -> tuple[float, float]:
    return robot.friction.positive.static_torque, robot.friction.negative.static_torque


def _judged(value: float, end: SampledEnd) -> Point | str:
    """The cycle that a run ends in as a point, else the verdict."""
    state = end.state
    if state.amplitude is None or end.x1_min is None or end.x1_max is None:
        return state.verdict
    return Point(
        value=float(value),
        x1_min=end.x1_min,
        x1_max=end.x1_max,
        amplitude=state.amplitude,
        period=state.period,
    )


def _larger(found: Sequence[Point | str]) -> Point | str:
    """The larger cycle of a value's runs; without one, "undecided" if any run is."""
    cycles = [point for point in found if isinstance(point, Point)]
    if cycles:
        return max(cycles, key=lambda point: point.amplitude)
    return "undecided" if "undecided" in found else "equilibrium"


def _branches(points: Sequence[Point | str]) -> tuple[Branch, ...]:
    """Neighbouring cycles joined; a value without a cycle parts two branches."""
    runs: list[list[Point]] = [[]]
    for point in points:
        if isinstance(point, Point):
            runs[-1].append(point)
        elif runs[-1]:
            runs.append([])
    return tuple(Branch(kind="limit_cycle", stable=True, points=tuple(run)) for run in runs if run)


def _onsets(
    values: Sequence[float],
    found: Sequence[Point | str],
    ends: Callable[[Sequence[float]], list[Point | str]],
) -> tuple[Bifurcation, ...]:
    """Where rest turns into a cycle or back, by bisection between neighbouring values."""
    onsets = []
    for k in range(1, len(found)):
        before = isinstance(found[k - 1], Point)
        if isinstance(found[k], Point) == before:
            continue
        low, high = values[k - 1], values[k]
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if isinstance(ends([middle])[0], Point) == before else (low, middle)
        onsets.append(Bifurcation(value=0.5 * (low + high), kind=_ONSET))
    return tuple(onsets)

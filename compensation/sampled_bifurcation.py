r"""Where the sampled loop ends up over r or L: limit cycles found by simulation.

The continuous loop's branches can be continued, see `bifurcation`. The loop as a rig runs it, with a sample
period and encoder counts, is a discrete map with rounding: its cycles are found by running it. At every value
of the parameter it runs from two starts, far out on either side, long enough to settle; what the position
does at the end is judged as a recording would be (`orbits.steady_state`). The larger cycle of the two counts.

Its rests: between samples nothing distinguishes a sampled from a continuous controller once the link and the
estimate are still, so the equilibrium sets are those of the continuous loop, up to a count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from compensation.bifurcation import Bifurcation, Branch, Point
from compensation.controller import Controller
from compensation.orbits.steady_state import classify
from compensation.sampled_loop import Map, Sampling, run_many
from ident.model.robot import OneLinkRobot

FloatArray = NDArray[np.float64]
_TURNS: Final = 40.0  # of the undamped loop, 2 pi sqrt(J/n1), that a run lasts
_START: Final = 1.2  # of F_s/n1, the largest rest error without compensation
_BATCH: Final = 8  # runs that are held in memory at a time
_ONSET: Final = "onset of limit cycling (sampled)"


@dataclass(frozen=True)
class SampledCycles:
    """The limit cycles of a sampled loop over a parameter, and where they set in."""

    branches: tuple[Branch, ...]
    onsets: tuple[Bifurcation, ...]
    undecided: tuple[float, ...]  # [parameter's unit] values where a run was neither rest nor cycle
    duration: float  # of each run [s]
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
    """Limit cycles over `values` of r [-] or L [1/s], rising; `tick` hears how many values are done."""
    duration = settling_time(robot, controller)
    far = _START * max(_static(robot)) / controller.gains.proportional
    starts = (far, -far)
    points: list[Point | None] = []
    undecided: list[float] = []
    for first in range(0, len(values), _BATCH):
        batch = values[first : first + _BATCH]
        controllers = [with_gain(controller, parameter, value) for value in batch for _ in starts]
        positions = run_many(
            [robot],
            controllers,
            sampling,
            starts=[(x1, 0.0) for _ in batch for x1 in starts],
            duration=duration,
            map=map,
        )
        for k, value in enumerate(batch):
            found = [_judged(value, run, sampling) for run in positions[2 * k : 2 * k + 2]]
            cycles = [point for point in found if isinstance(point, Point)]
            points.append(max(cycles, key=lambda point: point.amplitude, default=None))
            if not cycles and "undecided" in found:
                undecided.append(value)
        if tick is not None:
            tick(len(batch))
    return SampledCycles(
        branches=_branches(points),
        onsets=_onsets(values, points),
        undecided=tuple(undecided),
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


def with_gain(controller: Controller, parameter: Literal["r", "L"], value: float) -> Controller:
    """The controller with another r [-] or L [1/s]."""
    name = "compensation" if parameter == "r" else "observer"
    return Controller(replace(controller.gains, **{name: float(value)}), controller.model)


def _static(robot: OneLinkRobot) -> tuple[float, float]:
    return robot.friction.positive.static_torque, robot.friction.negative.static_torque


def _judged(value: float, position: FloatArray, sampling: Sampling) -> Point | str:
    """The cycle that a run ends in as a point, else the verdict."""
    time = sampling.period * np.arange(position.size, dtype=np.float64)
    state = classify(time, position, resolution=sampling.resolution)
    if state.verdict != "limit_cycle" or state.period is None or state.amplitude is None:
        return state.verdict
    last = position[time >= time[-1] - state.period]
    return Point(
        value=float(value),
        x1_min=float(last.min()),
        x1_max=float(last.max()),
        amplitude=state.amplitude,
        period=state.period,
        multipliers=(),
    )


def _branches(points: Sequence[Point | None]) -> tuple[Branch, ...]:
    """Neighbouring cycles joined; a value without a cycle parts two branches."""
    runs: list[list[Point]] = [[]]
    for point in points:
        if point is not None:
            runs[-1].append(point)
        elif runs[-1]:
            runs.append([])
    return tuple(Branch(kind="limit_cycle", stable=True, points=tuple(run)) for run in runs if run)


def _onsets(values: Sequence[float], points: Sequence[Point | None]) -> tuple[Bifurcation, ...]:
    """Halfway between a value that rests and the next that cycles, or the other way."""
    return tuple(
        Bifurcation(value=0.5 * (values[k - 1] + values[k]), kind=_ONSET)
        for k in range(1, len(points))
        if (points[k] is None) != (points[k - 1] is None)
    )

"""Branches of limit cycles over a gain, r, L, n1 or n2, by continuation: stable or not, through folds.

A cycle is a fixed point of the return map on v = 0 (`loop_section`), and its branch is followed by
arclength (`orbits.continuation`), so that it may turn back (a *fold of cycles*). Each point comes with its
Floquet multipliers, stick phases and mode sequence.

Most branches of this loop neither fold nor lose stability: its cycles are superstable, and end where they
graze a surface and the map jumps. At L = 73.5 the symmetric cycle of the paper's robot ends near r - 1 =
1.1e-5, with a half-map multiplier of 3e-3: while x2 runs out towards zero it touches zero, the link halts
2 s sooner, and a pair of asymmetric cycles is left. The end is found because the solution jumps, and is
named by the event that appears; what the motion settles on beyond it begins a branch of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from compensation.closed_loop import ClosedLoop
from compensation.controller import GAIN_OF
from compensation.cycle_ends import CycleEvent, Neighbourhood, crossing, end_of
from compensation.cycle_modes import Stick, events_of, mode_sequence, stick_phases
from compensation.loop_cycles import distance, mirrored
from compensation.loop_parameters import own_time
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_starts import start_sizes
from compensation.orbits.continuation import Curve, CurveEvent, Steps, trace
from compensation.orbits.cycle_equation import JOINED, CycleEquation
from compensation.orbits.periodic_orbits import Cycle, cycle_at, find_cycle, shoot
from compensation.orbits.solution_curve import CurvePoint, Lost
from ident.model.friction import ModelError
from ident.model.numbers import is_one_of, real_array, shown
from ident.simulation.filippov_system import FloatArray

Gain = Literal["r", "L", "n1", "n2"]

VANISHED: Final = 3e-5  # of the widest cycle: extent of one that has become a point
MOST_BRANCHES: Final = 12
SAME: Final = 1e-3  # relative difference of extremes and period: so near to a known branch, a cycle is on it
BARELY: Final = 1e-9  # relative difference of gains that are one
KINDS: Final = {"fold": "fold of cycles", "label": "mode sequence"}


@dataclass(frozen=True)
class CyclePoint:
    """A cycle at one value of the gain."""

    value: float  # of the gain: r [-], L [1/s], n1 [N m/rad] or n2 [N m s/rad]
    cycle: Cycle
    modes: tuple[str, ...]  # the mode sequence of a period
    sticks: tuple[Stick, ...]


@dataclass(frozen=True)
class CycleBranch:
    """Cycles of one kind, in the order of the curve."""

    gain: Gain
    symmetric: bool  # under a change of sign with half a period
    returns: int  # of the section's map that a cycle takes
    points: tuple[CyclePoint, ...]
    events: tuple[CycleEvent, ...]  # in the same order: the first and the last say why the branch ends there


def cycle_branches(
    loop: ClosedLoop,
    gain: Gain,
    span: tuple[float, float],
    *,
    steps: Steps = Steps(),  # noqa: B008  frozen
) -> tuple[CycleBranch, ...]:
    """All branches reached from the cycles of `loop` while the gain is within `span` [its unit].

    From the first one it goes on to what crosses it, what branches off where a multiplier is -1, and what the
    motion settles on beyond an end.

    Raises
    ------
    ModelError
        If the gain is unknown, the span is empty, reaches beyond what a gain may be (eqs 5-7), or does not
        hold the loop's own gain.
    """
    value = _checked(loop, gain, span)
    section = LoopSection(loop)
    todo: list[tuple[float, Cycle]] = []
    far, near = start_sizes(loop, "r", np.array([loop.controller.gains.compensation]))[0].tolist()
    for x1 in (far, near) if section.symmetric else (far, -far, near, -near):
        cycle = find_cycle(section, np.array([x1, 0.0]))
        if isinstance(cycle, Cycle):
            todo.append((value, cycle))
    branches: list[CycleBranch] = []
    while todo and len(branches) < MOST_BRANCHES:
        at, cycle = todo.pop(0)
        if any(_is_on(cycle, at, LoopSection(with_gain(loop, gain, at)), branch) for branch in branches):
            continue
        widest = max([cycle.amplitude, *(point.cycle.amplitude for b in branches for point in b.points)])
        branch, found = _follow(loop, gain, span, at, cycle, widest, steps)
        if branch.events[0].says == JOINED and len(branch.points) == 1:
            fewer = max(part for part in range(1, cycle.returns) if cycle.returns % part == 0)
            todo.insert(0, (at, replace(cycle, returns=fewer)))
            continue
        if branches and len(branch.points) < 2:
            continue
        branches.append(branch)
        todo.extend(found)
    return tuple(branches)


def cycle_branch(
    loop: ClosedLoop,
    gain: Gain,
    span: tuple[float, float],
    cycle: Cycle,
    *,
    steps: Steps = Steps(),  # noqa: B008  frozen
) -> CycleBranch:
    """The branch through a cycle of `loop`, stable or not, both ways.

    Raises
    ------
    ModelError
        As `cycle_branches`.
    """
    return _follow(loop, gain, span, _checked(loop, gain, span), cycle, cycle.amplitude, steps)[0]


def _checked(loop: ClosedLoop, gain: Gain, span: tuple[float, float]) -> float:
    if not is_one_of(gain, GAIN_OF):
        raise ModelError(f"gain is {shown(gain)}: branches are drawn over 'r', 'L', 'n1' or 'n2' (eqs 5-7)")
    value = float(getattr(loop.controller.gains, GAIN_OF[gain]))
    ends = real_array(span)
    if ends is None or ends.shape != (2,) or not np.isfinite(ends).all():
        raise ModelError(f"span of {gain} is {shown(span)}: two gains, each a finite number (eqs 5-7)")
    low, high = ends.tolist()
    if low < 0.0 or (gain == "n1" and low == 0.0):
        least = "n1 > 0, or no position is a set point (eq 5)" if gain == "n1" else "a gain is >= 0 (eqs 5-7)"
        raise ModelError(f"span of {gain} is {span}: {least}")
    if not low <= value <= high or not low < high:
        raise ModelError(
            f"span of {gain} is {span}: an ascending pair around the loop's own {value:g} (eqs 5-7)"
        )
    return value


def _follow(
    loop: ClosedLoop,
    gain: Gain,
    span: tuple[float, float],
    value: float,
    cycle: Cycle,
    amplitude: float,
    steps: Steps,
) -> tuple[CycleBranch, list[tuple[float, Cycle]]]:
    """The branch of a cycle, and cycles at which others begin."""

    @lru_cache(maxsize=64)
    def section(at: float) -> LoopSection:
        """The loop's section; its gain may be beyond the span by rounding."""
        return LoopSection(with_gain(loop, gain, min(max(at, span[0]), span[1])))

    def sequence(x: FloatArray, p: float) -> str:
        duration = float(np.sum(section(p).follow(x, cycle.returns).durations))
        return ", ".join(mode_sequence(events_of(section(p).loop, x, duration)))

    equation = CycleEquation(section, cycle.returns, sequence, span, VANISHED * amplitude)
    scale = np.array([amplitude, amplitude / own_time(loop.modes), span[1] - span[0]])
    up = np.array([0.0, 0.0, 1.0])
    ways = [
        trace(equation, (cycle.point, value), ahead=way, scale=scale, span=span, steps=steps)
        for way in (-up, up)
    ]
    curves = [way for way in ways if isinstance(way, Curve)]
    if len(curves) < len(ways):
        why = next(way.why for way in ways if isinstance(way, Lost))
        point = _point(section(value), value, cycle)
        lost = CycleEvent("end", value, why)
        even = section(value).symmetric and cycle.returns % 2 == 1
        return CycleBranch(gain, even, cycle.returns, (point,), (lost, lost)), []
    around = Neighbourhood(section, equation, scale)
    symmetric = around.symmetric()
    ends = [end_of(around, curve) for curve in curves]
    down, upwards = curves
    crossings = (*reversed(down.events), *upwards.events)
    branch = CycleBranch(
        gain=gain,
        symmetric=symmetric,
        returns=cycle.returns,
        points=tuple(_points(around, (*reversed(down.points[1:]), *upwards.points))),
        events=(ends[0][0], *map(_named, crossings), ends[1][0]),
    )
    found = [item for _, beyond in ends for item in beyond]
    found.extend(item for event in crossings for item in crossing(around, event))
    return branch, found


def _is_on(cycle: Cycle, value: float, section: LoopSection, branch: CycleBranch) -> bool:
    """Whether a branch is known to pass through a cycle."""
    if branch.returns != cycle.returns:
        return False
    for before, after in pairwise((branch.points[0], *branch.points, branch.points[-1])):
        low, high = sorted((before.value, after.value))
        slack = BARELY * abs(value)
        if low - slack <= value <= high + slack:
            share = (value - before.value) / (after.value - before.value) if high > low else 0.0
            guess = before.cycle.point + share * (after.cycle.point - before.cycle.point)
            there = shoot(section, guess, branch.returns)
            if (
                isinstance(there, Cycle)
                and _is_between(there, before.cycle, after.cycle, section)
                and _apart(cycle, there, section) <= SAME
            ):
                return True
    return False


def _is_between(cycle: Cycle, before: Cycle, after: Cycle, section: LoopSection) -> bool:
    """Whether a cycle goes on from one to the other: shooting may have found one across a jump."""
    room = _apart(before, after, section) + SAME
    return max(_apart(cycle, before, section), _apart(cycle, after, section)) <= room


def _apart(one: Cycle, other: Cycle, section: LoopSection) -> float:
    """Relative difference of two cycles; a mirror image in a symmetric loop is the same."""
    if not section.symmetric:
        return distance(one, other)
    return min(distance(one, other), distance(one, mirrored(other, section)))


def _named(event: CurveEvent) -> CycleEvent:
    kind = KINDS.get(event.kind, event.kind)
    return CycleEvent(kind, event.p, event.says if event.kind == "label" else kind)


def _points(around: Neighbourhood, points: tuple[CurvePoint, ...]) -> Iterator[CyclePoint]:
    for point in points:
        section = around.section(point.p)
        cycle = cycle_at(section, point.x, around.equation.returns)
        if isinstance(cycle, Cycle):
            yield _point(section, point.p, cycle)


def _point(section: LoopSection, value: float, cycle: Cycle) -> CyclePoint:
    events = events_of(section.loop, cycle.point, cycle.period)
    return CyclePoint(value, cycle, mode_sequence(events), stick_phases(events, cycle.period))

"""Where a branch of cycles ends, in the words of its motion, and which cycles are found there and beyond.

A cycle ends *at the equilibrium* where it shrinks to a point, and *meets an equilibrium* where its motion
comes to rest on the way. It ends by a *graze* where the return map jumps (`cycle_modes`); if the cycle was
symmetric and what follows is not, that breaks the symmetry, whatever its multipliers are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from compensation.cycle_modes import events_of, parting
from compensation.loop_cycles import distance
from compensation.loop_section import PATIENCE, LoopSection
from compensation.orbits.continuation import Curve, CurveEvent, other_branch
from compensation.orbits.cycle_equation import JOINED, MET_EQUILIBRIUM, CycleEquation
from compensation.orbits.periodic_orbits import Cycle, cycle_at, find_cycle
from compensation.orbits.solution_curve import CurvePoint
from ident.simulation.filippov_system import FloatArray

BEYOND: Final = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)  # [scaled] how far beyond an end to look
BRANCH_OFF: Final = (1e-3, 1e-4)  # [scaled] distances at which a branch that crosses is looked for
ANOTHER: Final = 0.01  # relative difference of extremes or period of cycles that do not continue each other
STRAYED: Final = (1e-5, 1e-3)  # [scaled] distances at which motion that has lost its cycle is looked for
RANGE: Final = "end of the parameter's range"
RESTS: Final = "meets an equilibrium: the link comes to rest on the way"
TOO_LONG: Final = f"a return takes more than {PATIENCE:g} times the loop's own time"
LOSSES: Final = {"solution lost: equilibrium": RESTS, "solution lost: time reached": TOO_LONG}
SYMMETRY_BREAKING: Final = "symmetry breaking"
MODE_SEQUENCE: Final = "mode sequence"


@dataclass(frozen=True)
class CycleEvent:
    """What happens to a branch at one value of the gain."""

    kind: str  # "fold of cycles", "symmetry breaking", "mode sequence", "period doubling", ..., "end"
    value: float  # of the gain [its unit]
    says: str


@dataclass(frozen=True)
class Neighbourhood:
    """What is needed to look around on a branch of cycles."""

    section: Callable[[float], LoopSection]
    equation: CycleEquation
    scale: FloatArray  # (3,) of x1 [rad], x2 [rad/s] and the gain [its unit]

    @property
    def span(self) -> tuple[float, float]:
        """Range of the gain [its unit]."""
        return self.equation.span

    def symmetric(self) -> bool:
        """Whether the cycles of the branch are."""
        return self.equation.returns % 2 == 1 and self.section(self.span[0]).symmetric

    def ahead(self, last: CurvePoint, distance: float) -> tuple[FloatArray, float]:
        """Point (2,) and gain at a `distance` [scaled] along the tangent."""
        y = np.append(last.x, last.p) + distance * last.tangent * self.scale
        return y[:-1], float(y[-1])


def end_of(around: Neighbourhood, curve: Curve) -> tuple[CycleEvent, list[tuple[float, Cycle]]]:
    """The last event of a curve, and cycles by their gain which the motion settles on beyond."""
    last = curve.points[-1]
    if curve.end_reason == RANGE:
        return CycleEvent("end", last.p, RANGE), []
    if curve.end_reason == MET_EQUILIBRIUM:
        return CycleEvent("end", _vanishing(around.equation, curve), MET_EQUILIBRIUM), []
    if curve.end_reason == JOINED:
        at = curve.events[-1] if curve.events else last
        return CycleEvent("end", at.p, JOINED), []
    beyond = _beyond(around, last)
    if curve.end_reason.startswith("limit"):  # motion leaves an unstable branch that is too stiff to follow
        return CycleEvent("end", last.p, curve.end_reason), beyond
    if curve.end_reason in LOSSES:
        return CycleEvent("end", last.p, LOSSES[curve.end_reason]), beyond
    graze = _graze(around, last)
    if graze is None:
        return CycleEvent("end", last.p, curve.end_reason), beyond
    broken = around.symmetric() and beyond and all(cycle.returns % 2 == 0 for _, cycle in beyond)
    return CycleEvent(SYMMETRY_BREAKING if broken else MODE_SEQUENCE, last.p, graze), beyond


def crossing(around: Neighbourhood, event: CurveEvent) -> list[tuple[float, Cycle]]:
    """Cycles by their gain that cross or branch off at an event, or else that are settled on nearby."""
    if event.kind == "label":
        return []
    equation = around.equation
    if event.kind in (SYMMETRY_BREAKING, "period doubling"):
        equation = replace(equation, returns=2 * equation.returns)
    for length in BRANCH_OFF:
        sides = other_branch(equation, event, scale=around.scale, length=length) if _branches(event) else ()
        inside = [point for point in sides if around.span[0] <= point.p <= around.span[1]]
        found = [(point.p, cycle_at(around.section(point.p), point.x, equation.returns)) for point in inside]
        cycles = [(value, cycle) for value, cycle in found if isinstance(cycle, Cycle)]
        if cycles:
            return cycles
    places = [
        (event.x, float(event.p + side * around.scale[-1]))
        for length in STRAYED
        for side in (-length, length)
    ]
    return list(_settled(around, places))


def _branches(event: CurveEvent) -> bool:
    return event.kind in (SYMMETRY_BREAKING, "period doubling", "branch point")


def _vanishing(equation: CycleEquation, curve: Curve) -> float:
    """The gain at which the extent is zero, by the last two points."""
    before, last = curve.points[-2:]
    wide, narrow = equation.size(before.x, before.p), equation.size(last.x, last.p)
    return last.p + (last.p - before.p) * narrow / (wide - narrow)


def _beyond(around: Neighbourhood, last: CurvePoint) -> list[tuple[float, Cycle]]:
    """What the motion settles on where the branch is no more, by number of returns: the nearest and farthest.

    The nearest cycle may itself be too near its own graze to be followed. The gain alone is moved on, too:
    along the tangent it hardly changes where a branch runs into a graze steeply.
    """
    here = cycle_at(around.section(last.p), last.x, around.equation.returns)
    onward = np.sign(last.tangent[-1]) * around.scale[-1]
    places = [
        place
        for length in BEYOND
        for place in (around.ahead(last, length), (last.x, float(last.p + length * onward)))
    ]
    nearest: dict[int, tuple[float, Cycle]] = {}
    farthest: dict[int, tuple[float, Cycle]] = {}
    for gain, cycle in _settled(around, places):
        if not isinstance(here, Cycle) or _is_another(around, (gain, cycle), (last.label, here)):
            nearest.setdefault(cycle.returns, (gain, cycle))
            farthest[cycle.returns] = (gain, cycle)
    return [*nearest.values(), *farthest.values()]


def _settled(
    around: Neighbourhood, places: Iterable[tuple[FloatArray, float]]
) -> Iterator[tuple[float, Cycle]]:
    """The cycles, by their gain, that the motion settles on from points (2,) at gains within the span."""
    for point, gain in places:
        if around.span[0] <= gain <= around.span[1]:
            cycle = find_cycle(around.section(gain), point)
            if isinstance(cycle, Cycle):
                yield gain, cycle


def _is_another(around: Neighbourhood, beyond: tuple[float, Cycle], last: tuple[str, Cycle]) -> bool:
    """Whether a cycle beyond an end does not continue the last one, in returns, modes, extent or period."""
    gain, cycle = beyond
    label, here = last
    if cycle.returns != here.returns or distance(cycle, here) > ANOTHER:
        return True
    return around.equation.label(cycle.point, gain) != label


def _graze(around: Neighbourhood, last: CurvePoint) -> str | None:
    """How the motion of the last cycle parts from those beyond."""
    returns = around.equation.returns
    duration = float(np.sum(around.section(last.p).follow(last.x, returns).durations))
    here = events_of(around.section(last.p).loop, last.x, duration)
    for length in BEYOND:
        point, gain = around.ahead(last, length)
        found = parting(here, events_of(around.section(gain).loop, point, duration), duration)
        if found is not None:
            return found
    return None

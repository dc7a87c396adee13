"""Pseudo-arclength continuation: a curve of solutions followed from point to point, its events named.

From a solution the curve is followed by steps of adaptive length (`solution_curve`). A step is taken
again, shorter, where the corrector fails, the tangent turns by more than `SHARPEST` or the solution
changes by more than a given part of its size: so a branch is followed down to where it vanishes, at even
steps on a logarithmic scale. What has hopped to another curve is known by its companions.

Between two points of the curve these are found and located along its length, to rounding:

* a *fold* (turning point): det F_x changes sign, and with it the tangent's component along p;
* a *branch point*: det [F_x F_p; t] changes sign and the Jacobian loses rank, another curve crosses
  (pitchfork, transcritical);
* whatever the problem watches: a multiplier that leaves the unit circle, for one;
* a *change of label*: what kind of solution it is, the sequence of modes of a cycle, for one.

The curve ends for a reason: at an end of the parameter's range; where the problem says that a solution
has degenerated; where it has come back to its start; where the solution is lost, with the problem's
words why; where it *jumps*, F having no neighbouring zero ahead: so end the cycles of a piecewise smooth
system that graze a surface; or at the limit of points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from compensation.orbits.solution_curve import FARTHEST, CurvePoint, Lost, Problem, Scaled, correct
from ident.simulation.filippov_system import FloatArray

SHARPEST: Final = 0.9  # cosine of the angle between the tangents at both ends of a step
TOO_MUCH: Final = 1.5  # times the change that was meant
LONGER: Final = 1.6
SHORTER: Final = 0.3
BISECTIONS: Final = 60
LOCATED: Final = 1e-12  # of the step in which an event is
CROSSED: Final = 0.1  # of the rank's measure nearby: so much is left of it at a branch point
FLAT: Final = 1e-3  # a tangent's part along p below which the way to a value of p is no guide
LEAP: Final = 0.005  # of the problem's size, that a step may change x against the tangents
STRANGE: Final = 0.1  # relative change of a companion in one step
JUMP: Final = 1e3  # steps by which F misses zero where a solution jumps


@dataclass(frozen=True)
class Steps:
    """Lengths along the curve, in scaled coordinates."""

    first: float = 0.02  # [scaled]
    longest: float = 0.1  # [scaled]
    shortest: float = 1e-10  # [scaled]
    relative: float = 0.25  # [-] most that x may change in a step, as a part of the problem's `size`
    points: int = 400


@dataclass(frozen=True)
class CurveEvent:
    """Something that happens between two points of a curve."""

    kind: str  # "fold", "branch point", "label", or what the problem watches
    x: FloatArray  # (n,) [units of the problem]
    p: float  # [unit of the problem]
    tangent: FloatArray  # (n + 1,) of the curve [scaled]
    says: str


@dataclass(frozen=True)
class Curve:
    """A curve of solutions in the order in which it was followed."""

    points: tuple[CurvePoint, ...]
    events: tuple[CurveEvent, ...]
    end_reason: str


def trace(
    problem: Problem,
    start: tuple[FloatArray, float],
    *,
    ahead: FloatArray,
    scale: FloatArray,
    span: tuple[float, float],
    steps: Steps = Steps(),
) -> Curve | Lost:
    """Follow the curve through a solution, `start` = (x (n,), p), while p is within `span`.

    `ahead` (n + 1,) says which way to set out: its sign along the tangent counts; `scale` (n + 1,) [units of
    the problem] makes coordinates comparable. A start that is no solution is corrected at its own p.
    """
    scaled = Scaled(problem, scale)
    upright = np.zeros(scale.size)
    upright[-1] = 1.0
    u = correct(scaled, scaled.join(*start), upright, 0.0, room=np.inf)
    if isinstance(u, Lost):  # at a fold: across the direction wanted
        u = correct(scaled, scaled.join(*start), ahead / np.linalg.norm(ahead), 0.0, room=np.inf)
    first = u if isinstance(u, Lost) else scaled.point(u, ahead)
    if isinstance(first, Lost):
        return first
    ending = problem.ending(first.x, first.p)
    return _follow(scaled, first, span, steps) if ending is None else Lost(ending)


def other_branch(
    problem: Problem, at: CurveEvent, *, scale: FloatArray, length: float
) -> tuple[CurvePoint, ...]:
    """Solutions (at most two) of the curve that crosses at a branch point, on either side of it.

    `length` [scaled] is how far away to look. The problem may be another one that has the known curve too:
    that of cycles of twice as many returns, for one.
    """
    scaled = Scaled(problem, scale)
    base = scaled.join(at.x, at.p)
    slope = scaled.jacobian(base)
    if isinstance(slope, Lost):
        return ()
    null = np.linalg.svd(slope)[2][-2:]  # at a branch point two directions vanish
    weights = null @ at.tangent
    across = weights[1] * null[0] - weights[0] * null[1]
    across = across / np.linalg.norm(across)
    found = []
    for side in (across, -across):
        u = correct(scaled, base, side, length)
        point = u if isinstance(u, Lost) else scaled.point(u, side)
        if isinstance(point, CurvePoint):
            found.append(point)
    return tuple(found)


def _follow(scaled: Scaled, first: CurvePoint, span: tuple[float, float], steps: Steps) -> Curve:
    points = [first]
    events: list[CurveEvent] = []
    length = steps.first
    while len(points) < steps.points:
        before = points[-1]
        most = steps.relative * scaled.problem.size(before.x, before.p)
        swing = float(np.max(np.abs(before.tangent[:-1] * scaled.scale[:-1])))
        length = min(length, steps.longest, most / swing if swing > 0.0 else np.inf)
        edge = _edge_ahead(before, length * float(before.tangent[-1] * scaled.scale[-1]), span)
        after = (
            _step(scaled, before, before.tangent, length, TOO_MUCH * most)
            if edge is None
            else _step_to(scaled, before, edge, TOO_MUCH * most)
        )
        if isinstance(after, Lost):
            length *= SHORTER
            if length < steps.shortest:
                return Curve(tuple(points), tuple(events), _why(scaled, before, after, steps.shortest))
            continue
        for event in _events_between(scaled, before, after):
            events.append(event)
            ending = scaled.problem.ending(event.x, event.p)
            if ending is not None:
                return Curve(tuple(points), tuple(events), ending)
        points.append(after)
        if edge is not None:
            return Curve(tuple(points), tuple(events), "end of the parameter's range")
        ending = scaled.problem.ending(after.x, after.p)
        if ending is not None:
            return Curve(tuple(points), tuple(events), ending)
        if len(points) > 3 and _back(scaled, first, before, after):
            return Curve(tuple(points), tuple(events), "closed curve")
        length *= LONGER
    return Curve(tuple(points), tuple(events), f"limit of {steps.points} points")


def _edge_ahead(before: CurvePoint, change: float, span: tuple[float, float]) -> float | None:
    """The end of the parameter's range that a `change` of p would reach."""
    if before.p + change >= span[1]:
        return span[1]
    return span[0] if before.p + change <= span[0] else None


def _step_to(scaled: Scaled, before: CurvePoint, edge: float, most: float) -> CurvePoint | Lost:
    """The point at p = `edge`."""
    upright = np.zeros(before.tangent.size)
    upright[-1] = 1.0
    after = _step(scaled, before, upright, (edge - before.p) / float(scaled.scale[-1]), most)
    return after if isinstance(after, Lost) else replace(after, p=edge)


def _step(
    scaled: Scaled, before: CurvePoint, along: FloatArray, length: float, most: float
) -> CurvePoint | Lost:
    """The point `length` ahead."""
    base = scaled.join(before.x, before.p)
    u = correct(scaled, base, along, length, room=FARTHEST / max(abs(float(along @ before.tangent)), FLAT))
    if isinstance(u, Lost):
        return u
    if float(np.max(np.abs((u - base) * scaled.scale)[:-1])) > most:
        return Lost("the solution changes too fast")
    after = scaled.point(u, before.tangent)
    if isinstance(after, Lost):
        return after
    if float(after.tangent @ before.tangent) < SHARPEST:
        return Lost("the curve turns too sharply")
    if _turns_back(scaled, before, after):
        return Lost("the curve turns back without a fold")
    if _leaps(scaled, before, after):
        return Lost("the solution found does not continue the curve")
    if np.any(np.abs(after.companions - before.companions) > STRANGE * before.companions):
        return Lost("the solution found is another one")
    return after


def _turns_back(scaled: Scaled, before: CurvePoint, after: CurvePoint) -> bool:
    """Whether p turns, but neither at a fold nor at a branch point: F_p is large, and the step too long."""
    turns = before.tangent[-1] * after.tangent[-1] < 0.0
    if not turns or before.signs["fold"] * after.signs["fold"] <= 0.0:
        return False
    at = _located(scaled, before, after, partial(_watched, "branch point"))
    return at.rank > CROSSED * max(before.rank, after.rank)


def _leaps(scaled: Scaled, before: CurvePoint, after: CurvePoint) -> bool:
    """Whether x changes by more than the tangents at both ends of a step can account for.

    Along a curve the chord lies between the tangents.
    """
    chord = scaled.join(after.x, after.p) - scaled.join(before.x, before.p)
    length = float(np.linalg.norm(chord))
    middle = 0.5 * (before.tangent + after.tangent)
    turned = 0.5 * np.abs(after.tangent - before.tangent)
    beyond = np.abs(chord - length * middle) - length * turned
    size = scaled.problem.size(before.x, before.p)
    return bool(np.max(beyond[:-1] * scaled.scale[:-1]) > LEAP * size)


def _events_between(scaled: Scaled, before: CurvePoint, after: CurvePoint) -> list[CurveEvent]:
    both = before.signs.keys() & after.signs.keys()
    names = sorted(name for name in both if before.signs[name] * after.signs[name] < 0.0)
    found: list[tuple[CurvePoint, str, str]] = []
    for name in names:
        at = _located(scaled, before, after, partial(_watched, name))
        if name == "branch point" and at.rank > CROSSED * max(before.rank, after.rank):
            continue  # a sharp fold, across which the tangent lost its way
        found.append((at, name, name))
    if any(name == "branch point" for _, name, _ in found):
        found = [item for item in found if item[1] != "fold"]  # there F_x is singular, too
    if before.label != after.label:

        def changed(point: CurvePoint) -> float:
            return -1.0 if point.label == before.label else 1.0

        at = _located(scaled, before, after, changed)
        found.append((at, "label", f"{before.label} becomes {after.label}"))
    base = scaled.join(before.x, before.p)
    found.sort(key=lambda item: float((scaled.join(item[0].x, item[0].p) - base) @ before.tangent))
    return [CurveEvent(kind, at.x, at.p, at.tangent, says) for at, kind, says in found]


def _watched(name: str, point: CurvePoint) -> float:
    return point.signs.get(name, 0.0)


def _located(
    scaled: Scaled, before: CurvePoint, after: CurvePoint, value: Callable[[CurvePoint], float]
) -> CurvePoint:
    """The point between two where `value` changes sign, by false position kept inside its bracket."""
    base = scaled.join(before.x, before.p)
    chord = scaled.join(after.x, after.p) - base
    whole = float(np.linalg.norm(chord))
    low, high = 0.0, 1.0
    at_low, at_high = value(before), value(after)
    best = above = after
    below = before
    side = 0
    for _ in range(BISECTIONS):
        share = at_low / (at_low - at_high) if abs(at_low) != abs(at_high) else 0.5
        for part in (min(max(share, 0.01), 0.99), 0.4, 0.6):  # a singular point is gone round
            middle = low + part * (high - low)
            guess = base + _cubic(chord, before.tangent * whole, after.tangent * whole, middle)
            u = correct(scaled, guess, chord / whole, 0.0, room=whole)
            point = u if isinstance(u, Lost) else scaled.point(u, before.tangent)
            if isinstance(point, CurvePoint):
                break
        if isinstance(point, Lost):
            return _between(scaled, below, above, value)
        now = value(point)
        best = point
        if now == 0.0 or high - low <= LOCATED:
            break
        if (now > 0.0) == (at_high > 0.0):
            high, at_high, above = middle, now, point
            at_low = 0.5 * at_low if side == 1 else at_low
            side = 1
        else:
            low, at_low, below = middle, now, point
            at_high = 0.5 * at_high if side == -1 else at_high
            side = -1
    return best


def _cubic(chord: FloatArray, first: FloatArray, last: FloatArray, part: float) -> FloatArray:
    """Hermite's way (n + 1,) to a `part` of a chord, with given tangents at its ends: it knows the bend."""
    rest = 1.0 - part
    way: FloatArray = part**2 * (3.0 - 2.0 * part) * chord + part * rest * (rest * first - part * last)
    return way


def _between(
    scaled: Scaled, below: CurvePoint, above: CurvePoint, value: Callable[[CurvePoint], float]
) -> CurvePoint:
    """The point where `value` vanishes on the chord: so near to a crossing the corrector finds no way."""
    start, end = scaled.join(below.x, below.p), scaled.join(above.x, above.p)
    share = value(below) / (value(below) - value(above))
    point = scaled.point(start + share * (end - start), below.tangent)
    return above if isinstance(point, Lost) else point


def _back(scaled: Scaled, first: CurvePoint, before: CurvePoint, after: CurvePoint) -> bool:
    """Whether the start lies between two points, on the same way."""
    start = scaled.join(first.x, first.p)
    here, there = scaled.join(before.x, before.p), scaled.join(after.x, after.p)
    length = float(np.linalg.norm(there - here))
    along = float((start - here) @ (there - here)) / length
    aside = float(np.linalg.norm(start - here - along * (there - here) / length))
    same_way = float(first.tangent @ after.tangent) > 0.0
    return same_way and 0.0 <= along <= length and aside <= 0.2 * length


def _why(scaled: Scaled, last: CurvePoint, failure: Lost, shortest: float) -> str:
    """Why there is no solution even the shortest step ahead."""
    base = scaled.join(last.x, last.p)
    ahead = scaled.residual(base + shortest * last.tangent)
    if isinstance(ahead, Lost):
        return f"solution lost: {ahead.why}"
    size = float(np.max(np.abs(base[:-1])))
    if float(np.max(np.abs(ahead))) > JUMP * shortest + 1e-6 * size:
        return "solution jumps"
    return f"solution lost: {failure.why}"

"""Curves whose folds, branch points and ends are known on paper, and a smooth return map's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from compensation.orbits.continuation import Curve, Steps, other_branch, trace
from compensation.orbits.solution_curve import Lost, Problem
from ident.simulation.filippov_system import FloatArray

UNIT = np.ones(2)
UP = np.array([0.0, 1.0])


@dataclass(frozen=True)
class Scalar:
    """f(x, p) = 0 for one x."""

    f: Callable[[float, float], float]
    slopes: Callable[[float, float], tuple[float, float]]
    exists: Callable[[float, float], bool] = lambda x, p: True
    name: Callable[[float, float], str] = lambda x, p: "solution"
    over: Callable[[float, float], str | None] = lambda x, p: None
    extent: Callable[[float], float] = lambda x: np.inf

    def residual(self, x: FloatArray, p: float) -> FloatArray | Lost:
        return np.array([self.f(x[0], p)]) if self.exists(x[0], p) else Lost("no ground")

    def jacobian(self, x: FloatArray, p: float) -> FloatArray | Lost:
        return np.array([self.slopes(x[0], p)]) if self.exists(x[0], p) else Lost("no ground")

    def label(self, x: FloatArray, p: float) -> str:
        return self.name(x[0], p)

    def watch(self, x: FloatArray, p: float, jacobian: FloatArray) -> dict[str, float]:
        return {"multiplier -1": jacobian[0, 0] + 2.0}

    def size(self, x: FloatArray, p: float) -> float:
        return self.extent(x[0])

    def companions(self, x: FloatArray, p: float) -> FloatArray:
        return np.empty(0)

    def ending(self, x: FloatArray, p: float) -> str | None:
        return self.over(x[0], p)


CIRCLE = Scalar(lambda x, p: x * x + p * p - 1.0, lambda x, p: (2 * x, 2 * p))
CUBIC = Scalar(lambda x, p: p + x - x**3, lambda x, p: (1 - 3 * x * x, 1.0))
PITCHFORK = Scalar(lambda x, p: p * x - x**3, lambda x, p: (p - 3 * x * x, x))


def traced(problem: Problem, start: tuple[float, float], span: tuple[float, float] = (-2.0, 2.0)) -> Curve:
    x, p = start
    curve = trace(problem, (np.array([x]), p), ahead=UP, scale=UNIT, span=span)
    assert isinstance(curve, Curve)
    return curve


def test_a_circle_closes_and_has_two_folds() -> None:
    curve = traced(CIRCLE, (1.0, 0.0))
    assert curve.end_reason == "closed curve"
    folds = [event for event in curve.events if event.kind == "fold"]
    assert [event.p for event in folds] == pytest.approx([1.0, -1.0], abs=1e-12)
    for point in curve.points:
        assert point.x[0] ** 2 + point.p**2 == pytest.approx(1.0, abs=1e-12)


def test_the_folds_of_a_cubic_and_its_range() -> None:
    curve = traced(CUBIC, (-1.5, -1.875), span=(-2.0, 2.0))
    folds = [event for event in curve.events if event.kind == "fold"]
    height = 2.0 / (3.0 * np.sqrt(3.0))
    assert [event.p for event in folds] == pytest.approx([height, -height], abs=1e-12)
    assert [float(event.x[0]) for event in folds] == pytest.approx([-(3**-0.5), 3**-0.5], abs=1e-5)
    assert curve.end_reason == "end of the parameter's range"
    assert curve.points[-1].p == 2.0
    assert curve.points[-1].x[0] ** 3 - curve.points[-1].x[0] == pytest.approx(2.0, abs=1e-9)


def test_a_pitchfork_and_its_other_branch() -> None:
    curve = traced(PITCHFORK, (0.0, -1.03))
    (event,) = [event for event in curve.events if event.kind == "branch point"]
    assert event.p == pytest.approx(0.0, abs=1e-12)
    sides = other_branch(PITCHFORK, event, scale=UNIT, length=0.1)
    assert sorted(float(point.x[0]) for point in sides) == pytest.approx([-0.1, 0.1], abs=1e-9)
    branch = trace(PITCHFORK, (sides[0].x, sides[0].p), ahead=sides[0].tangent, scale=UNIT, span=(-2, 2))
    assert isinstance(branch, Curve)
    assert branch.points[-1].x[0] ** 2 == pytest.approx(2.0, abs=1e-9)


def test_the_curve_of_a_pitchfork_that_turns_has_a_branch_point_and_no_fold() -> None:
    curve = traced(PITCHFORK, (-1.0, 1.0), span=(-1.0, 2.0))
    backwards = trace(PITCHFORK, (np.array([-1.0]), 1.0), ahead=-UP, scale=UNIT, span=(-1.0, 2.0))
    assert isinstance(backwards, Curve)
    assert not curve.events
    assert [event.kind for event in backwards.events][:1] == ["branch point"]
    assert backwards.points[-1].p == 2.0
    assert backwards.points[-1].x[0] == pytest.approx(np.sqrt(2.0), abs=1e-9)


def test_a_smooth_return_map_has_its_fold_and_its_flip() -> None:
    """x -> p - x^2: fixed points from the fold at p = -1/4, the stable one doubles its period at 3/4."""
    henon = Scalar(lambda x, p: p - x * x - x, lambda x, p: (-2 * x - 1.0, 1.0))
    curve = traced(henon, (1.0, 2.0), span=(-1.0, 2.5))
    back = trace(henon, (np.array([1.0]), 2.0), ahead=-UP, scale=UNIT, span=(-1.0, 2.5))
    assert isinstance(back, Curve)
    kinds = {event.kind: event.p for event in back.events}
    assert kinds["multiplier -1"] == pytest.approx(0.75, abs=1e-12)
    assert kinds["fold"] == pytest.approx(-0.25, abs=1e-12)
    assert curve.end_reason == "end of the parameter's range"


def test_ends_say_why() -> None:
    line = Scalar(
        lambda x, p: x - p,
        lambda x, p: (1.0, -1.0),
        exists=lambda x, p: p < 0.7,
        name=lambda x, p: "below" if p < 0.3 else "above",
    )
    curve = traced(line, (0.0, 0.0))
    assert curve.end_reason == "solution lost: no ground"
    assert curve.points[-1].p == pytest.approx(0.7, abs=1e-8)
    (event,) = curve.events
    assert (event.kind, event.says) == ("label", "below becomes above")
    assert event.p == pytest.approx(0.3, abs=1e-10)

    step = Scalar(lambda x, p: x - p - (1.0 if p > 0.5 else 0.0), lambda x, p: (1.0, -1.0))
    assert traced(step, (0.0, 0.0)).end_reason == "solution jumps"

    root = Scalar(
        lambda x, p: x - p,
        lambda x, p: (1.0, -1.0),
        over=lambda x, p: "vanishes" if x < 1e-6 else None,
        extent=lambda x: x,
    )
    down = trace(root, (np.array([1.0]), 1.0), ahead=-UP, scale=UNIT, span=(-1.0, 2.0))
    assert isinstance(down, Curve)
    assert down.end_reason == "vanishes"
    assert len(down.points) < 80
    ratios = [after.x[0] / before.x[0] for before, after in zip(down.points, down.points[1:], strict=False)]
    assert min(ratios) >= 0.74


def test_a_start_that_is_no_solution_and_has_none_near_is_lost() -> None:
    found = trace(
        Scalar(lambda x, p: x * x + 1.0, lambda x, p: (2 * x, 0.0)),
        (np.array([0.5]), 0.0),
        ahead=UP,
        scale=UNIT,
        span=(-1, 1),
    )
    assert isinstance(found, Lost)


def test_a_limit_of_points_is_said() -> None:
    curve = trace(CIRCLE, (np.array([1.0]), 0.0), ahead=UP, scale=UNIT, span=(-2, 2), steps=Steps(points=5))
    assert isinstance(curve, Curve)
    assert (len(curve.points), curve.end_reason) == (5, "limit of 5 points")

"""Branches of cycles of smooth maps: the logistic map's period doubling, an odd map's loss of symmetry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from compensation.orbits.continuation import Curve, other_branch, trace
from compensation.orbits.cycle_equation import JOINED, MET_EQUILIBRIUM, CycleEquation
from compensation.orbits.periodic_orbits import Returns
from compensation.orbits.solution_curve import Lost
from ident.simulation.filippov_system import FloatArray

UNIT = np.ones(2)
UP = np.array([0.0, 1.0])


@dataclass(frozen=True)
class Line:
    """A map of one number, given with its derivative; the extent of a return is its size."""

    map: Callable[[float], float]
    slope: Callable[[float], float]
    symmetric: bool = False
    accuracy: float = 1e-11
    ends: float = np.inf  # beyond, there is no return

    def follow(self, point: FloatArray, returns: int) -> Returns:
        x = float(point[0])
        done = []
        for _ in range(returns):
            if abs(x) > self.ends:
                break
            x = self.map(x)
            done.append(x)
        values = np.array(done)
        reason = "section reached" if values.size == returns else "equilibrium"
        sizes = np.abs(values)
        return Returns(values[:, None], np.ones(values.size), -sizes, sizes, reason)

    def derivative(self, point: FloatArray) -> FloatArray | None:
        return np.array([[self.slope(float(point[0]))]])


def logistic(p: float) -> Line:
    return Line(lambda x: p * x * (1.0 - x), lambda x: p * (1.0 - 2.0 * x))


def equation(family: Callable[[float], Line], returns: int = 1) -> CycleEquation:
    return CycleEquation(family, returns, lambda x, p: "turn", (0.5, 3.6), 1e-6)


def traced(problem: CycleEquation, x: float, p: float, ahead: FloatArray) -> Curve:
    found = trace(problem, (np.array([x]), p), ahead=ahead, scale=UNIT, span=problem.span)
    assert isinstance(found, Curve)
    return found


def test_the_fixed_point_of_the_logistic_map_from_its_birth_to_its_flip() -> None:
    down = traced(equation(logistic), 1.0 - 1.0 / 2.5, 2.5, -UP)
    assert down.end_reason == MET_EQUILIBRIUM
    assert down.points[-1].p == pytest.approx(1.0, abs=1e-5)
    up = traced(equation(logistic), 1.0 - 1.0 / 2.5, 2.5, UP)
    (flip,) = up.events
    assert (flip.kind, up.end_reason) == ("period doubling", "end of the parameter's range")
    assert flip.p == pytest.approx(3.0, abs=1e-9)
    for point in up.points:
        assert point.x[0] == pytest.approx(1.0 - 1.0 / point.p, abs=1e-10)


def test_the_cycle_of_two_returns_branches_off_there_and_flips_in_turn() -> None:
    (flip,) = traced(equation(logistic), 0.6, 2.5, UP).events
    double = equation(logistic, 2)
    start = other_branch(double, flip, scale=UNIT, length=0.01)[0]
    up = traced(double, float(start.x[0]), start.p, start.tangent)
    events = {event.kind: event.p for event in up.events}
    assert events["period doubling"] == pytest.approx(1.0 + np.sqrt(6.0), abs=1e-8)
    back = traced(double, float(start.x[0]), start.p, -start.tangent)
    assert back.end_reason == JOINED
    assert back.events[-1].p == pytest.approx(3.0, abs=1e-5)  # exact from the other curve


def test_the_half_turn_of_an_odd_map_loses_its_symmetry() -> None:
    def family(p: float) -> Line:
        return Line(lambda x: x * (p - x * x), lambda x: p - 3.0 * x * x, symmetric=True)

    curve = traced(equation(family), np.sqrt(0.5), 1.5, UP)
    (event,) = curve.events
    assert event.kind == "symmetry breaking"
    assert event.p == pytest.approx(2.0, abs=1e-9)  # p - 3 (p - 1) = -1


def test_a_motion_that_rests_on_its_way_ends_the_branch() -> None:
    def family(p: float) -> Line:
        return Line(lambda x: p * x * (1.0 - x), lambda x: p * (1.0 - 2.0 * x), ends=0.65)

    curve = traced(equation(family), 0.6, 2.5, UP)
    assert curve.end_reason == "solution lost: equilibrium"
    assert curve.points[-1].p == pytest.approx(1.0 / 0.35, abs=1e-7)


def test_a_cycle_taken_twice_over_is_no_start() -> None:
    found = trace(equation(logistic, 2), (np.array([0.6]), 2.5), ahead=UP, scale=UNIT, span=(0.5, 3.6))
    assert found == Lost(JOINED)

"""Cycles and multipliers of maps whose cycles are known on paper."""

from dataclasses import dataclass

import numpy as np
import pytest

from compensation.orbits.periodic_orbits import Cycle, NoCycle, Returns, find_cycle, shoot
from ident.simulation.filippov_system import FloatArray


@dataclass(frozen=True)
class Logistic:
    """x -> r x (1 - x): a fixed point 1 - 1/r, stable for 1 < r < 3, then a cycle of two returns."""

    r: float
    symmetric: bool = False
    accuracy: float = 1e-11

    def follow(self, point: FloatArray, returns: int) -> Returns:
        points = []
        for _ in range(returns):
            point = self.r * point * (1.0 - point)
            points.append(point)
        x = np.array(points)
        return Returns(x, np.ones(returns), x[:, 0], x[:, 0], "section reached")

    def derivative(self, point: FloatArray) -> FloatArray:
        return np.array([[self.r * (1.0 - 2.0 * point[0])]])


def test_fixed_point_and_its_multiplier() -> None:
    cycle = find_cycle(Logistic(2.4), np.array([0.1]))
    assert isinstance(cycle, Cycle)
    assert cycle.point[0] == pytest.approx(1 - 1 / 2.4, abs=1e-12)
    assert cycle.multipliers[0] == pytest.approx(2 - 2.4, abs=1e-10)
    assert (cycle.returns, cycle.period, cycle.stable) == (1, 1.0, True)


def test_a_slow_fixed_point_is_shot_at() -> None:
    cycle = find_cycle(Logistic(2.99), np.array([0.1]))
    assert isinstance(cycle, Cycle)
    assert cycle.point[0] == pytest.approx(1 - 1 / 2.99, abs=1e-12)
    assert cycle.multipliers[0] == pytest.approx(-0.99, abs=1e-10)


def test_a_cycle_of_two_returns() -> None:
    r = 3.2
    cycle = find_cycle(Logistic(r), np.array([0.3]))
    assert isinstance(cycle, Cycle)
    assert (cycle.returns, cycle.period) == (2, 2.0)
    ends = [(r + 1 + sign * np.sqrt((r - 3) * (r + 1))) / (2 * r) for sign in (-1, 1)]
    assert (cycle.x1_min, cycle.x1_max) == pytest.approx(ends, abs=1e-12)
    assert cycle.multipliers[0] == pytest.approx(4 + 2 * r - r * r, abs=1e-10)


def test_shooting_finds_the_unstable_fixed_point() -> None:
    cycle = shoot(Logistic(3.2), np.array([0.7]), 1)
    assert isinstance(cycle, Cycle)
    assert cycle.point[0] == pytest.approx(1 - 1 / 3.2, abs=1e-12)
    assert not cycle.stable


def test_a_decay_and_chaos_are_no_cycles() -> None:
    decay = find_cycle(Logistic(0.5), np.array([0.3]))
    assert isinstance(decay, NoCycle)
    assert "decays" in decay.end_reason
    chaos = find_cycle(Logistic(3.9), np.array([0.3]))
    assert isinstance(chaos, NoCycle)
    assert "no repetition" in chaos.end_reason

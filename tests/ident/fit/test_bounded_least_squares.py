"""The compiled Levenberg-Marquardt ends at a minimum within the bounds, as scipy's solvers do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from data.recording import FloatArray
from ident.fit.bounded_least_squares import Box, Workspace, minimise, workspace
from ident.simulation.compiled import compiled, passed


class Linear(NamedTuple):
    matrix: FloatArray  # (n, p)
    right: FloatArray  # (n,)


@compiled
def linear(problem: Linear, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    """|right - matrix x|^2."""
    cost = 0.0
    for i in range(x.size):
        g[slot, i] = 0.0
        for j in range(x.size):
            h[slot, i, j] = 0.0
    for n in range(problem.right.size):
        residual = problem.right[n]
        for i in range(x.size):
            residual -= problem.matrix[n, i] * x[i]
        cost += residual**2
        for i in range(x.size):
            g[slot, i] += problem.matrix[n, i] * residual
            for j in range(i + 1):
                h[slot, i, j] += problem.matrix[n, i] * problem.matrix[n, j]
    return cost


@compiled
def valley(problem: Linear, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    """Rosenbrock's: residuals 10 (x1 - x0^2) and 1 - x0."""
    first, second = 10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]
    g[slot, 0] = 20.0 * x[0] * first + second
    g[slot, 1] = -10.0 * first
    h[slot, 0, 0] = 400.0 * x[0] ** 2 + 1.0
    h[slot, 1, 0] = -200.0 * x[0]
    h[slot, 1, 1] = 100.0
    return float(first**2 + second**2)


LINEAR, VALLEY = passed(linear), passed(valley)


@compiled
def least_linear(problem: Linear, x: FloatArray, box: Box, work: Workspace) -> float:
    return minimise(LINEAR, problem, x, box, work)


@compiled
def least_in_valley(problem: Linear, x: FloatArray, box: Box, work: Workspace) -> float:
    return minimise(VALLEY, problem, x, box, work)


def _box(low: FloatArray, high: FloatArray) -> Box:
    return Box(low, high, np.full(low.size, np.inf), np.ones(low.size, dtype=np.bool_))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_a_linear_problem_in_a_box_ends_where_scipys_does(seed: int, size: int) -> None:
    generator = np.random.default_rng(seed)
    scale = 10.0 ** generator.uniform(-3, 3, size)
    matrix = generator.standard_normal((size + 4, size)) * scale
    right = generator.standard_normal(size + 4)
    low = -generator.uniform(0.0, 1.0, size) / scale
    high = generator.uniform(0.0, 1.0, size) / scale
    x = np.zeros(size)
    cost = least_linear(Linear(matrix, right), x, _box(low, high), workspace(size))
    expected = lsq_linear(matrix, right, (low, high), method="bvls", tol=1e-14)
    assert np.all(x >= low)
    assert np.all(x <= high)
    assert cost == pytest.approx(2 * expected.cost, rel=1e-10, abs=1e-12)
    assert x * scale == pytest.approx(expected.x * scale, abs=1e-6)
    # Karush-Kuhn-Tucker: no descent inside, none inwards at a bound.
    descent = matrix.T @ (right - matrix @ x) / scale
    inner = (x > low) & (x < high)
    assert descent[inner] == pytest.approx(0.0, abs=1e-6)
    assert np.all(descent[x == low] <= 1e-6)
    assert np.all(descent[x == high] >= -1e-6)


@pytest.mark.parametrize("start", [(-1.2, 1.0), (3.0, -4.0), (0.0, 0.0)])
def test_a_curved_valley_is_followed_to_its_end(start: tuple[float, float]) -> None:
    x = np.array(start)
    nothing = Linear(np.zeros((1, 1)), np.zeros(1))
    box = _box(np.full(2, -np.inf), np.full(2, np.inf))
    assert least_in_valley(nothing, x, box, workspace(2)) < 1e-16
    assert x == pytest.approx([1.0, 1.0], abs=1e-7)


def test_a_valley_cut_by_a_bound_ends_on_it() -> None:
    x = np.array([-1.2, 1.0])
    nothing = Linear(np.zeros((1, 1)), np.zeros(1))
    box = _box(np.full(2, -np.inf), np.array([0.5, np.inf]))
    assert least_in_valley(nothing, x, box, workspace(2)) == pytest.approx(0.25)
    assert x == pytest.approx([0.5, 0.25], abs=1e-9)


def test_held_parameters_and_those_that_nothing_tells_stay() -> None:
    matrix = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    x = np.array([0.3, 0.7, 5.0])
    box = _box(np.full(3, -np.inf), np.full(3, np.inf))
    box.free[0] = False
    least_linear(Linear(matrix, np.array([1.0, 2.0, 3.0])), x, box, workspace(3))
    assert x[0] == 0.3
    assert x[2] == 5.0
    assert x[1] == pytest.approx((2 * 0.7 + 2.0) / 5.0)

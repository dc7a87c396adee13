"""Tests on signs and ranks: exact against enumeration, and right about order."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.stats import spearmanr

from ident.fit.residual_tests import rank_test, runs_test


def test_the_distribution_of_runs_is_that_of_all_orders() -> None:
    signs = [1, 1, 1, -1, -1, -1, -1]
    orders = set(itertools.permutations(signs))
    counts = [1 + sum(a != b for a, b in itertools.pairwise(order)) for order in orders]
    for order in list(orders)[:12]:
        found = runs_test(np.array(order, dtype=np.float64), np.arange(7.0), name="")
        assert found is not None
        runs = 1 + sum(a != b for a, b in itertools.pairwise(order))
        assert found.statistic == runs
        assert found.chance == pytest.approx(np.mean([count <= runs for count in counts]))
        assert found.expected == pytest.approx(np.mean(counts))


def test_a_bend_has_too_few_runs_and_a_trend_a_rank_correlation() -> None:
    x = np.linspace(-1.0, 1.0, 20)
    bend = runs_test(x**2 - 0.3, x, name="")
    assert bend is not None
    assert bend.chance < 0.002
    generator = np.random.default_rng(1)
    residual = x + 0.5 * generator.standard_normal(20)
    found = rank_test(residual, x, name="")
    expected = spearmanr(residual, x)
    assert found is not None
    assert found.statistic == pytest.approx(expected.statistic)
    assert found.chance == pytest.approx(expected.pvalue)


def test_too_few_residuals_tell_nothing() -> None:
    assert runs_test(np.ones(10), np.arange(10.0), name="") is None
    assert rank_test(np.ones(4), np.arange(4.0), name="") is None
    assert rank_test(np.arange(9.0), np.ones(9), name="") is None

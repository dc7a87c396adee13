"""Restricted likelihood: closed forms where there are any, and as often too large as too small."""

from __future__ import annotations

import numpy as np
import pytest

from ident.fit.restricted_likelihood import MEDIAN, most_likely_variances

BASIS = np.column_stack([np.ones(12), np.linspace(0.0, 1.0, 12), np.linspace(0.0, 1.0, 12) ** 2])


def test_one_variance_is_the_sum_of_squares_over_what_is_spared() -> None:
    y = np.random.default_rng(1).standard_normal(12)
    residual = y - BASIS @ np.linalg.lstsq(BASIS, y, rcond=None)[0]
    found, _ = most_likely_variances(y, BASIS, np.full(12, 1e-12), np.ones((1, 12)))
    assert found[0] == pytest.approx(float(residual @ residual) / (12 - 3 - MEDIAN), rel=1e-6)


def test_groups_that_share_no_parameter_have_their_own_sums_of_squares() -> None:
    y = np.random.default_rng(2).standard_normal(9)
    first = np.arange(9) < 4
    basis = np.column_stack([first, ~first]).astype(float)
    shapes = np.array([first, ~first]).astype(float)
    found, _ = most_likely_variances(y, basis, np.full(9, 1e-12), shapes)
    expected = [np.var(y[own]) * own.sum() / (own.sum() - 1 - MEDIAN) for own in (first, ~first)]
    assert found == pytest.approx(expected, rel=1e-4)


def test_what_is_known_is_taken_off() -> None:
    y = 3.0 * np.random.default_rng(3).standard_normal(400)
    basis = np.ones((400, 1))
    found, _ = most_likely_variances(y, basis, np.full(400, 4.0), np.ones((1, 400)))
    assert found[0] + 4.0 == pytest.approx(np.var(y) * 400 / (399 - MEDIAN), rel=1e-5)
    none, _ = most_likely_variances(y, basis, np.full(400, 16.0), np.ones((1, 400)))
    assert none[0] < 0.05


def test_dependent_columns_count_once() -> None:
    y = np.random.default_rng(4).standard_normal(12)
    twice = np.column_stack([BASIS, BASIS[:, 1] - BASIS[:, 2], np.zeros(12)])
    args = np.full(12, 1e-12), np.ones((1, 12))
    assert most_likely_variances(y, twice, *args)[0] == pytest.approx(
        most_likely_variances(y, BASIS, *args)[0]
    )


def test_the_criterion_is_least_at_the_answer() -> None:
    generator = np.random.default_rng(5)
    y, known = generator.standard_normal(12), np.full(12, 0.05)
    first = np.arange(12) < 7
    shapes = generator.uniform(0.2, 1.0, 12) * np.array([first, ~first])
    found, least = most_likely_variances(y, BASIS, known, shapes)

    def criterion(variance: np.ndarray) -> float:
        total = known + variance @ shapes
        scaled = BASIS / total[:, None]
        information = BASIS.T @ scaled
        left = y @ (y / total) - (y @ scaled) @ np.linalg.solve(information, scaled.T @ y)
        prior = -MEDIAN * (np.log(total[first]).mean() + np.log(total[~first]).mean())
        return float(np.log(total).sum() + np.linalg.slogdet(information)[1] + left + prior)

    assert criterion(found) == pytest.approx(least, abs=1e-5)
    for factor in (0.7, 0.95, 1.05, 1.4):
        for which in np.eye(2):
            assert criterion(found * (1.0 + (factor - 1.0) * which) + 1e-4 * which) >= least - 1e-4


def test_a_variance_from_few_data_is_as_often_too_large_as_too_small() -> None:
    generator = np.random.default_rng(6)
    args = np.ones((4, 1)), np.full(4, 1e-9), np.ones((1, 4))
    found = [most_likely_variances(generator.standard_normal(4), *args)[0][0] for _ in range(2000)]
    assert np.mean(np.array(found) > 1.0) == pytest.approx(0.5, abs=0.03)

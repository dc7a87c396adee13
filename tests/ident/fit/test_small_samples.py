"""Reach of intervals under estimated spreads: textbook cases, and coverage where there is no formula."""

from __future__ import annotations

import numpy as np
import pytest

from data.recording import FloatArray
from ident.fit.confidence import quantile
from ident.fit.restricted_likelihood import most_likely_variances
from ident.fit.small_samples import Certainty, certainty_of

UNKNOWN = np.array([np.nan, np.nan])


def _certainty(basis: FloatArray, variance: FloatArray, shares: FloatArray, dof: FloatArray) -> Certainty:
    slopes = basis / np.sqrt(variance)[:, None]
    return certainty_of(slopes, np.asarray(np.linalg.inv(slopes.T @ slopes)), shares, dof)


def test_one_spread_leaves_data_less_parameters() -> None:
    basis = np.column_stack([np.ones(12), np.linspace(0.0, 1.0, 12)])
    found = _certainty(basis, np.full(12, 3.0), np.ones((1, 12)), UNKNOWN[:1])
    assert found.dof(np.array([0.0, 1.0])) == pytest.approx(10.0)
    assert found.inflation(np.array([1.0, -1.0])) == pytest.approx(1.0)


def test_the_difference_of_two_means_has_welchs_degrees_of_freedom() -> None:
    first = np.arange(13) < 4
    basis = np.column_stack([first, ~first]).astype(float)
    variance = np.where(first, 2.0, 0.5)
    found = _certainty(basis, variance, np.array([first, ~first]).astype(float), UNKNOWN)
    one, two = 2.0 / 4, 0.5 / 9
    assert found.dof(np.array([1.0, -1.0])) == pytest.approx((one + two) ** 2 / (one**2 / 3 + two**2 / 8))


def test_known_errors_stray_no_further() -> None:
    found = _certainty(np.ones((5, 1)), np.ones(5), np.zeros((1, 5)), UNKNOWN[:1])
    assert found.dof(np.ones(1)) == np.inf
    assert found.inflation(np.ones(1)) == 1.0


def test_an_error_with_degrees_of_freedom_of_its_own_keeps_them() -> None:
    found = _certainty(np.ones((1, 1)), np.ones(1), np.ones((1, 1)), np.array([3.0]))
    assert found.dof(np.ones(1)) == pytest.approx(3.0)


def test_a_mean_of_two_kinds_of_data_is_covered() -> None:
    """Weights that follow the noise: without the correction, 90 % of these intervals hold the truth."""
    generator = np.random.default_rng(6)
    shapes = np.array([np.arange(12) < 9, np.arange(12) >= 9]).astype(float)
    true, known, basis = np.array([3.0, 1.0]) @ shapes, np.full(12, 1e-3), np.ones((12, 1))
    held = np.zeros(2)
    trials = 1500
    for _ in range(trials):
        y = np.sqrt(true) * generator.standard_normal(12)
        spread, _criterion = most_likely_variances(y, basis, known, shapes)
        variance = known + spread @ shapes
        found = _certainty(basis, variance, shapes * spread[:, None] / variance, UNKNOWN)
        centre = float(found.plain[0, 0] * np.sum(y / variance))
        reach = quantile(found.dof(np.ones(1)))
        held += abs(centre) <= reach * np.sqrt(np.array([found.plain[0, 0], found.covariance[0, 0]]))
    plain, corrected = held / trials
    assert 0.93 <= corrected <= 0.97
    assert plain < corrected

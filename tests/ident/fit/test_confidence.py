"""Profile intervals: equal to Student's where the model is linear, open where the data bound nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from data.recording import FloatArray
from ident.fit.confidence import profiled, quantile, symmetric

X = np.linspace(0.0, 1.0, 12)


def test_the_quantile_is_students() -> None:
    assert quantile(7) == pytest.approx(float(student.ppf(0.975, 7)))
    assert quantile(0) == quantile(1)


def test_a_linear_models_profile_is_its_t_interval() -> None:
    generator = np.random.default_rng(1)
    y = 2.0 + 3.0 * X + 0.1 * generator.standard_normal(X.size)
    basis = np.column_stack([np.ones_like(X), X]) / 0.1
    best: FloatArray = np.asarray(np.linalg.lstsq(basis, y / 0.1, rcond=None)[0], dtype=np.float64)
    stderr = float(np.sqrt(np.linalg.inv(basis.T @ basis)[1, 1]))

    def residual(p: FloatArray) -> FloatArray:
        return np.asarray(y / 0.1 - basis @ p)

    found = profiled(residual, best, 1, stderr=stderr, dof=10, least=np.full(2, -np.inf))
    expected = symmetric(float(best[1]), stderr, 10)
    assert found.low == pytest.approx(expected.low, rel=5e-3)
    assert found.high == pytest.approx(expected.high, rel=5e-3)


def test_an_end_that_nothing_bounds_is_open() -> None:
    y = np.exp(-X / 1e-3)  # all but the first value are zero: any faster decay does as well

    def residual(p: FloatArray) -> FloatArray:
        return np.asarray((y - np.exp(-X / p[0])) / 0.01)

    found = profiled(residual, np.array([1e-3]), 0, stderr=1e-3, dof=11, least=np.array([1e-9]))
    assert found.low is None
    assert found.high is not None
    assert 1e-3 < found.high < 0.05


def test_a_symmetric_interval_is_cut_at_what_cannot_be() -> None:
    interval = symmetric(0.1, 0.2, 20, least=0.0)
    assert interval.low == 0.0
    assert interval.high == pytest.approx(0.1 + quantile(20) * 0.2)

"""Bounds among breakaways: the maximum of the likelihood itself, and no bias from the places that held."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from ident.fit.censored_mean import bounded_shift

TORQUE = np.array([0.55, 0.57, 0.56])
STDERR = np.array([0.01, 0.012, 0.01])


@pytest.mark.parametrize("bounds", [[0.5], [0.58], [0.58, 0.59, 0.6], [0.7]])
def test_the_shifted_mean_is_the_most_likely_value(bounds: list[float]) -> None:
    limits = np.array(bounds)

    def unlikely(m: float) -> float:
        free = 0.5 * np.sum(((TORQUE - m) / STDERR) ** 2)
        return float(free - np.sum(norm.logcdf((m - limits) / 0.01)))

    found = bounded_shift(TORQUE, STDERR, limits)
    expected = minimize_scalar(unlikely, bounds=(0.4, 0.8), method="bounded", options={"xatol": 1e-10})
    mean = np.average(TORQUE, weights=STDERR**-2.0)
    assert mean + found.torque == pytest.approx(expected.x, abs=1e-7)
    step = 1e-4
    curvature = (
        unlikely(expected.x + step) - 2 * unlikely(expected.x) + unlikely(expected.x - step)
    ) / step**2
    assert found.factor**-2 * np.sum(STDERR**-2.0) == pytest.approx(curvature, rel=1e-3)


def test_a_bound_that_all_have_passed_changes_nothing() -> None:
    found = bounded_shift(TORQUE, STDERR, np.array([0.3]))
    assert found.torque == pytest.approx(0.0, abs=1e-12)
    assert found.factor == pytest.approx(1.0)
    assert bounded_shift(TORQUE, STDERR, np.array([])).torque == 0.0


def test_the_places_that_held_are_not_forgotten() -> None:
    generator = np.random.default_rng(1)
    plain, shifted = [], []
    for _ in range(300):
        torque = 0.56 + 0.01 * generator.standard_normal(12)
        moved = torque[torque < 0.565]
        limits = np.full(torque.size - moved.size, 0.565)
        stderr = np.full(moved.size, 0.01)
        plain.append(moved.mean())
        shifted.append(moved.mean() + bounded_shift(moved, stderr, limits).torque)
    assert np.mean(plain) < 0.556
    assert np.mean(shifted) == pytest.approx(0.56, abs=1e-3)

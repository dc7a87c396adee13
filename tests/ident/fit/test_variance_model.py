"""The pooled variance model finds the spread between runs and the travel over which it averages out."""

from __future__ import annotations

import numpy as np
import pytest

from ident.fit.variance_model import RunSpread, run_spread


def test_no_spread_is_found_where_white_noise_explains_the_residuals() -> None:
    generator = np.random.default_rng(1)
    found = [
        run_spread(1e-3 * generator.standard_normal(40), np.ones(40), np.full(40, 1e-6), 0).spread
        for _ in range(30)
    ]
    assert float(np.median(found)) < 0.5e-3


def test_spread_and_wavelength_are_recovered() -> None:
    generator = np.random.default_rng(2)
    travel = np.geomspace(0.01, 50.0, 400)
    truth = RunSpread(0.01, 1.0)
    residual = np.sqrt(truth.variance(travel) + 1e-8) * generator.standard_normal(400)
    found = run_spread(residual, travel, np.full(400, 1e-8), 0)
    assert found.spread == pytest.approx(0.01, rel=0.2)
    assert 0.3 < found.wavelength < 3.0


def test_spent_parameters_widen_the_spread() -> None:
    residual = 0.01 * np.random.default_rng(3).standard_normal(20)
    travel, white = np.ones(20), np.full(20, 1e-12)
    assert run_spread(residual, travel, white, 8).spread > run_spread(residual, travel, white, 0).spread

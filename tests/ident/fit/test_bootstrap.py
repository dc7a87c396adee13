"""Bootstrap refits are lmfit's of the same resamples, and spread as the errors say."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from ident.fit.bootstrap import bootstrap, resample
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import fit_friction, polished
from ident.fit.law_model import EACH, LawModel
from tests.ident.fit.campaigns import ONE_LAW, TRUTH, simulated


def _drawn(data: FitData, steady: np.ndarray, motions: np.ndarray) -> FitData:
    """The data with each datum as often as it was drawn."""
    runs, starts = np.split(steady, [data.torque.size])
    often = np.repeat(np.arange(motions.size), motions)
    return replace(
        data,
        run_direction=np.repeat(data.run_direction, runs),
        speed=np.repeat(data.speed, runs),
        torque=np.repeat(data.torque, runs),
        acceleration=np.repeat(data.acceleration, runs),
        run_stderr=np.repeat(data.run_stderr, runs),
        start_direction=np.repeat(data.start_direction, starts),
        start_torque=np.repeat(data.start_torque, starts),
        start_stderr=np.repeat(data.start_stderr, starts),
        momenta=tuple(data.momenta[k] for k in often),
        whitening=tuple(data.whitening[k] for k in often),
    )


@pytest.mark.parametrize("one", [False, True])
def test_a_draw_is_lmfits_fit_of_the_same_resample(one: bool) -> None:
    model, truth = (LawModel(("mean",)), ONE_LAW) if one else (EACH, TRUTH)
    data = simulated(truth, np.random.default_rng(1), model=model, ramps=2)
    fit = fit_friction(data)
    found = bootstrap(data, fit, 8, np.random.default_rng(2))
    counts = resample(data, 8, np.random.default_rng(2))
    error = np.sqrt(np.diag(fit.covariance))
    for draw in range(8):
        again, _ = polished(_drawn(data, counts.steady[draw], counts.motions[draw]), fit)
        expected = np.array([again.values[name] for name in found.names])
        assert np.max(np.abs(found.values[draw] - expected) / error) < 1e-5


def test_each_kind_is_drawn_within_its_direction() -> None:
    data = simulated(TRUTH, np.random.default_rng(3), ramps=3)
    counts = resample(data, 50, np.random.default_rng(4))
    runs, starts = np.split(counts.steady, [data.torque.size], axis=1)
    for sign in (1, -1):
        for sample, own in ((runs, data.run_direction), (starts, data.start_direction)):
            assert np.all(sample[:, own == sign].sum(axis=1) == np.count_nonzero(own == sign))
        motion = np.array([motion.direction for motion in data.momenta]) == sign
        assert np.all(counts.motions[:, motion].sum(axis=1) == 3)


def test_the_spread_of_the_draws_is_the_standard_error() -> None:
    generator, ratios = np.random.default_rng(5), []
    for _ in range(8):
        data = simulated(TRUTH, generator, speeds=np.geomspace(0.004, 2.5, 60), starts=30)
        fit = fit_friction(data)
        spread = bootstrap(data, fit, 200, generator).values.std(axis=0)
        ratios.append(spread / np.sqrt(np.diag(fit.covariance)))
    assert np.mean(ratios, axis=0) == pytest.approx(1.0, abs=0.15)


def test_spreading_the_draws_over_threads_changes_nothing() -> None:
    data = simulated(TRUTH, np.random.default_rng(7))
    fit = fit_friction(data)
    alone = bootstrap(data, fit, 600, np.random.default_rng(8))
    with ThreadPoolExecutor(2) as threads:
        spread = bootstrap(data, fit, 600, np.random.default_rng(8), map=threads.map)
    np.testing.assert_array_equal(alone.values, spread.values)
    assert bootstrap(data, fit, 0, np.random.default_rng(8)).values.shape == (0, 8)

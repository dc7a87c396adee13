"""The pooled variance model finds the spread of each direction and the travel over which it averages out."""

from __future__ import annotations

import numpy as np
import pytest

from ident.fit.variance_model import Spread, averaged_out, members, spread_of

ONE_WAY = np.ones(40, dtype=np.int64)
NO_STARTS = np.zeros(0, dtype=np.int64)
UNKNOWN = np.full(400, np.inf)  # scatter within the runs


def test_no_spread_is_found_where_white_noise_explains_the_residuals() -> None:
    generator = np.random.default_rng(1)
    found = [
        spread_of(
            1e-3 * generator.standard_normal(40),
            np.ones((40, 1)),
            np.full(40, 1e-6),
            members(ONE_WAY, NO_STARTS),
            np.ones(40),
            UNKNOWN[:40],
        ).variances[0]
        for _ in range(30)
    ]
    assert float(np.median(found)) < 0.25e-6


def test_spread_and_wavelength_are_recovered() -> None:
    generator = np.random.default_rng(2)
    travel = np.geomspace(0.01, 50.0, 400)
    ways = np.ones(400, dtype=np.int64)
    truth = Spread(np.array([1e-4, 0.0]), 1.0)
    residual = np.sqrt(truth.of_runs(ways, travel) + 1e-8) * generator.standard_normal(400)
    groups = members(ways, NO_STARTS)
    found = spread_of(residual, np.zeros((400, 0)), np.full(400, 1e-8), groups, travel, UNKNOWN)
    assert found.variances[0] ** 0.5 == pytest.approx(0.01, rel=0.2)
    assert 0.3 < found.wavelength < 3.0


def test_each_direction_has_its_own_spread() -> None:
    generator = np.random.default_rng(3)
    ways = np.array([1, -1] * 200)
    residual = np.where(ways > 0, 1e-3, 4e-3) * generator.standard_normal(400)
    found = spread_of(
        residual, np.ones((400, 1)), np.full(400, 1e-12), members(ways, NO_STARTS), np.ones(400), UNKNOWN
    )
    assert np.sqrt(found.variances) == pytest.approx([1e-3, 4e-3], rel=0.2)


@pytest.mark.parametrize(
    ("starts", "groups"),
    [
        ([1, 1, -1, -1], [[0, 1], [2, 3], [4, 5], [6, 7]]),  # each way its own
        ([1, 1, 1, -1], [[0, 1], [2, 3], [4, 5, 6, 7]]),  # the single one takes the other's
        ([1, -1], [[0, 1, 4], [2, 3, 5]]),  # none shows a spread: the steady runs'
        ([], [[0, 1], [2, 3]]),
    ],
)
def test_who_shares_a_spread(starts: list[int], groups: list[list[int]]) -> None:
    found = members(np.array([1, 1, -1, -1]), np.array(starts, dtype=np.int64))
    assert [np.flatnonzero(group).tolist() for group in found] == groups


def test_a_spread_that_never_averages_out_stays() -> None:
    assert averaged_out(np.array([0.1, 1e6]), np.inf) == pytest.approx([1.0, 1.0])


def test_ripple_that_no_long_run_shows_explains_nothing() -> None:
    generator = np.random.default_rng(4)
    travel = np.geomspace(0.01, 50.0, 400)
    ways = np.ones(400, dtype=np.int64)
    truth = Spread(np.array([1e-4, 0.0]), 1.0)
    residual = np.sqrt(truth.of_runs(ways, travel) + 1e-8) * generator.standard_normal(400)
    data = (residual, np.zeros((400, 0)), np.full(400, 1e-8), members(ways, NO_STARTS), travel)
    assert np.isfinite(spread_of(*data, np.full(400, 0.01)).wavelength)
    quiet = spread_of(*data, np.full(400, 1e-3))
    assert not np.isfinite(quiet.wavelength)
    assert quiet.variances[0] == pytest.approx(float(np.mean(residual**2)), rel=0.05)

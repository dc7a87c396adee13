"""A thousand random loops: every one ends, for a reason that a restart confirms."""

import numpy as np
import pytest

from benchmarks.random_campaign import Failures, random_tables, run_campaign


def test_no_trajectory_fails() -> None:
    assert run_campaign(1000, np.random.default_rng(7)) == Failures(0, 0, 0)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_campaign_is_the_seed(seed: int) -> None:
    first, again = (random_tables(5, np.random.default_rng(seed)) for _ in range(2))
    np.testing.assert_array_equal(first, again)

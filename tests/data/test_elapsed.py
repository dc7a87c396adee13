"""Differences of large numbers are exact to how they are written; stamps that were never set are counted."""

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data.elapsed import since_first, since_first_written, unset_lead


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.integers(-(10**19), 10**19), min_size=1, max_size=12),
    st.integers(0, 9),
    st.sampled_from([".", ","]),
    st.booleans(),
)
def test_written_numbers_equal_exact_arithmetic(
    ticks: list[int], places: int, decimal: str, alike: bool
) -> None:
    if alike:  # the same number of digits each
        ticks = [abs(tick) % 10**18 + 10**18 for tick in ticks]
    exact = [Decimal(tick).scaleb(-places) for tick in ticks]
    cells = [f"{tick:f}".replace(".", decimal) for tick in exact]
    expected = [float((tick - ticks[0]) / 10**places) for tick in ticks]
    assert np.allclose(since_first_written(cells, decimal), expected, rtol=4e-16, atol=0)
    assert np.allclose(since_first(exact), expected, rtol=4e-16, atol=0)


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["17", "1", "123"], [0, -16, 106]),
        (["1.5e3", "1.6e3"], [0, 100]),
        (["", "5", "x", "7"], [np.nan, 0, np.nan, 2]),
        (["99", "9x"], [0, np.nan]),
        (["9" * 19, "9" * 18 + "8"], [0, -1]),
        (["x"], [np.nan]),
        ([], []),
    ],
)
def test_numbers_of_any_form(cells: list[str], expected: list[float]) -> None:
    assert np.array_equal(since_first_written(cells, "."), expected, equal_nan=True)


@pytest.mark.parametrize(
    ("seconds", "lead"),
    [
        ([], 0),
        ([0, 0], 0),
        ([0, 1e-3], 0),
        ([0, 1.7e9], 1),
        ([0, 0, 1.7e9, 0], 2),
        ([1.7e9, 0], 0),
        ([5, 1.7e9], 0),
    ],
)
def test_only_stamps_of_zero_before_a_date_were_never_set(seconds: list[float], lead: int) -> None:
    assert unset_lead(np.array(seconds, np.float64)) == lead

"""What counts as a number at a door."""

import math

import numpy as np
import pytest

from ident.model.numbers import is_count, is_number, is_number_or_inf, is_one_of, real_array, shown
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, NO_WORDS


@pytest.mark.parametrize("value", [0, -1.5, np.float32(2.0), np.int64(3)])
def test_finite_reals_of_python_and_numpy_are_numbers(value: object) -> None:
    assert is_number(value)
    assert is_number_or_inf(value)


@pytest.mark.parametrize("value", [*NO_NUMBERS, math.inf])
def test_all_else_is_none(value: object) -> None:
    assert not is_number(value)
    assert is_number_or_inf(value) == (value is math.inf)


def test_only_a_word_is_one_of_some_words() -> None:
    assert is_one_of("r", ("r", "L"))
    assert not any(is_one_of(value, ("r", "L")) for value in NO_WORDS)


def test_counts_are_whole() -> None:
    assert is_count(2)
    assert is_count(np.int64(-1))
    assert not any(map(is_count, (1.0, True, "1", None)))


@pytest.mark.parametrize("values", NO_ARRAYS)
def test_words_objects_and_ragged_rows_are_no_arrays(values: object) -> None:
    assert real_array(values) is None  # type: ignore[arg-type]  # wrong on purpose


def test_an_array_is_a_copy_of_floats_of_any_shape() -> None:
    given = np.array([[1.0, math.nan]])
    found = real_array(given)
    assert found is not None
    assert not np.shares_memory(given, found)
    np.testing.assert_array_equal(found, given)
    whole = real_array([1, 2])
    assert whole is not None
    assert whole.dtype == np.float64


def test_a_long_value_is_shown_on_one_short_line() -> None:
    assert len(shown(np.eye(40))) < 50
    assert "\n" not in shown(np.eye(3))

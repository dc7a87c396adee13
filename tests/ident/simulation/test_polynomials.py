"""Packs of terms sum to what numpy's polynomials do, whatever the degree."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from ident.simulation.polynomials import evaluate, scale, sum_up

ROWS = 3
CLOSE = 1e-14  # of the sum of all terms' magnitudes
FloatArray = NDArray[np.float64]


@st.composite
def polynomials(draw: st.DrawFn) -> FloatArray:
    """Rows (4, degree + 1) of coefficients; the last row must be left alone."""
    degree = draw(st.integers(1, 24))
    numbers = st.floats(-1e3, 1e3)
    return np.array(draw(st.lists(numbers, min_size=4 * (degree + 1), max_size=4 * (degree + 1)))).reshape(
        4, -1
    )


@given(polynomials(), st.floats(0.0, 1.0))
def test_values_are_those_of_the_polynomials(rows: FloatArray, at: float) -> None:
    found = np.empty(ROWS)
    evaluate(rows, ROWS, rows.shape[1] - 1, at, found)
    allowed = CLOSE * np.sum(np.abs(rows[:ROWS]), axis=1)
    assert np.all(np.abs(found - polyval(at, rows[:ROWS].T)) <= allowed)


@given(polynomials())
def test_ends_and_how_far_they_are_away(rows: FloatArray) -> None:
    end, spreads = np.empty(ROWS), np.empty(ROWS)
    sum_up(rows, ROWS, rows.shape[1] - 1, end, spreads)
    furthest = np.sum(np.abs(rows[:ROWS, 1:]), axis=1)
    assert np.allclose(spreads, furthest, rtol=1e-13, atol=0.0)
    assert np.all(np.abs(end - np.sum(rows[:ROWS], axis=1)) <= CLOSE * (furthest + np.abs(rows[:ROWS, 0])))


@given(polynomials(), st.floats(1e-3, 10.0))
def test_scaled_coefficients_belong_to_the_part_of_the_step(rows: FloatArray, length: float) -> None:
    scaled = rows.copy()
    scale(scaled, ROWS, rows.shape[1] - 1, length)
    assert np.allclose(scaled[:ROWS], rows[:ROWS] * length ** np.arange(rows.shape[1]), rtol=1e-13, atol=0.0)
    assert np.all(scaled[ROWS:] == rows[ROWS:])

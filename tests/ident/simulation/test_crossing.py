"""First zeros of polynomials on (0, 1], against their known roots."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ident.simulation.crossing import first_crossing


def crossing(roots: list[float], sign: int = 1, contact: int = 0) -> float:
    """Of the polynomial with these roots, oriented to start on the side of `sign`."""
    polynomial = np.polynomial.polynomial.polyfromroots(roots).astype(float)
    lead = polynomial[np.flatnonzero(np.abs(polynomial) > 0)[0]]
    polynomial *= sign / math.copysign(1.0, lead)
    return first_crossing(polynomial, polynomial.size - 1, sign, contact, np.empty(polynomial.size))


@settings(deadline=None)  # the first example may compile
@given(
    st.lists(st.floats(0.02, 3.0), min_size=1, max_size=6).filter(
        lambda roots: all(abs(a - b) > 0.02 for i, a in enumerate(roots) for b in roots[:i])
    ),
    st.sampled_from([-1, 1]),
)
def test_the_first_of_simple_roots_is_found(roots: list[float], sign: int) -> None:
    first = min(roots)
    expected = first if first <= 1.0 else math.inf
    if abs(first - 1.0) > 1e-9:
        assert crossing(roots, sign) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None)  # the first example may compile
@given(st.floats(0.1, 0.9), st.floats(1e-12, 1e-3))
def test_a_graze_that_misses_is_no_crossing_and_one_that_dips_is(at: float, depth: float) -> None:
    missed = np.array([at * at + depth, -2 * at, 1.0])
    dipped = np.array([at * at - depth, -2 * at, 1.0])
    work = np.empty(3)
    assert first_crossing(missed, 2, 1, 0, work) == math.inf
    assert first_crossing(dipped, 2, 1, 0, work) == pytest.approx(at - math.sqrt(depth), abs=1e-8)


def test_a_start_on_the_surface_is_not_found_again() -> None:
    assert crossing([0.0, 0.5], contact=1) == pytest.approx(0.5, abs=1e-15)
    assert crossing([0.0, 0.0, 0.25], contact=2) == pytest.approx(0.25, abs=1e-15)
    noisy = np.array([0.0, -1e-17, 1.0])  # rounding in a coefficient that vanishes
    assert first_crossing(noisy, 2, 1, 1, np.empty(3)) == math.inf


def test_a_polynomial_that_vanishes_identically_has_no_crossing() -> None:
    assert first_crossing(np.zeros(8), 7, 1, 1, np.empty(8)) == math.inf

"""The series of shape 1 against the plain recurrence of both shapes, and what it must keep exactly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from benchmarks.random_campaign import random_tables
from compensation.bell_series import bell_series
from compensation.loop_parameters import COLUMNS, ROWS, SHAPE2, SHAPEV, mode_table
from compensation.loop_series import series
from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray, Signs
from ident.simulation.integrate import WORK_ROWS
from ident.simulation.taylor import ORDER

Series = Callable[[Signs, FloatArray, FloatArray, FloatArray, FloatArray], float]
TABLES = [
    table
    for table in random_tables(200, np.random.default_rng(5))
    if np.all(table[:4, [SHAPE2, SHAPEV]] == 1)
]
signed = st.sampled_from([-1, 1])
speeds = st.floats(1e-6, 3.0)


@compiled
def fast(
    signs: Signs, state: FloatArray, table: FloatArray, coefficients: FloatArray, work: FloatArray
) -> float:
    return series(signs, state, table, ORDER, coefficients, work)


@compiled
def plain(
    signs: Signs, state: FloatArray, table: FloatArray, coefficients: FloatArray, work: FloatArray
) -> float:
    return bell_series(signs, state, table, ORDER, coefficients, work)


def of(
    kernel: Series, signs: NDArray[np.int64], state: FloatArray, table: FloatArray
) -> tuple[float, FloatArray]:
    """Reach and coefficients (3, ORDER + 1), from memory full of nan."""
    coefficients, work = np.full((3, ORDER + 1), np.nan), np.full((WORK_ROWS, ORDER + 1), np.nan)
    return kernel(signs, state, table, coefficients, work), coefficients


@given(st.sampled_from(TABLES), signed, signed, st.floats(-2.0, 2.0), speeds, speeds)
def test_it_is_the_plain_recurrence(
    table: FloatArray, sign2: int, signv: int, x1: float, speed2: float, speedv: float
) -> None:
    signs, x2 = np.array([sign2, signv]), sign2 * speed2
    state = np.array([x1, x2, signv * speedv - x2])
    reach, found = of(fast, signs, state, table)
    reach_plain, expected = of(plain, signs, state, table)
    # a term is as exact as those that it is made of, which may cancel: all are measured by the fastest growth
    size = np.max(np.abs(expected), axis=0)
    growth = np.max(size[1:] ** (1.0 / np.arange(1, ORDER + 1)))
    scale = np.maximum(np.abs(state).max(), 1.0) * growth ** np.arange(ORDER + 1)
    assert np.all(np.abs(found - expected) <= 1e-12 * np.maximum(size, scale))
    assert reach == pytest.approx(reach_plain, rel=1e-9)


@given(st.floats(-2.0, 2.0), st.floats(-3.0, 3.0).filter(lambda x2: abs(x2) > 1e-9))
def test_an_error_of_nothing_stays_nothing_bit_for_bit(x1: float, x2: float) -> None:
    laws = np.tile([0.5429, 0.39385, 0.07525, 0.0809, 1.0], (4, 1))
    table = np.zeros((ROWS, COLUMNS))
    mode_table(laws, np.array([0.026, 0.026]), np.array([0.4, 0.02, 73.5, 1.0]), table)
    side = 1 if x2 > 0 else -1
    _, found = of(fast, np.array([side, side]), np.array([x1, x2, 0.0]), table)
    assert np.all(found[2] == 0.0)

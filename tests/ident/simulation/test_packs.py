"""Packs compute what scalars compute, to two units in the last place."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ident.simulation.compiled import compiled
from ident.simulation.pack_functions import exponential, exponential_less_one, rough_power_of_two
from ident.simulation.packs import fused, number_of, pack_at, packed, place_pack, rough_log2

WIDTH = 8
ULP = float(np.finfo(np.float64).eps)
FloatArray = NDArray[np.float64]


@compiled
def functions(x: FloatArray, out: FloatArray) -> None:
    pack = pack_at(8, x, 0)
    place_pack(out, 0, exponential(pack))
    place_pack(out, 8, exponential_less_one(pack))
    place_pack(out, 16, rough_power_of_two(pack))


@compiled
def logarithms(x: FloatArray, out: FloatArray) -> None:
    place_pack(out, 0, rough_log2(pack_at(8, x, 0)))


@compiled
def sum_of_four(x: FloatArray) -> float:
    a, b = pack_at(4, x, 0), packed(x[4], x[5], x[6], x[7])
    c = fused(a, b, a - b) + a * b / b
    return float(number_of(c, 0) + number_of(c, 1) + number_of(c, 2) + number_of(c, 3))


def of(x: list[float]) -> FloatArray:
    out = np.empty((3, WIDTH))
    functions(np.array(x), out)
    return out


numbers = st.lists(st.floats(-700.0, 700.0, allow_subnormal=False), min_size=WIDTH, max_size=WIDTH)


@given(numbers)
def test_exponentials_are_right_to_two_units_in_the_last_place(x: list[float]) -> None:
    exact, less = np.exp(x), np.expm1(x)
    whole, without, rough = of(x)
    assert np.all(np.abs(whole - exact) <= 2 * ULP * exact)
    assert np.all(np.abs(without - less) <= 4 * ULP * np.abs(less))
    assert np.all(rough <= 2.0 ** np.array(x))
    assert np.all(rough >= 0.985 * 2.0 ** np.array(x))


def test_exp_less_one_of_nothing_is_nothing_bit_for_bit() -> None:
    assert np.all(of([0.0, -0.0] * 4)[1] == 0.0)


@given(st.lists(st.floats(1e-300, 1e300), min_size=WIDTH, max_size=WIDTH))
def test_the_rough_logarithm_is_at_most_a_little_too_small(x: list[float]) -> None:
    out = np.empty(WIDTH)
    logarithms(np.array(x), out)
    assert np.all(out <= np.log2(x) + 1e-9)
    assert np.all(out >= np.log2(x) - 0.0861)


def test_arithmetic_is_that_of_each_number() -> None:
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0])
    a, b = x[:4], x[4:]
    assert sum_of_four(x) == float(np.sum(a * b + (a - b) + a))

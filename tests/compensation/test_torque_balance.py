"""The roots behind the equilibrium sets, against scipy's Lambert W and a dense scan."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import lambertw

from compensation.lambert_roots import minus_lambert
from compensation.torque_balance import TorqueBalance

balances = st.builds(
    TorqueBalance,
    slope=st.floats(0.05, 5.0),
    onset=st.one_of(st.just(0.0), st.floats(-0.6, 0.3)),
    fading=st.floats(0.0, 0.5),
    stribeck_velocity=st.floats(0.01, 0.5),
    stribeck_shape=st.one_of(st.just(1.0), st.floats(0.4, 3.0)),
)


@pytest.mark.parametrize("exponent", [1.0 + 1e-3, 1.2, 2.0, 5.0, 50.0, 650.0])
def test_both_branches_are_lamberts(exponent: float) -> None:
    upper, lower = minus_lambert(exponent)
    assert upper == pytest.approx(-lambertw(-math.exp(-exponent), 0).real, rel=1e-11)
    assert lower == pytest.approx(-lambertw(-math.exp(-exponent), -1).real, rel=1e-11)


@given(st.floats(1.0, 1e12))
def test_branches_solve_their_equation_where_the_argument_underflows(exponent: float) -> None:
    upper, lower = minus_lambert(exponent)
    assert upper <= 1.0 <= lower
    assert lower - math.log(lower) == pytest.approx(exponent, rel=1e-13)
    if upper > 0.0:
        assert upper - math.log(upper) == pytest.approx(exponent, rel=1e-13)


@given(balances)
def test_a_dense_scan_finds_nothing_else(balance: TorqueBalance) -> None:
    ranges = balance.resting()
    end = max(balance.far_margin, 0.0) / balance.slope
    speeds = np.concatenate(
        (np.geomspace(1e-9, 1.0, 300) * (end + 1e-9), np.linspace(1e-6, 1.2 * end + 1e-6, 600))
    )
    for speed in speeds:
        excess = balance.excess(float(speed))
        inside = any(low < speed < high for low, high in ranges)
        if abs(excess) > 1e-12:
            assert inside == (excess < 0.0), (speed, excess, ranges)


@given(balances)
def test_every_edge_is_a_root(balance: TorqueBalance) -> None:
    for low, high in balance.resting():
        for edge in (low, high):
            if edge > 0.0:
                assert balance.excess(edge) == pytest.approx(0.0, abs=1e-12)


def test_general_root_search_agrees_with_the_closed_form() -> None:
    closed = TorqueBalance(1.12, 0.005, 0.16, 0.07525, 1.0).resting()
    near = TorqueBalance(1.12, 0.005, 0.16, 0.07525, 1.0 + 1e-13).resting()
    assert len(closed) == 1
    assert near[0] == pytest.approx(closed[0], rel=1e-9)


def test_without_gain_and_damping_a_set_has_no_end() -> None:
    assert TorqueBalance(0.0, -0.1, 0.2, 0.1, 1.0).resting() == ((0.0, math.inf),)
    ((low, high),) = TorqueBalance(0.0, 0.1, 0.2, 0.1, 1.0).resting()
    assert TorqueBalance(0.0, 0.1, 0.2, 0.1, 1.0).excess(low) == pytest.approx(0.0, abs=1e-15)
    assert high == math.inf
    assert TorqueBalance(0.0, 0.3, 0.2, 0.1, 1.0).resting() == ()


@pytest.mark.parametrize("shape", [0.6, 1.0, 1.7])
def test_extreme_arguments_neither_overflow_nor_lose_the_edge(shape: float) -> None:
    ((low, high),) = TorqueBalance(1e-6, -0.2, 1e-3, 1e-5, shape).resting()
    assert low == 0.0
    assert high == pytest.approx(0.201 / 1e-6, rel=1e-9)

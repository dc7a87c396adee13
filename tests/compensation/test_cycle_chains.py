"""Chains of cycles: who continues whom, and which steps leave the trend."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compensation.cycle_chains import Chain, chained, parted, suspects
from compensation.orbits.periodic_orbits import Cycle


def cycle(size: float, returns: int = 1, shift: float = 0.0) -> Cycle:
    return Cycle(np.array([size, 0.0]), returns, 6.0, shift - size, shift + size, (0.1, 0.0), stable=True)


def amplitudes(chains: list[Chain]) -> list[tuple[int, list[float]]]:
    return [(chain.first, [c.amplitude for c in chain.cycles]) for chain in chains]


def test_cycles_that_coexist_are_chained_each_to_its_nearest() -> None:
    chains = chained([[cycle(0.3)], [cycle(0.5), cycle(0.31)], [cycle(0.32), cycle(0.52)]])
    assert amplitudes(chains) == [(0, [0.3, 0.31, 0.32]), (1, [0.5, 0.52])]


def test_a_chain_that_ends_takes_no_cycle_from_one_that_goes_on() -> None:
    chains = chained([[cycle(0.3), cycle(0.5)], [cycle(0.49)], [cycle(0.48)]])
    assert amplitudes(chains) == [(0, [0.3]), (0, [0.5, 0.49, 0.48])]


def test_cycles_of_other_returns_begin_a_chain_of_their_own() -> None:
    pair = [cycle(0.3, 2, 0.05), cycle(0.3, 2, -0.05)]
    chains = chained([[cycle(0.3)], pair, pair[::-1]])
    assert [(chain.first, len(chain.cycles)) for chain in chains] == [(0, 1), (1, 2), (1, 2)]
    assert all(len({c.x1_max for c in chain.cycles}) == 1 for chain in chains)


@given(st.integers(4, 40), st.integers(0, 39), st.sampled_from([-1.0, 1.0]), st.floats(1.0, 50.0))
def test_a_jump_is_a_suspect_wherever_it_is(n: int, at: int, sign: float, steps: float) -> None:
    """A jump of so many usual steps, up or down, on an uneven grid."""
    values = np.cumsum(np.linspace(1.0, 2.0, n))
    at %= n - 1
    slope = 0.01 * (1.0 + 0.01 * values)
    sizes = 1.0 + slope * values
    sizes[at + 1 :] += sign * steps * 1.5 * (sizes[at + 1] - sizes[at])
    chain = Chain(0, [cycle(float(size)) for size in np.abs(sizes) + 1.0])
    assert at in suspects(chain, values)


@pytest.mark.parametrize("growth", [np.sqrt, np.square, np.sin])
def test_a_smooth_branch_has_no_suspects(growth: np.ufunc) -> None:
    values = np.linspace(0.01, 1.0, 100)
    chain = Chain(1, [cycle(float(size)) for size in growth(values[1:-1])])
    assert suspects(chain, values) == []


def test_a_chain_is_parted_after_its_cuts() -> None:
    chain = Chain(5, [cycle(0.1 * k) for k in range(1, 7)])
    assert [(part.first, len(part.cycles)) for part in parted(chain, [0, 3])] == [(5, 1), (6, 3), (9, 2)]
    assert amplitudes(parted(chain, [])) == amplitudes([chain])

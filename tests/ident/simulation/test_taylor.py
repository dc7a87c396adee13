"""The length of a Taylor step: the rough one is that of its rule, to a hundredth."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ident.simulation.compiled import compiled
from ident.simulation.packs import number_of, spread
from ident.simulation.taylor import ORDER, true_length

magnitudes = st.floats(1e-200, 1e100)


@compiled
def length_of(allowed: float, last: float, before: float) -> float:
    return float(number_of(true_length(spread(4, allowed), spread(4, last), spread(4, before)), 0))


@given(st.floats(1e-18, 1.0), magnitudes, magnitudes)
def test_the_last_two_terms_are_what_is_allowed(allowed: float, last: float, before: float) -> None:
    exact = min(np.exp(np.log(allowed / last) / ORDER), np.exp(np.log(allowed / before) / (ORDER - 1)))
    assert 0.98 * exact <= length_of(allowed, last, before) <= 1.004 * exact

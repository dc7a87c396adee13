"""Quantiles are Student's, and an interval stays where its parameter can lie."""

from __future__ import annotations

import pytest
from scipy.stats import t as student

from ident.fit.confidence import quantile, symmetric


def test_the_quantile_is_students() -> None:
    assert quantile(7) == pytest.approx(float(student.ppf(0.975, 7)))
    assert quantile(0) == quantile(1)


def test_a_symmetric_interval_is_cut_at_what_cannot_be() -> None:
    interval = symmetric(0.1, 0.2, 20, least=0.0)
    assert interval.low == 0.0
    assert interval.high == pytest.approx(0.1 + quantile(20) * 0.2)

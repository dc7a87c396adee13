"""L_c = 73.07 follows from the unrounded means of Table 1, not from its printed mean column."""

from __future__ import annotations

import pytest

from compensation.design_criteria import critical_observer_gains
from ident.model.friction import StribeckCurve
from ident.model.published import INERTIA, asymmetric_robot

PRINTED_MEAN = StribeckCurve(0.5429, 0.3939, 0.0753, 0.0809)


def test_critical_observer_gains() -> None:
    found = critical_observer_gains(asymmetric_robot())
    assert round(found.mean, 2) == 73.07  # the paper, section 4.1
    assert found.mean == pytest.approx(73.0704, abs=5e-5)
    assert round(found.positive, 2) == 94.37
    assert round(found.negative, 2) == 55.15
    assert found.worst == found.positive


def test_the_rounded_mean_column_would_not_give_it() -> None:
    rounded = (PRINTED_MEAN.steepest_fall - PRINTED_MEAN.viscous_damping) / INERTIA
    assert rounded == pytest.approx(72.994, abs=5e-4)

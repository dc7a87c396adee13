"""Figures 4 and 8: equilibrium sets over the observer gain."""

from __future__ import annotations

import numpy as np
import pytest

from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains
from compensation.equilibria import EquilibriumSet, equilibrium_set, equilibrium_sets
from ident.model.published import DERIVATIVE_GAIN, PROPORTIONAL_GAIN, symmetric_robot

ROBOT = symmetric_robot()
CRITICAL = critical_observer_gains(ROBOT).mean


def rests(r: float, L: float, n1: float = PROPORTIONAL_GAIN, n2: float = DERIVATIVE_GAIN) -> EquilibriumSet:
    return equilibrium_set(ROBOT, Controller(Gains(n1, n2, observer=L, compensation=r), ROBOT))


def test_the_exact_set_collapses_at_the_critical_gain() -> None:
    """Figure 4: just below, the set shrinks in proportion to L_c - L; from L_c on it is a point."""
    errors = [rests(1.0, CRITICAL - distance).largest_error for distance in (1e-2, 1e-3, 1e-4)]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=1e-2)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=1e-3)
    assert rests(1.0, CRITICAL + 1e-9).is_single_point
    assert rests(1.0, 1e3).is_single_point


def test_compensation_makes_the_set_much_smaller() -> None:
    for L in np.linspace(1.0, 120.0, 60):
        assert rests(1.0, float(L)).largest_error < rests(0.0, float(L)).largest_error
    assert rests(0.0, 40.0).largest_error / rests(1.0, 40.0).largest_error > 5.0


def test_the_uncompensated_set_tends_to_the_static_friction() -> None:
    """Without compensation and with a fast observer the error is F_s / n1, as of a plain PD controller."""
    static = ROBOT.friction.positive.static_torque
    assert rests(0.0, 1e7).largest_error == pytest.approx(static / PROPORTIONAL_GAIN, rel=1e-5)


def test_more_n1_shrinks_the_set_and_more_n2_widens_it() -> None:
    """Section 4.1, last paragraph."""
    middle = rests(1.0, 40.0).largest_error
    assert rests(1.0, 40.0, n1=0.5).largest_error < middle < rests(1.0, 40.0, n2=0.05).largest_error


def test_undercompensation_leaves_a_set_for_every_observer_gain() -> None:
    """Figure 8, r < 1."""
    for r in (0.9, 0.99):
        sets = equilibrium_sets(
            ROBOT,
            Controller(Gains(0.4, 0.02, 1.0, r), ROBOT),
            parameter="L",
            values=np.linspace(1.0, 1e3, 50),
        )
        assert not any(found.is_single_point or found.origin_isolated for found in sets)
    assert rests(0.99, 80.0).largest_error < rests(0.9, 80.0).largest_error < rests(0.0, 80.0).largest_error


def test_overcompensation_leaves_one_only_very_close_to_one() -> None:
    """Figure 8, r > 1: the origin is isolated, and the set is soon gone."""
    near = rests(1.01, 40.0)
    assert near.origin_isolated
    assert not near.is_single_point
    last = {
        L: max(r for r in np.linspace(1.0, 1.2, 2001) if not rests(float(r), L).is_single_point)
        for L in (40.0, 60.0)
    }
    assert 1.0 < last[60.0] < last[40.0] < 1.06
    assert rests(1.0001, 73.5).is_single_point

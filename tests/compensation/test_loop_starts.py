"""Starts for cycles: lengths that scale as the loop does."""

from dataclasses import replace

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.loop_starts import NEAR, start_sizes
from ident.model.published import symmetric_robot

LOOP = ClosedLoop(symmetric_robot(), Controller(Gains(0.4, 0.02, 73.5, 1.0), symmetric_robot()))


def test_near_starts_go_to_zero_with_the_push_beyond_friction() -> None:
    distances = np.array([1e-12, 1e-9, 1e-3])
    static = symmetric_robot().friction.positive.static_torque
    near = start_sizes(LOOP, "r", 1.0 + distances)[:, 1]
    np.testing.assert_allclose(near, distances * static / 0.4, rtol=1e-3)


def test_starts_grow_with_a_huge_gain() -> None:
    moderate, huge = start_sizes(LOOP, "r", np.array([10.0, 1e12]))
    assert huge[0] == pytest.approx(1e11 * moderate[0])
    assert (huge[1], moderate[1]) == (pytest.approx(NEAR * huge[0]), pytest.approx(NEAR * moderate[0]))


def test_a_softer_controller_is_looked_at_from_farther_off() -> None:
    gains = replace(LOOP.controller.gains, proportional=0.04)
    softer = ClosedLoop(LOOP.robot, replace(LOOP.controller, gains=gains))
    values = np.array([20.0, 90.0])
    np.testing.assert_allclose(start_sizes(softer, "L", values), 10.0 * start_sizes(LOOP, "L", values))

"""Cycles on which the motion settles, found in a kernel and by the search that knows no robot."""

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_settling import settled
from compensation.orbits.periodic_orbits import Cycle, NoCycle, cycle_at, find_cycle
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot

START = np.array([0.6, 0.0])


def loop(observer: float = 73.5, robot: OneLinkRobot | None = None) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=1.0)
    return ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot()))


@pytest.mark.parametrize(
    ("at", "r"),
    [
        (loop(), 1.01),
        (loop(), 1.000001),  # two returns: not symmetric any more
        (loop(120.0), 1.001),  # contracts slowly
        (loop(robot=asymmetric_robot()), 1.05),
    ],
)
def test_a_settled_cycle_is_the_one_that_a_search_finds(at: ClosedLoop, r: float) -> None:
    found = settled(at, "r", r, START)
    assert isinstance(found, Cycle)
    section = LoopSection(with_gain(at, "r", r))
    searched = cycle_at(section, found.point, found.returns)
    assert isinstance(searched, Cycle)
    assert isinstance(find_cycle(section, START), Cycle)
    np.testing.assert_allclose(found.point, searched.point, rtol=1e-9, atol=1e-14)
    assert found.period == pytest.approx(searched.period, rel=1e-10)
    assert (found.x1_min, found.x1_max) == pytest.approx((searched.x1_min, searched.x1_max), rel=1e-10)
    np.testing.assert_allclose(found.multipliers, searched.multipliers, rtol=1e-6, atol=1e-8)
    assert found.stable


def test_motion_that_rests_or_decays_settles_on_no_cycle() -> None:
    assert isinstance(settled(loop(), "r", 0.95, START), NoCycle)
    assert isinstance(settled(loop(), "r", 1.0, START), NoCycle)
    assert isinstance(settled(loop(robot=asymmetric_robot()), "r", 0.98, START), NoCycle)


def test_sticks_and_slips_that_die_out_at_the_edge_of_the_rests_are_no_cycle() -> None:
    """A symmetric loop that knows its friction rests from everywhere if r < 1."""
    random = np.random.default_rng(3)
    for _ in range(60):
        coulomb = random.uniform(0.05, 1.0)
        curve = StribeckCurve(
            static_torque=coulomb * random.uniform(1.02, 2.0),
            coulomb_torque=coulomb,
            stribeck_velocity=10 ** random.uniform(-2.3, -0.3),
            viscous_damping=10 ** random.uniform(-2.0, 0.2),
            stribeck_shape=1.0,
        )
        robot = OneLinkRobot(10 ** random.uniform(-2.3, -0.3), StribeckFriction.symmetric(curve))
        stiffness = 10 ** random.uniform(-1.5, 0.7)
        gains = Gains(stiffness, 0.2 * stiffness, random.uniform(3.0, 80.0), 1.0)
        at = ClosedLoop(robot, Controller(gains, robot))
        for r in (0.7, 0.95, 0.999):
            assert isinstance(settled(at, "r", r, START), NoCycle)
            assert isinstance(find_cycle(LoopSection(with_gain(at, "r", r)), START), NoCycle)

"""Which law certifies what."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given

from compensation.certificates import Certificate, certificates, law_gap
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from ident.model.friction import StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.strategies import controllers, robots


def gains(L: float = 73.5, r: float = 1.0) -> Gains:
    return Gains(0.4, 0.02, observer=L, compensation=r)


def named(found: tuple[Certificate, ...], start: str) -> Certificate:
    (only,) = [certificate for certificate in found if certificate.hypothesis.startswith(start)]
    return only


def test_the_papers_theorem_on_the_papers_robot() -> None:
    robot = symmetric_robot()
    found = certificates(robot, Controller(gains(), robot), law="mean")
    assert named(found, "theorem").holds
    assert named(found, "theorem").margin == pytest.approx(0.4296, abs=1e-4)
    assert named(found, "the set point").holds
    assert not named(certificates(robot, Controller(gains(73.0), robot), law="mean"), "theorem").holds


@pytest.mark.parametrize("L", [73.5, 100.0, 1e4])
def test_the_mean_law_certifies_nothing_for_the_asymmetric_robot(L: float) -> None:
    robot = asymmetric_robot()
    found = certificates(robot, Controller(gains(L), robot.mean()), law="mean")
    assert not named(found, "theorem").holds
    assert not named(found, "(a)").holds
    assert named(found, "(a)").margin is None
    assert not named(found, "the compensator carries").holds
    assert not named(found, "r F_s^ >= F_s (positive)").holds
    assert not named(found, "the set point").holds
    assert named(found, "contraction").holds == (L > 94.37)
    assert named(found, "L > L_c(mean)").holds
    assert "certifies nothing" in named(found, "L > L_c(mean)").says


def test_each_directions_own_law_needs_the_worst_gain() -> None:
    robot = asymmetric_robot()
    below = certificates(robot, Controller(gains(94.3), robot), law="per-direction")
    above = certificates(robot, Controller(gains(94.4), robot), law="per-direction")
    assert not named(below, "theorem").holds
    assert named(above, "theorem").holds
    assert named(below, "local contraction: L > L_c (negative)").holds
    assert not named(below, "local contraction: L > L_c (positive)").holds
    assert "94.37" in named(below, "theorem").says


def test_r_of_one_is_a_hypothesis() -> None:
    robot = symmetric_robot()
    found = certificates(robot, Controller(gains(80.0, 0.99), robot), law="mean")
    assert not named(found, "r = 1").holds
    assert named(found, "r = 1").margin == pytest.approx(-0.01)
    assert not named(found, "theorem").holds
    assert named(found, "contraction").holds


def test_no_gain_is_enough_for_an_infinitely_steep_law() -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=0.8)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    found = named(certificates(robot, Controller(gains(1e6), robot), law="mean"), "contraction")
    assert (found.holds, found.margin) == (False, None)
    assert "beta < 1" in found.says


@given(robots(), controllers())
def test_statements_agree_with_the_sets(robot: OneLinkRobot, controller: Controller) -> None:
    found = certificates(robot, controller, law="other")
    rests = equilibrium_set(robot, controller)
    assert named(found, "the set point").holds == rests.is_single_point
    for direction in ("positive", "negative"):
        touching = any(s.direction == direction and s.touches_zero for s in rests.segments)
        if not named(found, f"r F_s^ >= F_s ({direction})").holds:
            assert touching
    assert all(c.says and c.law == "other" for c in found)


def test_law_gap_is_the_largest_difference() -> None:
    robot = asymmetric_robot()
    assert law_gap(robot.friction, robot.friction) == 0.0
    assert law_gap(robot.friction, robot.mean().friction) == pytest.approx(0.0306, abs=1e-4)


@pytest.mark.parametrize("damping", [0.0809, 5.0])
def test_without_an_observer_gain_nothing_is_certified(damping: float) -> None:
    """Also where damping alone would make errors contract: the theorem asks for L > 0."""
    curve = replace(symmetric_robot().friction.positive, viscous_damping=damping)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    without = certificates(robot, Controller(gains(L=0.0), robot), law="mean")
    for start in ("contraction", "local contraction: L > L_c (positive)", "L > L_c(mean)", "theorem"):
        found = named(without, start)
        assert not found.holds
        assert found.margin is not None
        assert found.margin <= 0.0
        assert "needs L > 0" in found.says
    assert not named(without, "(a)").holds
    enough = certificates(robot, Controller(gains(L=80.0), robot), law="mean")
    assert named(enough, "theorem").holds


@pytest.mark.parametrize("r", [1.0 + 1e-6, 1.0 - 1e-12])
def test_a_hypothesis_that_fails_by_little_says_so(r: float) -> None:
    robot = symmetric_robot()
    says = named(certificates(robot, Controller(gains(80.0, r), robot), law="mean"), "r = 1").says
    assert says == f"r = {r}: e = 0 is no solution"
    short = certificates(robot, Controller(gains(73.07), robot), law="mean")
    says = named(short, "contraction").says  # L_c = 73.0704
    assert says.startswith("L = 73.07 1/s is 0.0004")
    assert "short of 73.07 1/s" in says


def test_a_margin_is_negative_or_none_where_a_statement_fails() -> None:
    robot = symmetric_robot()
    heavy = replace(robot, inertia=1.1 * robot.inertia)
    own = named(certificates(robot, Controller(gains(80.0), heavy), law="mean"), "the compensator carries")
    assert (own.holds, own.margin) == (False, None)
    assert "inertia" in own.says
    curve = replace(robot.friction.positive, viscous_damping=0.0)
    free = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    undamped = Controller(Gains(0.4, 0.0, observer=200.0, compensation=1.0), free)
    theorem = named(certificates(free, undamped, law="mean"), "theorem")
    assert (theorem.holds, theorem.margin) == (False, 0.0)
    assert "no damping" in theorem.says


def test_what_no_law_shows_is_no_difference() -> None:
    """Without a Stribeck effect friction is Coulomb's whatever v_s and beta are."""
    curve = replace(symmetric_robot().friction.positive, static_torque=0.4, coulomb_torque=0.4)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    other = replace(curve, stribeck_velocity=1.0, stribeck_shape=0.7)
    model = OneLinkRobot(0.026, StribeckFriction.symmetric(other))
    found = certificates(robot, Controller(gains(10.0), model), law="mean")
    assert named(found, "the compensator carries").holds
    assert named(found, "theorem").holds


@given(robots(), controllers())
def test_margins_have_the_sign_of_their_statement(robot: OneLinkRobot, controller: Controller) -> None:
    for one in (Controller(controller.gains, robot), controller):
        for statement in certificates(robot, one, law="any"):
            if statement.margin is not None:
                assert statement.margin >= 0.0 if statement.holds else statement.margin <= 0.0

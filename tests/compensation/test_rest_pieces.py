"""Pieces of the equilibrium set over a gain, against the sets value by value."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensation.closed_loop import ClosedLoop
from compensation.coexistence import largest_compensation_with_rest
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from compensation.loop_section import with_gain
from compensation.loop_tables import Parameter
from compensation.rest_pieces import AROUND, Pieces, change_between, present, rest_pieces
from ident.model.friction import StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from tests.strategies import controllers, robots

VALUES = {"r": np.array([0.0, 0.7, 0.95, 1.0, 1.02, 1.4]), "L": np.array([5.0, 40.0, 73.5, 200.0])}
EITHER: st.SearchStrategy[Parameter] = st.sampled_from(("r", "L"))


def loop(observer: float, *, r: float = 1.0, asymmetric: bool = False) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    robot = asymmetric_robot() if asymmetric else symmetric_robot()
    return ClosedLoop(robot, Controller(gains, symmetric_robot()))


def ranges_at(pieces: Pieces, index: int) -> list[tuple[float, float]]:
    return sorted(
        (float(found[index, 0]), float(found[index, 1]))
        for found in pieces.values()
        if found[index, 0] < found[index, 1]
    )


@settings(max_examples=60, deadline=None)
@given(
    robots(st.just(1.0)) | robots(st.sampled_from((1.0, 2.0))),
    controllers(st.just(1.0)) | controllers(st.sampled_from((1.0, 2.0))),
    EITHER,
)
def test_the_pieces_are_the_segments(
    robot: OneLinkRobot, controller: Controller, parameter: Parameter
) -> None:
    at = ClosedLoop(robot, controller)
    values = VALUES[parameter]
    pieces = rest_pieces(at, parameter, values)
    for index, value in enumerate(values.tolist()):
        here = with_gain(at, parameter, value)
        segments = equilibrium_set(here.robot, here.controller).segments
        expected = [(one.x1_min, one.x1_max) for one in segments if not one.touches_zero]
        touching = [x1 for one in segments if one.touches_zero for x1 in (one.x1_min, one.x1_max)]
        if touching:
            expected.append((min(touching), max(touching)))
        np.testing.assert_allclose(ranges_at(pieces, index), sorted(expected), rtol=1e-12)
        assert ((AROUND, True) in present(pieces, index)) == bool(touching)


@settings(max_examples=60, deadline=None)
@given(robots(st.just(1.0)), controllers(st.just(1.0)), EITHER)
def test_a_change_lies_between_neighbouring_numbers(
    robot: OneLinkRobot, controller: Controller, parameter: Parameter
) -> None:
    at = ClosedLoop(robot, controller)
    values = VALUES[parameter]
    pieces = rest_pieces(at, parameter, values)
    for index in range(values.size - 1):
        first = present(pieces, index)
        if first != present(pieces, index + 1):
            change = change_between(at, parameter, *values[index : index + 2].tolist())
            around = rest_pieces(at, parameter, np.array([np.nextafter(change, 0.0), change]))
            assert present(around, 0) == first != present(around, 1)


@pytest.mark.parametrize("shape", [1.0, 2.0])
def test_rests_beside_the_set_point_vanish_where_coexistence_ends(shape: float) -> None:
    curve = replace(symmetric_robot().friction.positive, stribeck_shape=shape)
    robot = replace(symmetric_robot(), friction=StribeckFriction.symmetric(curve))
    below = ClosedLoop(robot, Controller(loop(20.0).controller.gains, robot))
    expected = largest_compensation_with_rest(robot, below.controller).r_max
    assert expected > 1.0
    middle = 0.5 * (1.0 + expected)
    assert change_between(below, "r", middle, expected + 0.1) == pytest.approx(expected, rel=1e-12)


def test_the_set_point_stands_alone_where_each_direction_is_compensated() -> None:
    at = loop(150.0, asymmetric=True)
    true, model = at.robot.friction, symmetric_robot().friction.positive
    ratios = sorted(curve.static_torque / model.static_torque for curve in (true.positive, true.negative))
    assert change_between(at, "r", 0.98, 1.2) == pytest.approx(ratios[1], rel=1e-14)

"""Wrong objects are refused where they are handed over, by the name of the argument."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from compensation import bifurcation, certificates, closed_loop, coexistence, design_criteria, equilibria
from compensation.basins import Rectangle, basins
from compensation.controller import Controller, Gains
from compensation.loop_section import LoopSection
from compensation.many_trajectories import simulate_many
from compensation.orbits.periodic_orbits import find_cycle
from compensation.torque_balance import TorqueBalance
from ident.model.published import symmetric_robot
from tests.bad_values import NO_NUMBERS, refused

ROBOT = symmetric_robot()
CONTROLLER = Controller(Gains(0.4, 0.02, observer=73.5, compensation=1.1), ROBOT)
LOOP = closed_loop.ClosedLoop(ROBOT, CONTROLLER)
STARTS = Rectangle((-1.0, 1.0), (-1.0, 1.0), (1, 1))
WRONG: tuple[Any, ...] = (None, "paper", 1.0, {}, np.zeros(3), Gains)
DOORS: list[tuple[Callable[..., object], dict[str, Any]]] = [
    (equilibria.equilibrium_set, {"robot": ROBOT, "controller": CONTROLLER}),
    (partial(certificates.certificates, law="mean"), {"robot": ROBOT, "controller": CONTROLLER}),
    (coexistence.largest_compensation_with_rest, {"robot": ROBOT, "controller": CONTROLLER}),
    (design_criteria.critical_observer_gains, {"robot": ROBOT}),
    (partial(design_criteria.critical_observer_gain, inertia=1.0), {"curve": ROBOT.friction.positive}),
    (design_criteria.sector_constant, {"friction": ROBOT.friction}),
    (design_criteria.loop_decay, {"controller": CONTROLLER}),
    (partial(closed_loop.simulate, start=(1.0, 0.0, 0.0), duration=0.1), {"loop": LOOP}),
    (partial(closed_loop.torque, states=(1.0, 0.0, 0.0)), {"loop": LOOP}),
    (partial(simulate_many, starts=[(1.0, 0.0, 0.0)], duration=0.1), {"loop": LOOP}),
    (partial(bifurcation.diagram, parameter="r", values=[1.1]), {"loop": LOOP}),
    (partial(basins, duration=0.1), {"loop": LOOP, "starts": STARTS}),
    (LoopSection, {"loop": LOOP}),
]


@pytest.mark.parametrize(("function", "arguments"), DOORS)
def test_each_argument_has_its_kind(function: Callable[..., object], arguments: dict[str, Any]) -> None:
    for name in arguments:
        for wrong in WRONG:
            refused(partial(function, **{**arguments, name: wrong}), name, type(wrong).__name__)


def test_a_point_of_the_section_is_two_finite_numbers() -> None:
    section = LoopSection(LOOP)
    points: tuple[Any, ...] = ([np.nan, 0.1], [0.1], [0.1, np.inf], "0.1", None)
    for wrong in points:
        refused(partial(section.follow, wrong, 1), "point")
        refused(partial(find_cycle, section, wrong), "point")
    for count in (0, -1, 1.5, True, None):
        refused(partial(section.follow, np.array([0.3, 0.0]), count), "returns")  # type: ignore[arg-type]


def test_an_excess_is_asked_of_a_speed() -> None:
    balance = TorqueBalance(1.0, -0.1, 0.1, 0.1, 1.0)
    for wrong in (*NO_NUMBERS, -1.0):
        refused(partial(balance.excess, wrong), "speed")  # type: ignore[arg-type]

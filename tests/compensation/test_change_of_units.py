"""Other units of time, angle and torque change no result: rigs may be tiny or slow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from compensation.basins import Basins, Rectangle, basins
from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.cycle_branches import CycleBranch, cycle_branches
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray


@dataclass(frozen=True)
class Units:
    """How large the old units are in new ones."""

    time: float
    angle: float
    torque: float

    @property
    def state(self) -> FloatArray:
        return self.angle * np.array([1.0, 1.0 / self.time, 1.0 / self.time])

    def curve(self, curve: StribeckCurve) -> StribeckCurve:
        return StribeckCurve(
            static_torque=curve.static_torque * self.torque,
            coulomb_torque=curve.coulomb_torque * self.torque,
            stribeck_velocity=curve.stribeck_velocity * self.angle / self.time,
            viscous_damping=curve.viscous_damping * self.torque * self.time / self.angle,
            stribeck_shape=curve.stribeck_shape,
        )

    def robot(self, robot: OneLinkRobot) -> OneLinkRobot:
        friction = StribeckFriction(self.curve(robot.friction.positive), self.curve(robot.friction.negative))
        return OneLinkRobot(robot.inertia * self.torque * self.time**2 / self.angle, friction)

    def loop(self, loop: ClosedLoop) -> ClosedLoop:
        gains = loop.controller.gains
        scaled = Gains(
            proportional=gains.proportional * self.torque / self.angle,
            derivative=gains.derivative * self.torque * self.time / self.angle,
            observer=gains.observer / self.time,
            compensation=gains.compensation,
        )
        return ClosedLoop(self.robot(loop.robot), Controller(scaled, self.robot(loop.controller.model)))


UNITS = [
    pytest.param(Units(time=0.004, angle=0.004 * 0.013, torque=1e-4), id="J 4e-7, v_s 1e-3, periods 0.03 s"),
    pytest.param(Units(time=16.0, angle=1.0, torque=30.0), id="periods of 100 s"),
    pytest.param(Units(time=1e3, angle=1e3, torque=1.0), id="milliseconds and milliradians"),
    pytest.param(Units(time=1e-3, angle=57.3, torque=1e3), id="kiloseconds and degrees"),
]


def loop(r: float, robot: OneLinkRobot, observer: float = 73.5) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot, Controller(gains, symmetric_robot()))


CASES = [
    pytest.param(loop(1.02, asymmetric_robot()), id="bistable"),
    pytest.param(loop(1.1, symmetric_robot()), id="cycle"),
    pytest.param(loop(0.9, symmetric_robot()), id="rest"),
    pytest.param(loop(1.02, symmetric_robot(), 40.0), id="rest beside a cycle"),
]


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("case", CASES)
def test_trajectories_are_the_same(case: ClosedLoop, units: Units) -> None:
    times = np.linspace(0.0, 6.0, 13)
    here = simulate(case, (0.6, 0.0, 0.1), duration=6.0, times=times)
    there = simulate(
        units.loop(case),
        np.array([0.6, 0.0, 0.1]) * units.state,
        duration=6.0 * units.time,
        times=times * units.time * (1.0 - 1e-15),
    )
    assert there.end_reason == here.end_reason
    size = np.max(np.abs(here.state), axis=0)
    np.testing.assert_allclose(there.state / units.state / size, here.state / size, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("case", CASES)
def test_basins_are_the_same(case: ClosedLoop, units: Units) -> None:
    def found(to: Units) -> Basins:
        x1, velocity = np.array([-0.3, 0.1]) * to.angle, np.array([-0.02, 0.02]) * to.angle / to.time
        return basins(to.loop(case), Rectangle((x1[0], x1[1]), (velocity[0], velocity[1]), (6, 2)))

    here, there = found(Units(1.0, 1.0, 1.0)), found(units)
    assert here.undecided_area == 0.0
    np.testing.assert_array_equal(there.labels, here.labels)
    for one, other in zip(here.attractors, there.attractors, strict=True):
        assert other.kind == one.kind
        assert other.x1_min / units.angle == pytest.approx(one.x1_min, rel=1e-7)
        assert other.x1_max / units.angle == pytest.approx(one.x1_max, rel=1e-7)
        assert (other.period is None) == (one.period is None)
        if one.period is not None and other.period is not None:
            assert other.period / units.time == pytest.approx(one.period, rel=1e-7)


@cache
def branches(case: ClosedLoop) -> tuple[CycleBranch, ...]:
    return cycle_branches(case, "r", (0.99, 1.1))


@pytest.mark.parametrize(
    ("case", "units"),
    [*((CASES[1].values[0], param.values[0]) for param in UNITS), (CASES[0].values[0], UNITS[1].values[0])],
)
def test_branches_are_the_same(case: ClosedLoop, units: Units) -> None:
    here, there = branches(case), cycle_branches(units.loop(case), "r", (0.99, 1.1))
    assert len(there) == len(here)
    for one, other in zip(here, there, strict=True):
        assert (other.symmetric, other.returns) == (one.symmetric, one.returns)
        assert [event.kind for event in other.events] == [event.kind for event in one.events]
        values = [event.value for event in one.events]
        assert [event.value for event in other.events] == pytest.approx(values, rel=1e-8)
    last, ending = here[-1].points[-1], there[-1].points[-1]
    if ending.value == last.value:
        assert ending.cycle.amplitude / units.angle == pytest.approx(last.cycle.amplitude, rel=1e-8)
        assert ending.cycle.period / units.time == pytest.approx(last.cycle.period, rel=1e-8)

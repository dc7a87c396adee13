"""Simulated truth under a position loop, from a rig that shares no line with the estimator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.excitation.excited_law import ExcitedLaw, excited_law
from ident.excitation.report import report
from ident.fit.excitation_parameters import excitation_parameters
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from tests.ident.excitation.loop_rig import followed, swings
from tests.ident.rigs import Rig

PLAIN = StribeckCurve(
    static_torque=0.4, coulomb_torque=0.4, stribeck_velocity=0.1, stribeck_shape=1.0, viscous_damping=0.08
)
RISEN = replace(PLAIN, static_torque=0.6, stribeck_velocity=0.3)


def rig_of(positive: StribeckCurve, negative: StribeckCurve) -> Rig:
    robot = OneLinkRobot(0.026, StribeckFriction(positive=positive, negative=negative))
    return Rig(robot=robot, period=2e-3, resolution=2 * np.pi / 2**16, torque_noise=0.004)


def near(found: ExcitedLaw, truth: dict[str, float], *, errors: float = 4.0, part: float = 0.01) -> None:
    for name, value in truth.items():
        assert abs(found.values[name] - value) <= max(errors * found.stderr(name), 1e-3 * abs(value)), name
        assert found.stderr(name) <= part * abs(value), name


def test_one_law_and_an_offset_without_stribeck_effect() -> None:
    rig = rig_of(PLAIN, PLAIN)
    recording = followed(rig, swings(rig, duration=12.0), np.random.default_rng(1), offset=0.05)
    found = excited_law([recording], law="one", axis="rotary")
    assert isinstance(found, ExcitedLaw)
    truth = {"inertia": 0.026, "viscous_damping": 0.08, "coulomb_torque": 0.4, "torque_offset": 0.05}
    near(found, truth, part=0.05)
    assert found.whole is None
    assert found.timing.timing == "held"
    assert found.held_out is not None
    assert found.held_out < 0.05
    values = excitation_parameters(found, axis="rotary")
    assert values.torque_offset.value == pytest.approx(0.05, rel=0.05)
    withheld = values.mean["static_torque"].withheld
    assert withheld is not None
    assert withheld.startswith("E-NOSTRIBECK")
    assert values.curves["positive"]["coulomb_torque"].value is None
    assert values.covariance.names == (
        "inertia",
        "mean.viscous_damping",
        "mean.coulomb_torque",
        "torque_offset",
    )
    assert "held out" in report(found)


def test_the_stribeck_effect_of_each_direction_is_refined_on_the_simulator() -> None:
    back = replace(RISEN, static_torque=0.5, coulomb_torque=0.3, viscous_damping=0.1)
    rig = rig_of(RISEN, back)
    recording = followed(rig, swings(rig, duration=12.0), np.random.default_rng(2))
    found = excited_law([recording], law="each", axis="rotary")
    assert isinstance(found, ExcitedLaw)
    assert found.whole is not None
    truth = {
        "inertia": 0.026,
        "positive_coulomb_torque": 0.4,
        "negative_coulomb_torque": 0.3,
        "positive_viscous_damping": 0.08,
        "negative_viscous_damping": 0.1,
        "positive_stribeck_torque": 0.2,
        "negative_stribeck_torque": 0.2,
        "positive_stribeck_velocity": 0.3,
        "negative_stribeck_velocity": 0.3,
    }
    near(found, truth, errors=5.0, part=0.1)
    values = excitation_parameters(found, axis="rotary")
    assert values.curves["positive"]["static_torque"].value == pytest.approx(0.6, rel=0.03)
    assert values.curves["negative"]["static_torque"].value == pytest.approx(0.5, rel=0.03)
    assert values.torque_offset.withheld is not None


def test_a_motion_one_way_only_says_so() -> None:
    rig = rig_of(PLAIN, PLAIN)
    time = rig.period * np.arange(5000)
    recording = followed(
        rig, 2.0 * time + 0.2 * np.sin(2 * np.pi * time), np.random.default_rng(3), bandwidth=60.0
    )
    recording = replace(
        recording,
        time=recording.time[200:] - recording.time[200],
        position=recording.position[200:].copy(),
        torque=recording.torque[200:].copy(),
    )
    found = excited_law([recording], law="one", axis="linear")
    assert isinstance(found, str)
    assert found.startswith("E-DIRECTION: the link moves with positive velocity only")


def test_a_rest_and_a_torque_of_zero_say_so() -> None:
    rig = rig_of(PLAIN, PLAIN)
    recording = followed(rig, swings(rig, duration=4.0), np.random.default_rng(4))
    still = replace(recording, position=np.zeros_like(recording.position))
    found = excited_law([still], law="one", axis="rotary")
    assert isinstance(found, str)
    assert "rest" in found
    idle = replace(recording, torque=np.zeros_like(recording.torque))
    found = excited_law([idle], law="one", axis="rotary")
    assert isinstance(found, str)
    assert "torque is zero" in found

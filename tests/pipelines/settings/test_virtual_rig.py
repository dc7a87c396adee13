"""[virtual_rig]: what it may hold."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from ident.model.published import asymmetric_robot
from pipelines.settings.virtual_rig import VirtualRig

CURVE = {"static_torque": 0.5, "coulomb_torque": 0.4, "stribeck_velocity": 0.1, "viscous_damping": 0.1}


def test_an_empty_table_is_table_1() -> None:
    assert VirtualRig().true_robot() == asymmetric_robot()


def test_a_robot_is_given_whole() -> None:
    rig = VirtualRig.model_validate({"robot": {"inertia": 1, "positive": CURVE, "negative": CURVE}})
    robot = rig.true_robot()
    assert robot.inertia == 1.0
    assert robot.friction.negative.stribeck_shape == 1.0
    assert robot.friction.positive.static_torque == 0.5


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"speed": [1.0]}, "Extra inputs"),
        ({"speeds": []}, "at least 1 item"),
        ({"speeds": ["1"]}, "valid number"),
        ({"speeds": [True]}, "valid number"),
        ({"speeds": [-1.0]}, "greater than 0"),
        ({"compensation_gains": [float("nan")]}, "finite"),
        ({"sample_period": 0.5}, "less than or equal to 0.05"),
        ({"seed": 1.5}, "valid integer"),
        ({"json_protocols": ["dance"]}, "set_point"),
        ({"robot": {"inertia": 1.0, "positive": CURVE}}, "negative"),
        (
            {"robot": {"inertia": 1.0, "positive": CURVE | {"static_torque": 0.3}, "negative": CURVE}},
            "below coulomb_torque",
        ),
        ({"multisine": {"lowest": 10.0, "highest": 5.0}}, "not above lowest"),
        ({"multisine": {"lowest": 0.2}}, "no whole cycle"),
        ({"sample_period": 0.02}, "sampling rate"),
    ],
)
def test_refuses_and_says_why(table: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        VirtualRig.model_validate(table)

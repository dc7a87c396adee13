from collections.abc import Mapping

import numpy as np
import pytest

from data.recording import FloatArray
from ident.fit.friction_fit import friction_torque, law_of
from ident.fit.slopes import slopes

SPEED = np.array([0.01, 0.1, 1.0])
FREE = ["positive_coulomb_torque", "positive_stribeck_torque", "positive_stribeck_velocity"]


def torque(values: Mapping[str, float]) -> FloatArray:
    return friction_torque(law_of(values, "positive"), SPEED)


@pytest.mark.parametrize("stribeck", [0.4, 1e-17, 0.0])
def test_slopes_are_those_in_closed_form_also_where_a_torque_ended_at_zero(stribeck: float) -> None:
    values = {
        "torque_offset": 0.0,
        "positive_coulomb_torque": 30.0,
        "positive_stribeck_torque": stribeck,
        "positive_stribeck_velocity": 0.1,
        "positive_viscous_damping": 0.2,
        "positive_stribeck_shape": 1.0,
    }
    fading = np.exp(-SPEED / 0.1)
    expected = np.column_stack([np.ones(3), fading, stribeck * fading * SPEED / 0.1**2])
    assert slopes(torque, values, FREE) == pytest.approx(expected, rel=1e-6, abs=1e-6)

"""Table 1 as printed, and what follows from it."""

import pytest

from ident.model import published

PRINTED_MEANS = {  # Table 1, third column
    "stribeck_shape": 1.0,
    "static_torque": 0.5429,
    "coulomb_torque": 0.3939,
    "stribeck_velocity": 0.0753,
    "viscous_damping": 0.0809,
}


@pytest.mark.parametrize(("name", "printed"), PRINTED_MEANS.items())
def test_the_computed_means_round_to_the_printed_column(name: str, printed: float) -> None:
    mean = getattr(published.symmetric_robot().friction.positive, name)
    assert abs(mean - printed) <= 0.5e-4 + 1e-12

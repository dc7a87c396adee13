"""EMPS, a real linear axis, against its published estimates (Janot, Gautier, Brunot 2019)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.recording import Recording
from ident.excitation.excited_law import ExcitedLaw, excited_law
from ident.fit.excitation_parameters import excitation_parameters

EMPS = Path(__file__).parents[4] / "shared/realdata/emps"
PUBLISHED = {  # value, standard deviation
    "inertia": (95.1089, 0.1085),
    "viscous_damping": (203.5034, 1.1460),
    "coulomb_torque": (20.3935, 0.1012),
    "torque_offset": (-3.1648, 0.0444),
}
EACH = {
    "inertia": (95.154, 0.1085),
    "positive_viscous_damping": (166.7061, 1.1460),
    "positive_coulomb_torque": (20.1440, 0.1012),
    "negative_viscous_damping": (240.4236, 1.1460),
    "negative_coulomb_torque": (20.6277, 0.1012),
}

needs_emps = pytest.mark.skipif(
    not EMPS.is_dir(),
    reason="../shared/realdata/emps is missing: the real log is not in the repository",
)


def recording() -> Recording:
    table = np.loadtxt(EMPS / "estimation.csv", delimiter=",", skiprows=2)
    time, measured, reference, force = (table[:, k].copy() for k in (0, 1, 2, 4))
    return Recording(
        log="estimation.csv",
        protocol="excitation",
        time=time,
        position=measured,
        torque=force,
        reference=reference,
        axis="linear",
    )


@needs_emps
@pytest.mark.parametrize(("law", "published"), [("one", PUBLISHED), ("each", EACH)])
def test_the_published_values_are_met(law: str, published: dict[str, tuple[float, float]]) -> None:
    found = excited_law([recording()], law="each" if law == "each" else "one", axis="linear")
    assert isinstance(found, ExcitedLaw)
    for name, (value, deviation) in published.items():
        assert abs(found.values[name] - value) <= deviation, name
        assert found.stderr(name) >= deviation, name  # theirs takes samples for independent
    assert found.held_out is not None
    assert found.held_out < 0.0408
    assert found.whole is None
    values = excitation_parameters(found, axis="linear")
    codes = {finding.code for finding in values.findings}
    assert "E-NOSTRIBECK" in codes

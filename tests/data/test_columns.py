"""Columns of numbers: what their names say, what they range over, whether they can be written together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.columns import bare, called, declared_unit, is_time, require_one_length, value_range
from data.findings import LogError


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("q [deg]", "q", "deg"),
        ("q(rad)", "q", "rad"),
        (" torque [N m] ", "torque", "N m"),
        ("speed_rpm", "speed_rpm", "rpm"),
        ("q", "q", None),
        ("q_mm", "q_mm", None),  # mm may be a motor's name
        ("u [dogs]", "u", "dogs"),  # no unit known here, and meant as one
        ("u (Nm/V)", "u", "Nm/V"),
        ("u (filtered)", "u", None),
        ("q[0]", "q", None),
        ("u [-]", "u", None),
        ("[q]", "", None),
        ("rpm", "rpm", None),
    ],
)
def test_a_header_says_its_name_and_its_unit(header: str, name: str, unit: str | None) -> None:
    assert (bare(header), declared_unit(header)) == (name, unit)


def test_a_name_to_the_letter_comes_before_one_without_its_unit() -> None:
    assert called(["q [deg]", "q"], "q") == [1]
    assert called(["q [deg]", "u"], "q") == [0]
    assert called(["q [deg]", "q [rad]"], " q ") == [0, 1]
    assert called(["u"], "q") == []


def test_a_capital_t_is_no_time() -> None:
    assert [name for name in ("t", "T", "Time [s]", "TIMESTAMP", "__time", "times") if is_time(name)] == [
        "t", "Time [s]", "TIMESTAMP", "__time"
    ]  # fmt: skip


def test_the_range_is_of_finite_numbers() -> None:
    assert value_range(np.array([np.nan, 2.0, -np.inf, -1.0])) == (-1.0, 2.0, 2)
    assert value_range(np.array([np.nan])) == (None, None, 1)
    assert value_range(np.array([])) == (None, None, 0)


@pytest.mark.parametrize("other", [np.zeros(3), np.zeros((2, 1))])
def test_columns_of_other_shapes_are_not_written(other: np.ndarray) -> None:
    require_one_length(Path("run.csv"), {"t": np.zeros(2), "q": np.zeros(2)})
    with pytest.raises(LogError, match="differ in shape"):
        require_one_length(Path("run.csv"), {"t": np.zeros(2), "q": other})

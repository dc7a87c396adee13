"""The Taylor series of a slip: its coefficients, its step, and its roots."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ident.slip_series import (
    distance_at,
    expand,
    part_at_distance,
    part_at_rest,
    speed_at,
    workspace,
)

J = 0.026
LINEAR = np.array([0.4, 0.4, 0.07, 0.08, 1.0])  # no Stribeck effect
TABLE_1 = np.array([0.5735, 0.3990, 0.0688, 0.0828, 1.0])


def test_a_linear_law_has_the_coefficients_of_an_exponential() -> None:
    series, h = workspace(), 0.01
    order, step = expand(0.5, (0.3, 0.0), h, (J, LINEAR), series)
    assert step == h
    final, rate = 0.3 / 0.08, 0.08 / J
    expected = [(0.5 - final) * (-rate * h) ** k / math.factorial(k) for k in range(order + 1)]
    expected[0] = 0.5
    np.testing.assert_allclose(series[0, : order + 1], expected, rtol=1e-12, atol=1e-17)


@pytest.mark.parametrize("shape", [0.6, 1.0, 2.0])
def test_the_series_fulfils_the_equation_of_motion_all_along_its_step(shape: float) -> None:
    series = workspace()
    curve = np.array([0.5735, 0.3990, 0.0688, 0.0828, shape])
    drive = (-0.1, 2.0)
    order, step = expand(0.05, drive, 0.05, (J, curve), series)
    for part in np.linspace(0.05, 1.0, 7):
        s = speed_at(series, order, part)
        slope = sum(k * series[0, k] * part ** (k - 1) for k in range(1, order + 1)) / step
        fading = math.exp(-((s / 0.0688) ** shape))
        net = drive[0] + drive[1] * part * step - 0.0828 * s + (0.5735 - 0.3990) * (1.0 - fading)
        assert J * slope == pytest.approx(net, rel=1e-10, abs=1e-13)


def test_the_step_is_shortened_to_where_the_series_holds() -> None:
    series = workspace()
    order, step = expand(0.01, (-0.05, 0.0), 0.5, (J, TABLE_1), series)
    assert 1e-4 < step < 0.5
    assert abs(series[0, order]) < 1e-17


def test_roots_are_where_speed_and_distance_say() -> None:
    series, h = workspace(), 2e-3
    order, step = expand(0.01, (-0.4, 0.0), h, (J, TABLE_1), series)
    part = part_at_rest(series, order)
    assert 0.0 < part < 1.0
    assert abs(speed_at(series, order, part)) < 1e-17
    half = distance_at(series, order, 0.25 * part, step)
    assert part_at_distance(series, order, step, half) == pytest.approx(0.25 * part, rel=1e-12)

"""The first and last moments of a slip, against adaptive quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from ident.near_rest import acceleration, from_rest, slip_near_rest, speed_after, speed_limit

J = 0.026


@pytest.mark.parametrize("shape", [0.5, 0.7, 1.3, 2.0, 3.0])
@pytest.mark.parametrize("excess", [-0.4, -0.01, 0.003, 0.5])
def test_time_and_distance_are_the_quadratures(shape: float, excess: float) -> None:
    curve = np.array([0.57, 0.40, 0.07, 0.08, shape])
    speed = speed_limit(excess, curve)

    def slowness(root: float) -> float:  # in the root of the speed, where the integrand is smooth
        w = root**8
        return 8 * root**7 / abs(acceleration(w, excess, J, curve))

    end = speed**0.125
    time = quad(slowness, 0.0, end, epsabs=0.0, epsrel=1e-13)[0]
    distance = quad(lambda root: root**8 * slowness(root), 0.0, end, epsabs=0.0, epsrel=1e-13)[0]
    assert from_rest(speed, excess, J, curve) == pytest.approx((time, distance), rel=1e-12)
    assert speed_after(0.3 * time, 0.3 * speed, excess, J, curve) < speed


@pytest.mark.parametrize("excess", [-0.2, 0.2])
def test_parts_of_a_slip_add_up(excess: float) -> None:
    curve = np.array([0.57, 0.40, 0.07, 0.08, 0.6])
    start = 0.5 * speed_limit(excess, curve)
    h = 0.2 * from_rest(start, excess, J, curve)[0]
    whole = slip_near_rest(start, excess, 2 * h, J, curve)
    first = slip_near_rest(start, excess, h, J, curve)
    second = slip_near_rest(first[0], excess, h, J, curve)
    assert whole == pytest.approx((second[0], first[1] + second[1], 2 * h), rel=1e-12)


def test_ends_at_rest_or_at_the_limit() -> None:
    curve = np.array([0.57, 0.40, 0.07, 0.08, 0.6])
    for excess in (-0.2, 0.2):
        limit = speed_limit(excess, curve)
        time, distance = from_rest(limit, excess, J, curve)
        speed, moved, used = slip_near_rest(limit if excess < 0 else 0.0, excess, 10.0, J, curve)
        assert speed == (0.0 if excess < 0 else limit)
        assert (moved, used) == pytest.approx((distance, time), rel=1e-12)

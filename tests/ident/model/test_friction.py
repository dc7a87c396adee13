"""The law against the paper's equations and its own limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ident.model import published
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction, steepest_fall_factor
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, each_refused
from tests.strategies import stribeck_curves

CURVE = published.POSITIVE


def test_the_law_starts_at_static_and_ends_at_coulomb_friction() -> None:
    assert CURVE.dry(0.0) == CURVE.static_torque
    assert CURVE.dry(1e3 * CURVE.stribeck_velocity) == pytest.approx(CURVE.coulomb_torque, abs=1e-15)
    assert CURVE.total(2.0) == pytest.approx(CURVE.coulomb_torque + 2.0 * CURVE.viscous_damping, abs=1e-12)


def test_at_the_stribeck_velocity_the_static_excess_has_fallen_to_one_over_e() -> None:
    for shape in (0.5, 1.0, 2.0):
        curve = StribeckCurve(1.0, 0.6, 0.1, 0.0, shape)
        assert curve.dry(0.1) == pytest.approx(0.6 + 0.4 / math.e, rel=1e-14)


@given(stribeck_curves())
def test_dry_friction_never_rises_with_speed(curve: StribeckCurve) -> None:
    speed = np.linspace(0.0, 10 * curve.stribeck_velocity, 400)
    assert np.all(np.diff(curve.dry(speed)) <= 1e-15)


@given(stribeck_curves(shapes=st.floats(1.0, 3.0)))
def test_steepest_fall_bounds_every_secant_and_is_reached(curve: StribeckCurve) -> None:
    speed = np.linspace(0.0, 5 * curve.stribeck_velocity, 5001)
    fall = -np.diff(curve.dry(speed)) / np.diff(speed)
    rounding = 1e-15 * curve.static_torque / speed[1]
    assert fall.max() <= curve.steepest_fall * (1 + 1e-9) + rounding
    assert fall.max() >= 0.995 * curve.steepest_fall - rounding


def test_the_factor_is_the_papers_eta() -> None:
    # eq (13) as printed: (beta - 1) exp(-(beta - 1)/beta) / ((beta - 1)/beta)^(1/beta)
    for shape in (1.2, 1.5, 2.0, 3.0):
        y = (shape - 1) / shape
        assert steepest_fall_factor(shape) == pytest.approx(
            (shape - 1) * math.exp(-y) / y ** (1 / shape), rel=1e-13
        )
    assert steepest_fall_factor(1.0) == 1.0
    assert steepest_fall_factor(1.0 + 1e-12) == pytest.approx(1.0, abs=1e-9)
    assert math.isinf(steepest_fall_factor(0.99))


def test_at_rest_the_law_is_an_interval_between_the_two_static_torques() -> None:
    law = StribeckFriction(positive=published.POSITIVE, negative=published.NEGATIVE)
    low, high = law.torque_interval([-0.5, 0.0, 0.5])
    assert (low[1], high[1]) == (-published.NEGATIVE.static_torque, published.POSITIVE.static_torque)
    assert low[0] == high[0] == -published.NEGATIVE.dry(0.5)
    assert low[2] == high[2] == published.POSITIVE.dry(0.5)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ((0.3, 0.4, 0.1, 0.0, 1.0), "static_torque"),
        ((0.5, -0.1, 0.1, 0.0, 1.0), "coulomb_torque"),
        ((0.5, 0.4, 0.0, 0.0, 1.0), "stribeck_velocity"),
        ((0.5, 0.4, 0.1, -0.1, 1.0), "viscous_damping"),
        ((0.5, 0.4, 0.1, 0.0, 0.0), "stribeck_shape"),
        ((math.nan, 0.4, 0.1, 0.0, 1.0), "static_torque"),
        ((0.5, math.inf, 0.1, 0.0, 1.0), "coulomb_torque"),
    ],
)
def test_what_no_friction_can_be_is_refused_by_name(values: tuple[float, ...], named: str) -> None:
    with pytest.raises(ModelError, match=named):
        StribeckCurve(*values)


def test_the_steepest_shape_is_bounded_and_overflows_nowhere() -> None:
    with pytest.raises(ModelError, match="beta <= 100"):
        StribeckCurve(0.6, 0.4, 0.07, 0.1, stribeck_shape=1e9)
    steep = StribeckCurve(0.6, 0.4, 0.07, 0.1, stribeck_shape=100.0)
    np.testing.assert_allclose(steep.dry([0.0, 0.01, 1e3, 1e300]), [0.6, 0.6, 0.4, 0.4])


def test_what_is_no_number_is_refused_by_name() -> None:
    values = {"static_torque": 0.5, "coulomb_torque": 0.4, "stribeck_velocity": 0.1, "viscous_damping": 0.1}
    for name in values:
        each_refused(StribeckCurve, values, {name: NO_NUMBERS})
    each_refused(StribeckCurve, values, {"stribeck_shape": (*NO_NUMBERS, -1.0)})
    each_refused(CURVE.dry, {}, {"speed": (*NO_ARRAYS, -1.0, [0.1, math.nan])})
    each_refused(CURVE.total, {}, {"speed": (-1.0,)})
    each_refused(steepest_fall_factor, {}, {"shape": (*NO_NUMBERS, 0.0, -1.0)})
    law = StribeckFriction.symmetric(CURVE)
    each_refused(law.torque_interval, {}, {"velocity": (*NO_ARRAYS, math.nan)})
    each_refused(StribeckFriction, {"positive": CURVE, "negative": CURVE}, {"negative": (0.4, None)})

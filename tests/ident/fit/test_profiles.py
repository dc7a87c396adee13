"""Profiles are least chi-squares with a parameter held, and their ends are where they have risen by t^2."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.optimize import least_squares

from ident.fit.confidence import quantile, symmetric
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, fit_friction, residuals
from ident.fit.law_model import EACH, LawModel
from ident.fit.profiles import law_combinations, profiles
from tests.ident.fit.campaigns import ONE_LAW, TRUTH, simulated

DOF = 28


def _held(data: FitData, fit: FrictionFit, combination: Mapping[str, float], value: float) -> float:
    """Least chi-square with the combination held, by scipy: its first parameter follows from the others."""
    first, *others = combination
    free = [name for name in fit.free if name != first]

    def own(x: np.ndarray) -> np.ndarray:
        values = {**fit.values, **dict(zip(free, map(float, x), strict=True))}
        taken = sum(combination[name] * values[name] for name in others)
        return residuals(data, {**values, first: (value - taken) / combination[first]})

    begun = np.array([fit.values[name] for name in free])
    found = least_squares(own, begun, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return float(2 * found.cost)


MEAN_VELOCITY = {"positive_stribeck_velocity": 0.5, "negative_stribeck_velocity": 0.5}


@pytest.mark.parametrize(
    ("model", "truth", "name", "combination"),
    [
        (EACH, TRUTH, "static", law_combinations("positive")["static_torque"]),
        (EACH, TRUTH, "damping", law_combinations("negative")["viscous_damping"]),
        (EACH, TRUTH, "mean", MEAN_VELOCITY),
        (LawModel(free_shape=("positive",)), TRUTH, "shape", {"positive_stribeck_shape": 1.0}),
        (LawModel(("mean",)), ONE_LAW, "offset", {"torque_offset": 1.0}),
        (EACH, TRUTH, "inertia", {"inertia": 1.0}),
    ],
)
def test_every_point_is_the_least_chi_square_with_its_value_held(
    model: LawModel, truth: dict[str, float], name: str, combination: Mapping[str, float]
) -> None:
    data = simulated(truth, np.random.default_rng(11), model=model, ramps=int(name == "inertia"))
    fit = fit_friction(data)
    _, found = profiles(data, fit, {name: combination}, height=lambda _: quantile(DOF) ** 2)
    profile = found[name].points
    assert profile.value.size >= 5
    assert np.all(np.diff(profile.value) > 0)
    for value, rise in zip(profile.value[[0, -1]], profile.rise[[0, -1]], strict=True):
        assert rise == pytest.approx(_held(data, fit, combination, value) - fit.chi_square, rel=1e-4)
    for end in (found[name].interval.low, found[name].interval.high):
        assert end is not None
        risen = _held(data, fit, combination, end) - fit.chi_square
        assert risen == pytest.approx(quantile(DOF) ** 2, rel=2e-3)


def test_a_lines_profile_is_its_t_interval() -> None:
    data = simulated(TRUTH, np.random.default_rng(12), model=LawModel(lines=("positive", "negative")))
    fit = fit_friction(data)
    _, found = profiles(
        data, fit, {"b": {"positive_viscous_damping": 1.0}}, height=lambda _: quantile(DOF) ** 2
    )
    place = fit.free.index("positive_viscous_damping")
    error = float(np.sqrt(fit.covariance[place, place]))
    expected = symmetric(fit.values["positive_viscous_damping"], error, DOF)
    assert found["b"].interval.low == pytest.approx(expected.low, rel=1e-3)
    assert found["b"].interval.high == pytest.approx(expected.high, rel=1e-3)


def test_without_slow_speeds_the_low_end_of_v_s_and_the_high_end_of_f_s_are_open() -> None:
    data = simulated(TRUTH, np.random.default_rng(15), speeds=np.linspace(0.3, 2.5, 12), starts=0)
    fit = fit_friction(data)
    own = law_combinations("positive")
    if fit.values["positive_stribeck_torque"] == 0:
        pytest.skip("no Stribeck effect in this draw")
    _, found = profiles(
        data,
        fit,
        {name: own[name] for name in ("stribeck_velocity", "static_torque")},
        height=lambda _: quantile(8) ** 2,
    )
    assert found["stribeck_velocity"].interval.low is None
    assert found["static_torque"].interval.high is None


def test_a_damping_of_which_the_data_know_little_is_cut_at_0() -> None:
    truth = {**TRUTH, "positive_viscous_damping": 1e-3}
    data = simulated(truth, np.random.default_rng(14), error=0.02)
    fit = fit_friction(data)
    _, found = profiles(
        data, fit, {"b": {"positive_viscous_damping": 1.0}}, height=lambda _: quantile(DOF) ** 2
    )
    assert found["b"].interval.low == 0.0
    assert found["b"].interval.high is not None

"""The compiled joint fit ends where lmfit's and scipy's do, whatever the layout of its laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from data.recording import FloatArray
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import SAME, FrictionFit, fit_friction, fit_from, polished, residuals
from ident.fit.law_model import DIRECTIONS, EACH, LawModel
from tests.ident.fit.campaigns import ONE_LAW, TRUTH, simulated

BENT = {**TRUTH, "positive_stribeck_shape": 1.4, "negative_stribeck_shape": 0.8}
CASES = {
    "each": (EACH, TRUTH),
    "beta free": (LawModel(free_shape=DIRECTIONS), BENT),
    "one law": (LawModel(("mean",)), ONE_LAW),
    "one way": (LawModel(("positive",)), {k: v for k, v in TRUTH.items() if "negative" not in k}),
    "a line": (LawModel(lines=("negative",)), TRUTH),
}


def _errors(fit: FrictionFit) -> FloatArray:
    return np.asarray(np.sqrt(np.diag(fit.covariance)))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("ramps", [0, 2])
def test_lmfit_agrees_to_a_millionth_of_a_standard_error(case: str, ramps: int) -> None:
    model, truth = CASES[case]
    data = simulated(truth, np.random.default_rng(6), model=model, ramps=ramps)
    ours = fit_friction(data)
    # lmfit starts elsewhere, so that it has to find the minimum by itself.
    moved = {
        name: ours.values[name] + 0.3 * error for name, error in zip(ours.free, _errors(ours), strict=True)
    }
    theirs, report = polished(data, replace(ours, values={**ours.values, **moved}))
    for name, error in zip(ours.free, _errors(ours), strict=True):
        assert abs(ours.values[name] - theirs.values[name]) < 1e-6 * error, name
    assert ours.chi_square == pytest.approx(theirs.chi_square, rel=1e-10)
    assert "chi-square" in report


def test_the_covariance_is_that_of_lmfits_report() -> None:
    data = simulated(TRUTH, np.random.default_rng(7), ramps=2)
    ours = fit_friction(data)
    x = np.array([ours.values[name] for name in ours.free])
    jacobian = np.column_stack(
        [
            (_residuals(data, ours, x + step) - _residuals(data, ours, x - step)) / (2e-6 * abs(value))
            for value, step in zip(x, np.diag(1e-6 * np.abs(x)), strict=True)
        ]
    )
    expected = np.linalg.inv(jacobian.T @ jacobian)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert ours.covariance / scale == pytest.approx(expected / scale, abs=1e-6)


@pytest.mark.parametrize(("name", "value"), [("viscous_damping", -0.02), ("stribeck_torque", -0.05)])
def test_a_parameter_that_would_be_negative_ends_at_0_as_in_scipy(name: str, value: float) -> None:
    truth = {**TRUTH, f"positive_{name}": value}
    data = simulated(truth, np.random.default_rng(8))
    ours = fit_friction(data)
    assert ours.values[f"positive_{name}"] == 0.0
    x = np.array([ours.values[key] for key in ours.free])
    low = np.where([key.endswith("velocity") for key in ours.free], 1e-6, 0.0)

    def own(at: FloatArray) -> FloatArray:
        return _residuals(data, ours, at)

    found = least_squares(own, np.maximum(x, low + 1e-3), bounds=(low, np.inf), xtol=1e-14)
    assert ours.chi_square <= 2 * found.cost + 1e-6
    again, report = polished(data, ours)
    assert again.values[f"positive_{name}"] == 0.0
    assert "(fixed)" in next(line for line in report.splitlines() if f"positive_{name}:" in line)


def _residuals(data: FitData, fit: FrictionFit, x: FloatArray) -> FloatArray:
    return residuals(data, {**fit.values, **dict(zip(fit.free, map(float, x), strict=True))})


def test_one_law_and_its_offset_are_found() -> None:
    data = simulated(ONE_LAW, np.random.default_rng(9), model=LawModel(("mean",)), ramps=3)
    fit = fit_friction(data)
    for name, error in zip(fit.free, _errors(fit), strict=True):
        assert abs(fit.values[name] - ONE_LAW[name]) < 4 * error, name
    ahead, back = fit.law("positive"), fit.law("negative")
    assert ahead[0] - back[0] == pytest.approx(2 * fit.values["torque_offset"])
    assert ahead[1:] == back[1:]


def test_one_direction_is_fitted_as_if_the_other_were_not_there() -> None:
    both = simulated(TRUTH, np.random.default_rng(10))
    own, begun = both.run_direction == 1, both.start_direction == 1
    alone = replace(
        both,
        model=LawModel(("positive",)),
        **{key: getattr(both, key)[own] for key in ("run_direction", "speed", "torque", "acceleration")},
        run_stderr=both.run_stderr[own],
        **{key: getattr(both, key)[begun] for key in ("start_direction", "start_torque", "start_stderr")},
    )
    joint, single = fit_friction(both), fit_friction(alone)
    for name, error in zip(single.free, _errors(single), strict=True):
        assert abs(joint.values[name] - single.values[name]) < 1e-5 * error


def test_of_two_minima_the_better_one_wins_and_the_other_is_told() -> None:
    # Three speeds at the slow end and three at the fast: a bend can lie in either gap.
    speeds = np.array([0.005, 0.006, 0.4, 0.5, 0.6, 2.0, 2.2])
    found = []
    for seed in range(30):
        generator = np.random.default_rng(seed)
        truth = {**TRUTH, "positive_stribeck_torque": 0.01, "negative_stribeck_torque": 0.01}
        data = simulated(truth, generator, speeds=speeds, starts=1, error=8e-3)
        fit = fit_friction(data)
        if fit.other_minimum is None:
            continue
        other = fit_friction(data, start=replace(fit, values=fit.other_minimum))
        assert other.chi_square >= fit.chi_square - 1e-9
        assert other.chi_square <= fit.chi_square + SAME + 1e-6
        # Had the fit been at the other one first, it would be the other one now.
        if other.values == pytest.approx(fit.other_minimum, rel=1e-3, abs=1e-9):
            assert fit_from(data, fit, other).other_minimum == other.values
        found.append(seed)
    assert found

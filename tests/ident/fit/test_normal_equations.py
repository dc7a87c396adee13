"""The compiled chi-square is that of the residuals, and its derivatives are theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from data.recording import FloatArray
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import residuals, vector
from ident.fit.law_model import EACH, LawModel
from ident.fit.normal_equations import chi_square
from tests.ident.fit.campaigns import ONE_LAW, TRUTH, simulated

ONE_WAY = {
    name: value for name, value in TRUTH.items() if name.split("_")[0] in {"inertia", "torque", "negative"}
}
CASES = {
    "each": (EACH, TRUTH),
    "one": (LawModel(("mean",)), ONE_LAW),
    "one way": (LawModel(("negative",)), ONE_WAY),
}


def _jacobian(data: FitData, x: FloatArray) -> FloatArray:
    """By central differences, with respect to the compiled parameters."""

    def at(point: FloatArray) -> FloatArray:
        values = dict(zip(data.model.names, map(float, point), strict=True))
        values |= {name: float(np.exp(value)) for name, value in values.items() if "velocity" in name}
        return residuals(data, values)

    columns = []
    for place in range(x.size):
        step = np.zeros(x.size)
        step[place] = 1e-6
        columns.append((at(x + step) - at(x - step)) / 2e-6)
    return np.column_stack(columns)


@pytest.mark.parametrize("shape", [1.0, 0.7, 2.0])
@pytest.mark.parametrize("case", CASES)
def test_equations_are_those_of_the_residuals(case: str, shape: float) -> None:
    model, truth = CASES[case]
    generator = np.random.default_rng(4)
    data = simulated(truth, generator, model=model, ramps=2, inertia=True)
    acceleration = 0.1 * generator.standard_normal(data.speed.size)
    data = replace(data, acceleration=acceleration)
    values = {
        name: shape if name.endswith("shape") else value * float(generator.uniform(0.8, 1.2))
        for name, value in truth.items()
    }
    x = vector(data, values)
    cost = chi_square(data.problem, x, data.work.h, data.work.g, 1)
    residual, jacobian = residuals(data, values), _jacobian(data, x)
    assert cost == pytest.approx(float(residual @ residual), rel=1e-12)
    lower = np.tril(jacobian.T @ jacobian)
    assert data.work.g[1] == pytest.approx(-jacobian.T @ residual, rel=1e-6, abs=1e-9 * lower.max())
    assert np.tril(data.work.h[1]) == pytest.approx(lower, rel=1e-6, abs=1e-9 * lower.max())


def test_a_tie_is_one_datum_more() -> None:
    data = simulated(TRUTH, np.random.default_rng(5), ramps=1)
    x = vector(data, TRUTH)
    problem = data.problem
    plain = chi_square(problem, x, data.work.h, data.work.g, 0)
    problem.combination[data.model.names.index("positive_stribeck_velocity")] = 0.5
    problem.combination[data.model.names.index("negative_stribeck_velocity")] = 0.5
    problem.tie[:] = 0.08, 100.0
    tied = chi_square(problem, x, data.work.h, data.work.g, 1)
    assert tied - plain == pytest.approx((100.0 * (0.08 - 0.075)) ** 2)
    more = np.tril(data.work.h[1] - data.work.h[0])
    slope = np.zeros(x.size)
    slope[data.model.names.index("positive_stribeck_velocity")] = 100.0 * 0.5 * 0.07
    slope[data.model.names.index("negative_stribeck_velocity")] = 100.0 * 0.5 * 0.08
    assert more == pytest.approx(np.tril(np.outer(slope, slope)), abs=1e-6)
    assert data.work.g[1] - data.work.g[0] == pytest.approx(slope * 100.0 * (0.08 - 0.075), abs=1e-6)

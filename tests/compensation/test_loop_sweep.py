"""Cycles swept over a gain, against those found value by value."""

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.loop_cycles import stable_cycles
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_sweep import MOST_KNOWN, extrapolate
from compensation.orbits.periodic_orbits import Cycle, find_cycle
from ident.model.published import symmetric_robot
from ident.simulation.filippov_system import FloatArray


def loop(observer: float) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=1.0)
    return ClosedLoop(symmetric_robot(), Controller(gains, symmetric_robot()))


@pytest.mark.parametrize(
    ("observer", "values"),
    [
        (73.5, np.linspace(1.0, 1.2, 41)[1:]),
        (73.5, 1.0 + np.geomspace(2e-5, 0.1, 25)),  # crowded near 1
        (73.5, 1.0 + np.geomspace(1e-7, 1e-4, 12)),  # below 1.1e-5 two returns, not symmetric
        (120.0, np.linspace(1.0005, 1.002, 31)),  # half-map multipliers of 0.1
        (73.5, np.array([1.1])),
    ],
)
def test_swept_cycles_are_those_found_one_by_one(observer: float, values: FloatArray) -> None:
    swept = stable_cycles(loop(observer), "r", values)
    for value, cycles in zip(values.tolist(), swept, strict=True):
        alone = find_cycle(LoopSection(with_gain(loop(observer), "r", value)), np.array([0.6, 0.0]))
        assert isinstance(alone, Cycle)
        assert len(cycles) == (1 if alone.returns % 2 else 2)  # with its mirror image
        cycle = cycles[0]
        assert cycle.amplitude == pytest.approx(alone.amplitude, rel=1e-10)
        assert cycle.period == pytest.approx(alone.period, rel=1e-10)
        np.testing.assert_allclose(cycle.multipliers, alone.multipliers, rtol=1e-6, atol=1e-10)


def test_a_guess_goes_on_a_polynomial_over_uneven_values() -> None:
    random = np.random.default_rng(5)
    values = np.cumsum(random.uniform(0.1, 1.0, 9))
    curves = [np.polynomial.Polynomial(random.normal(size=4)) for _ in range(2)]
    rows = np.array([curve(values) for curve in curves]).T.copy()
    guess = np.empty(2)
    extrapolate(values, rows, 8, MOST_KNOWN, np.empty(MOST_KNOWN), guess)
    np.testing.assert_allclose(guess, rows[8], rtol=1e-9)
    extrapolate(values, rows, 1, 1, np.empty(MOST_KNOWN), guess)
    np.testing.assert_allclose(guess, rows[0])

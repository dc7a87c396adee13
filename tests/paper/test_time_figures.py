"""Figures 6 and 7: below and above the critical observer gain."""

from __future__ import annotations

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from ident.model.published import symmetric_robot
from pipelines.paper import figure6_solutions


def test_figure_6_reaches_the_amplitude_of_the_printed_cycle() -> None:
    exact, perturbed = figure6_solutions()
    late = perturbed.time > 0.5 * perturbed.time[-1]
    assert np.abs(perturbed.state[late, 0]).max() == pytest.approx(0.2456, abs=1e-4)
    assert np.abs(exact.state[late, 0]).max() < 1e-12
    assert np.all(exact.state[:, 2] == 0.0)


def test_the_exact_solution_of_figure_6_is_a_damped_oscillator() -> None:
    exact, _ = figure6_solutions()
    s, w = -1.940384615, 3.408742133
    t = exact.time
    expected = np.exp(s * t) * (np.cos(w * t) - s / w * np.sin(w * t))
    assert exact.state[:, 0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("start", [(1.0, 0.0, 0.0), (-0.7, 0.3, -0.4), (0.2, -1.0, 1.0)])
def test_figure_7_goes_to_the_set_point_from_anywhere(start: tuple[float, float, float]) -> None:
    robot = symmetric_robot()
    loop = ClosedLoop(robot, Controller(Gains(0.4, 0.02, observer=73.5, compensation=1.0), robot))
    found = simulate(loop, start, duration=30.0, times=[0.0, 30.0])
    assert found.state[-1] == pytest.approx(0.0, abs=1e-4)


def test_above_the_critical_gain_the_error_contracts_at_least_as_eq_17_says() -> None:
    robot = symmetric_robot()
    loop = ClosedLoop(robot, Controller(Gains(0.4, 0.02, observer=80.0, compensation=1.0), robot))
    times = np.linspace(0.0, 1.0, 2001)
    found = simulate(loop, (1.0, 0.0, 0.5), duration=1.0, times=times)
    bound = 0.5 * np.exp(-(80.0 - 73.0704) * times)
    assert np.all(np.abs(found.state[:, 2]) <= bound * (1 + 1e-9) + 1e-12)

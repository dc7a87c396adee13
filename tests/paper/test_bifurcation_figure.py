"""Figure 9: equilibrium sets for r < 1, limit cycles for r > 1, at L = 73.5."""

from __future__ import annotations

import numpy as np
import pytest

from compensation.bifurcation import Diagram, diagram
from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from ident.model.published import symmetric_robot


@pytest.fixture(scope="module")
def figure9() -> Diagram:
    robot = symmetric_robot()
    loop = ClosedLoop(robot, Controller(Gains(0.4, 0.02, observer=73.5, compensation=1.0), robot))
    return diagram(loop, "r", np.linspace(0.8, 1.2, 41))


def cycles(found: Diagram) -> dict[float, tuple[float, float]]:
    return {
        round(point.value, 9): (point.amplitude or np.nan, point.period or np.nan)
        for branch in found.branches
        if branch.kind == "limit_cycle" and branch.stable
        for point in branch.points
    }


def test_amplitudes_and_periods_of_the_limit_cycle(figure9: Diagram) -> None:
    found = cycles(figure9)
    assert found[1.01] == pytest.approx((0.09852434192, 7.551833164), abs=1e-8)
    assert found[1.1] == pytest.approx((0.35368017536, 6.383337703), abs=1e-8)


def test_what_exists_on_which_side(figure9: Diagram) -> None:
    assert all(r > 1.0 for r in cycles(figure9))
    assert len([r for r in cycles(figure9) if r > 1.005]) == 20
    sets = [b for b in figure9.branches if b.kind == "equilibrium_set"]
    assert sets
    assert all(point.value < 1.0 + 1e-9 for branch in sets for point in branch.points)
    unstable = [b for b in figure9.branches if b.kind == "equilibrium" and not b.stable]
    assert any(point.value > 1.0 for branch in unstable for point in branch.points)


def test_amplitude_grows_from_zero(figure9: Diagram) -> None:
    found = cycles(figure9)
    amplitudes = [found[r][0] for r in sorted(found)]
    assert np.all(np.diff(amplitudes) > 0)
    assert any(abs(one.value - 1.0) < 1e-6 for one in figure9.bifurcations)

"""Branches of cycles in a diagram: whole where the cycle goes on, parted and named where it does not."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from compensation.bifurcation import Branch, Point, diagram
from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains
from compensation.loop_section import LoopSection, with_gain
from compensation.loop_tables import Parameter
from compensation.orbits.periodic_orbits import Cycle, find_cycle
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray


def features(cycle: Cycle | Point) -> FloatArray:
    assert cycle.period is not None
    return np.array([cycle.x1_min, cycle.x1_max, cycle.period])


def attractors(loop: ClosedLoop, parameter: Parameter, value: float, near: FloatArray) -> list[FloatArray]:
    """Stable cycles from several starts; with their mirror images where the loop is symmetric."""
    section = LoopSection(with_gain(loop, parameter, value))
    found = []
    for x1 in (near[1], near[0], 0.6):
        cycle = find_cycle(section, np.array([x1, 0.0]))
        if isinstance(cycle, Cycle) and cycle.stable:
            low, high, period = features(cycle)
            found.extend([np.array([low, high, period]), np.array([-high, -low, period])])
    return found if section.symmetric else found[::2]


def jumps(loop: ClosedLoop, parameter: Parameter, before: Point, after: Point) -> bool:
    """Whether halving the step, on into the half with the larger change, leaves the change as it was."""
    low, high = (before.value, features(before)), (after.value, features(after))
    size = np.maximum(np.abs(low[1]), np.abs(high[1]))
    whole = float(np.max(np.abs(high[1] - low[1]) / size))
    for _ in range(9):
        if float(np.max(np.abs(high[1] - low[1]) / size)) < max(0.1 * whole, 2e-3):
            return False
        middle = 0.5 * (low[0] + high[0])
        wanted = 0.5 * (low[1] + high[1])
        found = min(
            attractors(loop, parameter, middle, wanted),
            key=lambda cycle: float(np.max(np.abs(cycle - wanted) / size)),
        )
        left, right = (float(np.max(np.abs(found - end[1]) / size)) for end in (low, high))
        low, high = (low, (middle, found)) if left >= right else ((middle, found), high)
    return True


def cycles(branches: tuple[Branch, ...]) -> list[Branch]:
    return [branch for branch in branches if branch.kind == "limit_cycle"]


def random_loop(seed: int) -> ClosedLoop:
    """A loop near its critical gain; every other one is asymmetric."""
    generator = np.random.default_rng(seed)
    coulomb = generator.uniform(0.2, 0.6)
    shape = float(generator.choice([1.0, 1.0, 2.0]))
    static, width = coulomb + generator.uniform(0.05, 0.4), generator.uniform(0.05, 0.2)
    curves = [StribeckCurve(static, coulomb, width, 0.06, shape)] * 2
    if seed % 2:
        more, wider = generator.uniform(0.85, 1.2, 2).tolist()
        curves[1] = StribeckCurve(max(more * static, coulomb), coulomb, wider * width, 0.06, shape)
    robot = OneLinkRobot(float(generator.uniform(0.015, 0.05)), StribeckFriction(curves[0], curves[1]))
    observer = max(critical_observer_gains(robot).mean, 20.0) * generator.uniform(0.6, 1.4)
    gains = Gains(float(generator.uniform(0.2, 0.8)), 0.03, float(observer), 1.05)
    return ClosedLoop(robot, Controller(gains, robot.mean()))


@pytest.mark.parametrize("seed", range(4))
def test_no_branch_of_a_random_loop_goes_across_a_jump(seed: int) -> None:
    loop = random_loop(seed)
    grid = np.linspace(0.99, 1.16, 16)
    for branch in cycles(diagram(loop, "r", grid).branches):
        for before, after in pairwise(branch.points):
            assert after.value - before.value == pytest.approx(grid[1] - grid[0])
            assert not jumps(loop, "r", before, after)


def test_a_jump_over_the_observer_gain_is_where_bisection_finds_it() -> None:
    gains = Gains(0.4, 0.02, observer=70.0, compensation=1.05)
    loop = ClosedLoop(asymmetric_robot(), Controller(gains, symmetric_robot()))
    drawn = diagram(loop, "L", np.linspace(20.0, 180.0, 33))
    below, above = cycles(drawn.branches)
    (jump,) = drawn.bifurcations
    assert jump.kind.startswith("limit cycle jumps: grazes x2 = 0")
    low, high = below.points[-1].value, above.points[0].value
    assert low < jump.value < high
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        cycle = find_cycle(LoopSection(with_gain(loop, "L", middle)), np.array([0.6, 0.0]))
        assert isinstance(cycle, Cycle)
        if cycle.period > 5.5:
            low = middle
        else:
            high = middle
    assert jump.value == pytest.approx(low, abs=1e-4)


@pytest.mark.parametrize("apart", [1e-12, 1e-15])
def test_values_hardly_apart_end_the_search(apart: float) -> None:
    """Around the jump at r = 1.0535449, and around the onset at r = 1."""
    rig = ClosedLoop(asymmetric_robot(), Controller(Gains(0.4, 0.02, 73.5, 1.0), symmetric_robot()))
    drawn = diagram(rig, "r", 1.0535449136 + apart * np.arange(-3, 4))
    assert sum(len(branch.points) for branch in cycles(drawn.branches)) >= 7
    paper = ClosedLoop(symmetric_robot(), rig.controller)
    assert diagram(paper, "r", 1.0 + apart * np.arange(-3, 4)).branches

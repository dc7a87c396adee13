"""Branches of cycles: published numbers, events found another way, multipliers by finite differences."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from compensation.cycle_branches import CycleBranch, Gain, cycle_branch, cycle_branches
from compensation.loop_section import LoopSection, with_gain
from compensation.orbits.continuation import Steps
from compensation.orbits.periodic_orbits import Cycle, NoCycle, find_cycle
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot


def loop(r: float, observer: float = 73.5, robot: OneLinkRobot | None = None) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot()))


@cache
def papers() -> tuple[CycleBranch, ...]:
    return cycle_branches(loop(1.1), "r", (1.0, 1.5))


@cache
def real_rig() -> tuple[CycleBranch, ...]:
    return cycle_branches(loop(1.0, robot=asymmetric_robot()), "r", (0.9, 1.2))


def test_the_symmetric_branch_ends_by_a_graze_that_breaks_its_symmetry() -> None:
    symmetric, pair = papers()
    assert (symmetric.symmetric, symmetric.returns) == (True, 1)
    event = symmetric.events[0]
    assert event.kind == "symmetry breaking"
    assert event.value - 1.0 == pytest.approx(1.0986e-5, abs=1e-9)
    assert "grazes x2 = 0" in event.says
    last = symmetric.points[0]
    assert last.cycle.stable
    assert 1e-3 < abs(last.cycle.multipliers[0]) ** 0.5 < 5e-3  # of the half map: nowhere near 1
    assert symmetric.events[-1].says == "end of the parameter's range"
    assert (symmetric.points[-1].value, pair.symmetric, pair.returns) == (1.5, False, 2)


def test_the_symmetry_breaking_is_where_simulation_finds_it() -> None:
    value = papers()[0].events[0].value
    start = papers()[0].points[0].cycle.point
    above = find_cycle(LoopSection(loop(value + 1e-9)), start)
    below = find_cycle(LoopSection(loop(value - 1e-9)), start)
    assert isinstance(above, Cycle)
    assert isinstance(below, Cycle)
    assert (above.returns, below.returns) == (1, 2)


def test_the_pair_meets_the_equilibrium_at_r_1_and_overlaps_the_symmetric_cycle() -> None:
    symmetric, pair = papers()
    assert pair.events[0].says == "meets the equilibrium"
    assert pair.events[0].value == pytest.approx(1.0, abs=1e-9)
    sizes = [point.cycle.amplitude for point in pair.points]
    assert sizes == sorted(sizes)
    assert pair.events[-1].value - symmetric.events[0].value == pytest.approx(1.427e-7, rel=0.02)


def test_above_the_critical_gain_the_cycle_grows_from_nothing() -> None:
    (branch,) = cycle_branches(loop(1.01, 120.0), "r", (1.0, 1.2))
    assert branch.events[0].says == "meets the equilibrium"
    assert branch.events[0].value == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    ("gain", "span"), [("r", (1.00002, 1.5)), ("L", (10.0, 300.0)), ("n1", (0.05, 1.2)), ("n2", (0.0, 0.3))]
)
def test_points_are_the_cycles_that_simulation_finds(gain: Gain, span: tuple[float, float]) -> None:
    case = loop(1.1)
    cycle = find_cycle(LoopSection(case), np.array([0.6, 0.0]))
    assert isinstance(cycle, Cycle)
    branch = cycle_branch(case, gain, span, cycle)
    assert (branch.points[0].value, branch.points[-1].value) == span
    for point in branch.points[:: max(1, len(branch.points) // 6)]:
        found = find_cycle(LoopSection(with_gain(case, gain, point.value)), point.cycle.point * (1 + 1e-6))
        assert isinstance(found, Cycle)
        assert found.returns == 1
        assert point.cycle.amplitude == pytest.approx(found.amplitude, rel=1e-9)
        assert point.cycle.period == pytest.approx(found.period, rel=1e-8)
        assert point.modes == ("estimate reversal", "velocity reversal") * 2
        assert point.sticks == ()


def test_published_cycle_is_on_the_branch() -> None:
    cycle = find_cycle(LoopSection(loop(1.1)), np.array([0.6, 0.0]))
    assert isinstance(cycle, Cycle)
    up = cycle_branch(loop(1.1), "r", (1.01, 1.1), cycle)
    assert up.points[0].value == 1.01
    assert up.points[0].cycle.amplitude == pytest.approx(0.09852434192, abs=1e-10)
    assert up.points[0].cycle.period == pytest.approx(7.551833164, abs=1e-8)
    assert up.points[-1].cycle.amplitude == pytest.approx(0.35368017536, abs=1e-10)


@pytest.mark.parametrize(("r", "observer", "half"), [(1.0001, 73.5, 3.65e-4), (1.001, 120.0, 0.0923)])
def test_multipliers_on_the_branch(r: float, observer: float, half: float) -> None:
    cycle = find_cycle(LoopSection(loop(1.01, observer)), np.array([0.6, 0.0]))
    assert isinstance(cycle, Cycle)
    first = cycle_branch(loop(1.01, observer), "r", (r, 1.02), cycle).points[0]
    assert first.value == r
    assert abs(first.cycle.multipliers[0]) ** 0.5 == pytest.approx(half, rel=5e-3)
    section = LoopSection(loop(r, observer))
    columns = []
    for axis in np.eye(2):
        step = 1e-6 * first.cycle.amplitude * axis
        ahead = section.follow(first.cycle.point + step, 1).points[0]
        behind = section.follow(first.cycle.point - step, 1).points[0]
        columns.append((ahead - behind) / (2e-6 * first.cycle.amplitude))
    largest = max(abs(np.linalg.eigvals(np.array(columns).T)))
    assert abs(first.cycle.multipliers[0]) ** 0.5 == pytest.approx(largest, rel=1e-4)


def test_the_real_rig_sticks_on_its_cycle_and_changes_its_modes() -> None:
    branch = real_rig()[0]
    assert not branch.symmetric
    assert branch.events[0].says.startswith("meets an equilibrium")
    assert branch.events[0].value == pytest.approx(0.99369340, abs=1e-7)
    changes = [event for event in branch.events if "becomes" in event.says]
    assert [event.kind for event in changes] == ["mode sequence"]
    assert changes[0].value == pytest.approx(1.03754, abs=2e-5)
    for point in branch.points:
        sticking = point.value < changes[0].value
        assert len(point.sticks) == (1 if sticking else 0)
        assert all(0.0 < stick.duration < point.cycle.period for stick in point.sticks)
    longest = [point.sticks[0].duration for point in branch.points if point.sticks]
    assert longest == sorted(longest, reverse=True)


def test_the_end_at_an_equilibrium_is_where_simulation_finds_it() -> None:
    branch = real_rig()[0]
    end, start = branch.events[0].value, branch.points[0].cycle.point
    rig = asymmetric_robot()
    assert isinstance(find_cycle(LoopSection(loop(end + 1e-6, robot=rig)), start), Cycle)
    assert find_cycle(LoopSection(loop(end - 1e-6, robot=rig)), start) == NoCycle("equilibrium")


@pytest.mark.parametrize(
    ("case", "gain", "span", "jump"),
    [
        (loop(1.0, robot=asymmetric_robot()), "r", (0.9, 1.2), 1.0535449),
        (loop(1.05, robot=asymmetric_robot()), "n1", (0.1, 1.0), 0.2981881),
        (loop(1.05, robot=asymmetric_robot()), "L", (20.0, 200.0), 68.62521),
        (loop(1.05, robot=asymmetric_robot()), "n2", (0.0, 0.3), 0.03851328),
    ],
)
def test_branches_go_on_beyond_a_jump_to_a_cycle_of_as_many_returns(
    case: ClosedLoop, gain: Gain, span: tuple[float, float], jump: float
) -> None:
    """There x1_max jumps by more than 3 % of the extent, while the modes stay."""
    first, second = cycle_branches(case, gain, span)
    below, above = sorted((first, second), key=lambda branch: branch.points[0].value)
    assert above.points[-1].value == span[1]
    ends = below.events[-1], above.events[0]
    assert [end.kind for end in ends] == ["mode sequence"] * 2
    assert [end.value for end in ends] == pytest.approx([jump, jump], rel=1e-6)
    assert all("grazes x2 = 0" in end.says for end in ends)
    last, next_one = below.points[-1].cycle, above.points[0].cycle
    assert abs(last.x1_max - next_one.x1_max) > 0.03 * (last.x1_max - last.x1_min)
    reached, gone = 0.99 * jump, 1.01 * jump
    point = min(below.points, key=lambda point: abs(point.value - reached)).cycle.point
    for _ in range(25):  # an independent bisection: where iterating the map leaves the branch
        middle = 0.5 * (reached + gone)
        found = find_cycle(LoopSection(with_gain(case, gain, middle)), point)
        assert isinstance(found, Cycle)
        if abs(found.period - last.period) < abs(found.period - next_one.period):
            point, reached = found.point, middle
        else:
            gone = middle
    assert ends[0].value == pytest.approx(reached, rel=1e-8)


def test_a_smooth_loss_of_symmetry_leaves_an_unstable_branch() -> None:
    curve = StribeckCurve(0.6595, 0.4160, 0.12, 0.0612)
    robot = OneLinkRobot(0.026, StribeckFriction.symmetric(curve))
    case = ClosedLoop(robot, Controller(Gains(1.227, 0.0159, 44.28, 1.2089), robot))
    symmetric, pair = cycle_branches(case, "r", (1.15317 - 2e-5, 1.3))
    (event,) = [event for event in symmetric.events if event.says == "symmetry breaking"]
    assert event.value == pytest.approx(1.15316178, abs=1e-8)
    for point in symmetric.points:
        assert point.cycle.stable == (point.value > event.value)
    below = symmetric.points[0]
    section = LoopSection(with_gain(case, "r", below.value))
    strayed = section.follow(below.cycle.point * (1 + 1e-6), 300).points
    assert float(np.max(np.abs(strayed - below.cycle.point))) > 1e-4
    assert (pair.symmetric, pair.returns, pair.events[0].says) == (False, 2, "joins a cycle of fewer returns")
    assert pair.events[0].value == pytest.approx(event.value, abs=1e-7)


def test_a_fold_of_cycles_has_an_unstable_side() -> None:
    robot = OneLinkRobot(
        0.026,
        StribeckFriction(
            StribeckCurve(0.7044647349, 0.5497764806, 0.0439476510, 0.0926805202, 2.0),
            StribeckCurve(0.5281028097, 0.4489253455, 0.0492396072, 0.0465933241, 2.0),
        ),
    )
    gains = Gains(0.2577464275, 0.0807422781, 102.1277849864, 1.0)
    case = ClosedLoop(robot, Controller(replace(gains, compensation=1.0012), robot))
    small = find_cycle(LoopSection(case), np.array([0.012, 0.0]))
    assert isinstance(small, Cycle)
    assert small.amplitude < 0.02
    branch = cycle_branch(case, "r", (1.001, 1.002), small, steps=Steps(points=60))
    (fold,) = [event for event in branch.events if event.kind == "fold of cycles"]
    assert fold.value == pytest.approx(1.0012470684, abs=1e-9)
    assert max(point.value for point in branch.points) <= fold.value + 1e-12
    turned = next(index for index, point in enumerate(branch.points) if not point.cycle.stable)
    assert all(point.cycle.stable for point in branch.points[:turned])
    assert not any(point.cycle.stable for point in branch.points[turned:])
    assert (
        branch.points[turned - 1].cycle.multipliers[0].real
        < 1.0
        < branch.points[turned].cycle.multipliers[0].real
    )
    reached, gone, point = 1.001, 1.002, branch.points[0].cycle.point
    for _ in range(40):  # an independent bisection: up to where iterating the map stays small
        middle = 0.5 * (reached + gone)
        found = find_cycle(LoopSection(with_gain(case, "r", middle)), point)
        if isinstance(found, Cycle) and found.amplitude < 0.1:
            reached, point = middle, found.point
        else:
            gone = middle
    assert reached == pytest.approx(fold.value, abs=1e-8)
    beyond = find_cycle(
        LoopSection(with_gain(case, "r", fold.value + 1e-6)), branch.points[turned].cycle.point
    )
    assert isinstance(beyond, Cycle)
    assert beyond.amplitude > 0.3  # only the large cycle is left


def test_a_branch_does_not_turn_back_without_a_fold() -> None:
    """Near a graze F_p is so large that a step across a knot of folds seemed to turn, and went back."""

    def shaped(robot: OneLinkRobot) -> OneLinkRobot:
        curves = (robot.friction.positive, robot.friction.negative)
        return replace(robot, friction=StribeckFriction(*(replace(c, stribeck_shape=2.0) for c in curves)))

    controller = Controller(Gains(0.4, 0.02, observer=73.5, compensation=1.05), shaped(symmetric_robot()))
    case = ClosedLoop(shaped(asymmetric_robot()), controller)
    cycle = find_cycle(LoopSection(case), np.array([0.3, 0.0]))
    assert isinstance(cycle, Cycle)
    branch = cycle_branch(case, "n1", (0.05, 1.5), cycle)
    assert branch.points[0].value == 0.05
    assert branch.points[-1].value == pytest.approx(1.13173, abs=1e-6)
    folds = [event.value for event in branch.events if event.kind == "fold of cycles"]
    assert folds[0] == pytest.approx(1.13172998740, abs=1e-10)
    assert max(point.value for point in branch.points) <= folds[0]


@pytest.mark.parametrize(
    ("gain", "span", "said"),
    [
        ("b", (0.0, 1.0), "gain is"),
        ("r", (1.2, 1.5), "span of r .* loop's own 1.1"),
        ("L", (90.0, 10.0), "span of L .* ascending"),
        ("r", (-1.0, 1.2), "span of r .* >= 0 .eqs 5-7"),
        ("r", (1.0, np.inf), "span of r .* finite number .eqs 5-7"),
        ("r", (np.nan, 1.2), "span of r .* finite"),
        ("r", 1.0, "span of r .* two gains"),
        ("r", ("1.0", None), "span of r .* two gains"),
        (["r"], (1.0, 1.2), "gain is"),
        ("n1", (0.0, 1.0), "span of n1 .*n1 > 0, .*eq 5"),
    ],
)
def test_bad_input_is_named(gain: Gain, span: tuple[float, float], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        cycle_branches(loop(1.1), gain, span)

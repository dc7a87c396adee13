"""The diagram of figure 9 and its kin, against what is known of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compensation.bifurcation import Branch, Diagram, diagram, where_it_ends
from compensation.closed_loop import ClosedLoop, simulate
from compensation.coexistence import largest_compensation_with_rest
from compensation.controller import Controller, Gains
from compensation.loop_section import LoopSection
from compensation.orbits.periodic_orbits import Cycle, find_cycle
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray


def loop(r: float = 1.0, observer: float = 73.5, robot: OneLinkRobot | None = None) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot()))


def branches(drawn: Diagram, kind: str) -> list[Branch]:
    return [branch for branch in drawn.branches if branch.kind == kind]


def test_figure_9() -> None:
    drawn = diagram(loop(), "r", np.linspace(0.8, 1.2, 41))
    (rest,) = branches(drawn, "equilibrium_set")
    (cycle,) = branches(drawn, "limit_cycle")
    alone = branches(drawn, "equilibrium")
    assert rest.points[-1].value < 1.0 < cycle.points[0].value
    assert [branch.stable for branch in alone if branch.points[-1].value > 1.0] == [False]
    amplitudes = [point.amplitude for point in cycle.points]
    assert amplitudes == sorted(amplitudes)
    near = min(cycle.points, key=lambda point: abs(point.value - 1.1))
    assert near.amplitude == pytest.approx(0.35368017536, abs=1e-9)
    assert near.period == pytest.approx(6.383337703, abs=1e-8)
    onset = next(b for b in drawn.bifurcations if "limit cycle appears" in b.kind)
    assert onset.value == pytest.approx(1.0, abs=1e-5)
    assert "zero amplitude" in onset.kind
    assert next(b for b in drawn.bifurcations if "equilibria" in b.kind).value == pytest.approx(1.0, abs=1e-9)


def test_below_the_critical_gain_the_cycle_jumps_and_equilibria_coexist() -> None:
    drawn = diagram(loop(observer=40.0), "r", np.linspace(0.99, 1.06, 29))
    onset = next(b for b in drawn.bifurcations if "limit cycle appears" in b.kind)
    assert "jump" in onset.kind
    outer = [branch for branch in branches(drawn, "equilibrium_set") if branch.points[0].value > 1.0]
    assert len(outer) == 2
    assert max(p.amplitude for branch in outer for p in branch.points if p.value == 1.01) == pytest.approx(
        0.249410046, abs=1e-8
    )


def test_asymmetric_robot_cycles_before_r_1_beside_its_equilibria() -> None:
    drawn = diagram(loop(robot=asymmetric_robot()), "r", np.linspace(0.98, 1.1, 13))
    cycles = branches(drawn, "limit_cycle")
    assert 0.99 < cycles[0].points[0].value <= 1.0
    rests = branches(drawn, "equilibrium_set")
    assert any(point.value > 1.0 for branch in rests for point in branch.points)
    points = [point for cycle in cycles for point in cycle.points]
    assert all(abs(point.x1_min + point.x1_max) > 1e-4 for point in points)
    assert all(point.amplitude == max(-point.x1_min, point.x1_max) for point in points)
    assert next(b for b in drawn.bifurcations if "equilibria" in b.kind).value == pytest.approx(
        1.0564, abs=1e-4
    )


def changes(drawn: Diagram, start: str) -> list[float]:
    return [change.value for change in drawn.bifurcations if change.kind.startswith(start)]


@pytest.mark.parametrize("points", [25, 70])
def test_no_branch_goes_across_a_jump(points: int) -> None:
    """The real rig's cycle jumps at r = 1.0535449: x1_max by 44 %, the period by 30 %."""
    drawn = diagram(loop(robot=asymmetric_robot()), "r", np.linspace(0.98, 1.1, points))
    below, above = branches(drawn, "limit_cycle")
    assert below.points[-1].value < 1.0535449 < above.points[0].value
    assert above.points[0].value - below.points[-1].value == pytest.approx(0.12 / (points - 1))
    assert changes(drawn, "limit cycle jumps") == pytest.approx([1.0535449], abs=1e-7)
    assert changes(drawn, "mode sequence") == pytest.approx([1.0375439], abs=1e-7)
    for branch in (below, above):
        steps = np.abs(np.diff([point.period for point in branch.points]))
        assert np.max(steps) < 0.3


def test_both_mirror_images_are_drawn_where_the_symmetry_is_broken() -> None:
    drawn = diagram(loop(observer=40.0), "r", np.linspace(1.0002, 1.003, 15))
    one, other, symmetric = branches(drawn, "limit_cycle")
    np.testing.assert_allclose(
        [(p.value, p.x1_min, p.x1_max) for p in one.points],
        [(p.value, -p.x1_max, -p.x1_min) for p in other.points],
        rtol=1e-9,
    )
    assert all(point.x1_min == -point.x1_max for point in symmetric.points)
    assert one.points[-1].value < 1.0017818 < symmetric.points[0].value
    assert changes(drawn, "symmetry breaking") == pytest.approx([1.0017818], abs=1e-7)


def test_a_loss_of_symmetry_between_two_values_is_named() -> None:
    """Of the pair below 1.000011 the grid of figure 9 has no value."""
    drawn = diagram(loop(), "r", np.linspace(0.8, 1.2, 200))
    assert changes(drawn, "symmetry breaking") == pytest.approx([1.0000109863], abs=4e-8)
    assert len(branches(drawn, "limit_cycle")) == 1


GRIDS = [
    np.linspace(0.99, 1.02, 7),
    np.array([0.0, 2.0]),
    np.array([0.0, 1e4]),
    np.array([1.0, 1e9]),
    np.linspace(0.0, 1e6, 5),
    np.array([1.0, 1.0 + 1e-12, 1.0 + 1e-9, 1.1]),
    np.array([1.0 - 1e-13, 1.0 + 1e-13, 1.00002]),
    1.0 + np.concatenate([[-1e-3], np.geomspace(1e-10, 1e-3, 20)]),
]


@pytest.mark.parametrize("grid", GRIDS)
def test_grids_of_every_width_tell_of_the_same_events(grid: FloatArray) -> None:
    """By small steps along it the symmetric cycle goes on down to 1.0000109862853."""
    drawn = diagram(loop(), "r", grid)
    assert changes(drawn, "limit cycle") == pytest.approx([1.0], abs=5e-16)
    assert [b.kind for b in drawn.bifurcations if "limit cycle" in b.kind] == [
        "limit cycle appears, from zero amplitude"
    ]
    assert changes(drawn, "symmetry breaking") == pytest.approx([1.0000109862853], abs=4e-8)


@given(
    low=st.floats(0.0, 1.0),
    widths=st.lists(st.floats(-2.5, 3.0), min_size=2, max_size=4, unique=True),
)
@settings(max_examples=5, deadline=None)
def test_random_grids_tell_of_the_same_events_below_the_critical_gain(
    low: float, widths: list[float]
) -> None:
    """At L = 40 cycles appear at r = 1, with a jump; a symmetric one lives from 1.00178184085 on."""
    grid = np.unique([low, *(1.0 + 10.0 ** np.array(widths))])
    drawn = diagram(loop(observer=40.0), "r", grid)
    assert changes(drawn, "limit cycle appears, with a jump")[0] == pytest.approx(1.0, abs=5e-16)
    breaking = [value for value in changes(drawn, "symmetry breaking") if value < 1.1]
    if grid[1] < 1.5:
        assert breaking == pytest.approx([1.00178184085], abs=4e-8)


def test_both_sides_of_a_hysteresis_are_one_event() -> None:
    """The pair lives up to 1.000011129, beside the symmetric cycle, which lives down to 1.0000109863."""
    drawn = diagram(loop(), "r", [1.000005, 1.00002])
    (change,) = drawn.bifurcations
    assert change.kind.startswith("symmetry breaking")
    assert change.value == pytest.approx(1.0000109862853, abs=1e-8)


def test_a_symmetric_cycle_does_not_double_its_period() -> None:
    """At L = 40 it loses its stability at r = 1.779938, where the multiplier of half a turn is -1."""
    drawn = diagram(loop(observer=40.0), "r", np.linspace(1.77, 1.79, 3))
    assert not changes(drawn, "period doubling")
    values = changes(drawn, "symmetry breaking")
    assert min(abs(value - 1.779938) for value in values) < 2e-6
    section = LoopSection(loop(r=1.779945, observer=40.0))
    cycle = find_cycle(section, np.array([1.0996841872565, 0.0]))
    assert isinstance(cycle, Cycle)
    slope = section.derivative(cycle.point)
    assert slope is not None
    assert min(np.linalg.eigvals(slope).real) == pytest.approx(-np.sqrt(0.7829), abs=1e-3)


@pytest.mark.parametrize("r", [1e6, 1e10, 1e13])
def test_a_huge_compensation_gain_makes_a_huge_cycle(r: float) -> None:
    """There friction is nothing beside compensation: amplitudes grow in proportion to r, the period stays."""
    (cycle,) = branches(diagram(loop(), "r", [r]), "limit_cycle")
    assert cycle.points[0].amplitude / r == pytest.approx(1.3910484265, rel=2e-6)
    assert cycle.points[0].period == pytest.approx(1.7932994913, rel=2e-6)


def test_over_the_observer_gain() -> None:
    drawn = diagram(loop(r=1.05), "L", np.linspace(40.0, 120.0, 9))
    (cycle,) = branches(drawn, "limit_cycle")
    assert len(cycle.points) == 9
    assert drawn.parameter == "L"
    assert all(abs(m) < 1.0 for point in cycle.points for m in point.multipliers)


def test_at_r_1_the_equilibrium_set_vanishes_at_the_critical_gain() -> None:
    drawn = diagram(loop(r=1.0), "L", np.linspace(60.0, 80.0, 21))
    change = next(b for b in drawn.bifurcations if "equilibria" in b.kind)
    assert change.value == pytest.approx(73.0704, abs=1e-3)


@pytest.mark.parametrize(
    ("r", "start", "verdict"),
    [
        (0.99, 0.6, "equilibrium"),
        (1.0, 0.6, "limit_cycle"),
        (1.02, -0.1, "equilibrium"),
        (1.02, 0.1, "limit_cycle"),
    ],
)
def test_where_a_start_ends(r: float, start: float, verdict: str) -> None:
    found = where_it_ends(loop(r, robot=asymmetric_robot()), (start, 0.0, 0.0), duration=30.0)
    assert found.verdict == verdict


def test_a_grid_value_on_the_change_makes_no_second_change() -> None:
    drawn = diagram(loop(), "r", np.array([0.9, 1.0, 1.1]))
    (change,) = [b for b in drawn.bifurcations if "equilibria" in b.kind]
    assert change.value == pytest.approx(1.0, abs=1e-9)
    assert change.kind.endswith("around the set point ends, set point begins")


def test_all_changes_inside_one_interval_are_found() -> None:
    """Below the critical gain rests beside the set point appear at r = 1 and vanish at r_max(L)."""
    below = loop(observer=40.0)
    r_max = largest_compensation_with_rest(below.robot, below.controller).r_max
    drawn = diagram(below, "r", [0.9, 1.2])
    changes = [b.value for b in drawn.bifurcations if "equilibria" in b.kind]
    assert changes == pytest.approx([1.0, r_max], rel=1e-12)


def test_a_link_that_halts_without_turning_ends_the_search() -> None:
    curves = (
        StribeckCurve(1.04071774, 0.7255979912, 0.0767425807, 1.0850740295, 1.5),
        StribeckCurve(0.9592822593, 0.6688204238, 0.0832574193, 1.0850740295, 1.5),
    )
    robot = OneLinkRobot(0.0924752375, StribeckFriction(*curves))
    gains = Gains(0.22089940669903593, 0.07280431746623534, observer=66.22759672732795, compensation=1.04)
    drawn = diagram(ClosedLoop(robot, Controller(gains, robot.mean())), "r", np.array([1.04, 1.041]))
    assert drawn.branches


def test_half_turns_that_are_no_returns_break_no_diagram() -> None:
    """The model is far from the robot: on the way of cycles of two returns the link all but rests."""

    def robot(inertia: float, *law: float) -> OneLinkRobot:
        return OneLinkRobot(inertia, StribeckFriction.symmetric(StribeckCurve(*law)))

    true = robot(0.01631757085329408, 0.5160596780814289, 0.24310354060304665, 0.08765474291449978, 0.0890046)
    model = robot(0.23177673516130345, 0.6976168275253933, 0.4071368940022393, 0.06993744788698908, 0.1347659)
    gains = Gains(0.993544586364019, 0.10831356165905676, observer=11.7, compensation=0.9)
    assert diagram(ClosedLoop(true, Controller(gains, model)), "L", [50.0, 75.0]).branches
    true = robot(
        0.023706837588159765, 0.46925199247480276, 0.3395118340135017, 0.0933241605181, 0.18777207834
    )
    model = robot(0.2939019749796513, 0.47102804766177536, 0.3831496018471239, 0.038624764978, 0.187089698491)
    gains = Gains(0.21148945277448333, 0.11917836134361595, observer=49.8, compensation=0.9)
    assert diagram(ClosedLoop(true, Controller(gains, model)), "L", [25.0, 50.0]).branches


def test_bad_input_is_named() -> None:
    with pytest.raises(ModelError, match="'r' or 'L'"):
        diagram(loop(), "n1", [1.0])  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(ModelError, match="ascend"):
        diagram(loop(), "r", [1.0, 0.9])


def test_a_fast_observer_hides_no_cycle() -> None:
    """As L grows the estimate becomes the velocity; the cycle of r > 1 stays, with a limit of its own."""
    for observer in (1e4, 1e6):
        case = loop(1.1, observer)
        (cycles,) = [b for b in diagram(case, "r", [1.1]).branches if b.kind == "limit_cycle"]
        run = simulate(case, (0.15, 0.0, 0.0), duration=6.0, times=())
        halts = [abs(event.state[0]) for event in run.events if event.kind == "velocity reversal"]
        assert cycles.points[0].amplitude == pytest.approx(halts[-1], rel=1e-4)


def test_what_is_not_resolved_is_said() -> None:
    found = diagram(loop(1.1, 1e9), "r", [1.1])
    assert not any(branch.kind == "limit_cycle" for branch in found.branches)
    (note,) = found.notes
    assert "r = 1.1 to 1.1" in note
    assert "step limit" in note
    assert diagram(loop(1.1), "r", [0.9, 1.0, 1.1]).notes == ()

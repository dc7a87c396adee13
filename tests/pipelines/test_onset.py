"""The onset of limit cycling: found where a made-up loop has it, bracketed where the records put it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compensation.controller import Controller, Gains
from compensation.sampled_loop import Sampling
from data.protocols import SetPoint
from data.recording import Recording
from ident.model import published
from ident.model.robot import OneLinkRobot
from pipelines.onset import (
    TOLERANCE,
    JudgedRun,
    drawn_onsets,
    groups,
    interval95,
    middle,
    recorded_bracket,
    scanned_gains,
    smallest_cycling,
)
from pipelines.recordings import SetPointRun
from pipelines.run_outcomes import (
    SPENT,
    Budget,
    LoopAsRun,
    Outcome,
    Verdicts,
    ideal_outcomes,
    sampled_outcomes,
)

REST = Outcome("equilibrium", 0.1, 0.1, None, None)
CYCLE = Outcome("limit_cycle", -0.3, 0.3, 0.3, 6.0)
UNDECIDED = Outcome("undecided", None, None, None, None, "too slow")
ROBOT = published.symmetric_robot()


def judged(r: float, seen: Outcome = REST, *, start: float = 0.6, observer: float = 73.5) -> JudgedRun:
    recording = Recording(
        log=f"{r}",
        protocol="set_point",
        time=np.array([0.0, 1.0]),
        position=np.full(2, start),
        torque=np.zeros(2),
    )
    run = SetPointRun(recording, SetPoint(0.4, 0.02, observer, r), None)
    controller = Controller(Gains(0.4, 0.02, observer, r), ROBOT)
    return JudgedRun(run, seen, start, LoopAsRun(ROBOT, controller, Sampling(0.001), start, 0.0, 20.0))


def loop_of(run: JudgedRun) -> LoopAsRun:
    assert run.loop is not None
    return run.loop


def cycling_from(threshold: float) -> Verdicts:
    """Loops that cycle from an r on which the robot's inertia moves, as a fit's error would."""

    def predict(loops: Sequence[LoopAsRun]) -> tuple[Outcome, ...]:
        return tuple(
            CYCLE
            if loop.controller.gains.compensation >= threshold + loop.robot.inertia - ROBOT.inertia
            else REST
            for loop in loops
        )

    return predict


def test_runs_are_grouped_by_settings_and_start() -> None:
    starts = (0.6, 0.61, -0.6, -0.59, 0.1, -0.1)
    runs = [judged(1.0, start=start) for start in starts] + [judged(1.0, observer=40.0)]
    found = groups(runs)
    assert [[run.start for run in group] for group in found] == [
        [-0.6, -0.59], [-0.1], [0.1], [0.6, 0.61], [0.6],
    ]  # fmt: skip
    assert middle(found[3]).start == 0.6


def test_runs_at_any_r_and_sample_clock_belong_together() -> None:
    assert len(groups([judged(0.9), judged(1.0), judged(1.1)])) == 1


@pytest.mark.parametrize(
    ("seen", "ends", "reversals"),
    [
        ({0.9: REST, 0.99: REST, 1.0: CYCLE, 1.1: CYCLE}, (0.99, 1.0), ()),
        ({0.9: REST, 0.99: UNDECIDED, 1.0: CYCLE}, (0.9, 1.0), ()),
        ({0.9: REST, 1.0: CYCLE, 1.05: REST, 1.1: CYCLE}, (0.9, 1.0), (1.05,)),
        ({0.9: REST, 1.0: REST}, (1.0, None), ()),
        ({1.0: CYCLE, 1.1: CYCLE}, (None, 1.0), ()),
        ({0.9: UNDECIDED}, (None, None), ()),
    ],
)
def test_the_recorded_bracket(
    seen: dict[float, Outcome], ends: tuple[float | None, float | None], reversals: tuple[float, ...]
) -> None:
    found = recorded_bracket([judged(r, outcome) for r, outcome in seen.items()])
    assert (found.resting, found.cycling) == ends
    assert found.reversals == reversals
    assert (found.why is None) == (None not in ends)


@given(threshold=st.floats(0.71, 1.49))
def test_the_smallest_cycling_gain_is_found(threshold: float) -> None:
    gains = scanned_gains([judged(0.9), judged(1.3)])
    found = smallest_cycling(loop_of(judged(1.0)), gains, cycling_from(threshold))
    assert found.r == pytest.approx(threshold, abs=TOLERANCE)


@pytest.mark.parametrize(
    ("threshold", "why"), [(0.0, "every r down to 0.7 cycles"), (9.0, "no r from 0.7 to 1.5")]
)
def test_an_onset_beyond_the_scan_is_none_and_says_so(threshold: float, why: str) -> None:
    gains = scanned_gains([judged(0.9), judged(1.3)])
    found = smallest_cycling(loop_of(judged(1.0)), gains, cycling_from(threshold))
    assert found.r is None
    assert why in (found.why or "")


def test_what_is_undecided_is_no_onset_and_is_said() -> None:
    def nothing(loops: Sequence[LoopAsRun]) -> tuple[Outcome, ...]:
        return tuple(UNDECIDED for _ in loops)

    def above(loops: Sequence[LoopAsRun]) -> tuple[Outcome, ...]:
        return tuple(CYCLE if loop.controller.gains.compensation > 1.0 else UNDECIDED for loop in loops)

    gains = scanned_gains([judged(0.9), judged(1.3)])
    for predict, why in ((nothing, "no r from 0.7 to 1.5"), (above, "cycles at r = 1.01")):
        found = smallest_cycling(loop_of(judged(1.0)), gains, predict)
        assert found.r is None
        assert why in (found.why or "")
        assert "of the r are undecided: too slow" in (found.why or "")


def test_a_search_ends_when_its_samples_are_spent() -> None:
    loop, budget = loop_of(judged(1.1)), Budget(30_000)
    (first,) = sampled_outcomes([loop], budget=budget)
    assert first.verdict == "limit_cycle"
    assert budget.left <= 10_000
    sampled_outcomes([loop], budget=budget)
    (second,) = sampled_outcomes([loop], budget=budget)
    assert (second.verdict, second.why) == ("undecided", SPENT)


@pytest.mark.parametrize("n1", [0.004, 0.4, 400.0])
def test_the_ideal_loop_is_watched_in_turns_of_its_own(n1: float) -> None:
    """A fast loop turns thousands of times in the time of a record: rows and steps must not."""
    robot = published.asymmetric_robot()
    for r, verdict in ((0.7, "equilibrium"), (1.3, "limit_cycle")):
        controller = Controller(Gains(n1, 0.02, 73.5, r), robot.mean())
        loop = LoopAsRun(robot, controller, Sampling(0.001), 0.6, 0.0, 30.0)
        (found,) = ideal_outcomes([loop])
        assert found.verdict == verdict


def test_drawn_onsets_are_found_near_and_far_and_not_beyond() -> None:
    shifts = (0.0, 0.001, -0.015, 0.12, -0.015, 0.4, 2.0)
    robots = [OneLinkRobot(ROBOT.inertia + shift, ROBOT.friction) for shift in shifts]
    loop = loop_of(judged(1.0))
    onsets = drawn_onsets(loop, robots, cycling_from(1.0), around=1.05, limits=(0.7, 1.5))
    np.testing.assert_allclose(onsets[:-1], 1.0 + np.array(shifts[:-1]), atol=0.003)
    assert onsets[-1] == np.inf
    everywhere = drawn_onsets(loop, robots[:1], cycling_from(0.1), around=1.0, limits=(0.7, 1.5))
    assert everywhere[0] == -np.inf


def test_the_interval_holds_95_percent_and_is_open_where_nothing_was_found() -> None:
    onsets = np.linspace(0.9, 1.1, 201)
    assert interval95(onsets) == pytest.approx((0.905, 1.095))
    assert interval95(np.array([1.0, 1.1, np.inf])) == (1.0, None)
    assert interval95(np.array([-np.inf, 1.0, 1.1])) == (None, 1.1)
    assert interval95(np.array([])) == (None, None)

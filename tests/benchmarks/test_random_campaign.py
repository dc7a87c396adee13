"""A thousand random loops: every one ends, and for a reason that each of the checks confirms or catches."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.random_campaign import (
    CONTRADICTED,
    DURATION,
    SHARE,
    UNSTABLE,
    WHOLE,
    Failures,
    Loops,
    Runs,
    check,
    continues,
    random_loops,
    random_tables,
    run_campaign,
    solve,
    stays,
    step_along,
)
from benchmarks.time_stepping import march_every
from ident.simulation.integrate import EQUILIBRIUM, TIME_REACHED


def some_runs(seed: int, count: int = 24) -> tuple[Loops, Runs]:
    generator = np.random.default_rng(seed)
    loops = random_loops(count, generator)
    return loops, solve(loops, generator.normal(size=(count, 3)), DURATION)


def test_no_trajectory_fails() -> None:
    found = run_campaign(1000, np.random.default_rng(7))
    assert found.failures == Failures(0, 0, 0, 0, 0)
    assert found.stepped == 1000 // SHARE
    assert found.piecewise + found.unstable + found.imprecise <= 10


@pytest.mark.parametrize("seed", [1, 2])
def test_the_campaign_is_the_seed(seed: int) -> None:
    first, again = (random_tables(5, np.random.default_rng(seed)) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_half_of_the_laws_have_a_shape_of_one_and_a_quarter_of_two() -> None:
    shapes = random_loops(4000, np.random.default_rng(3)).laws[..., 4]
    assert shapes.min() >= 0.5
    assert shapes.max() <= 2.0
    assert np.mean(shapes == 1.0) == pytest.approx(0.5, abs=0.03)
    assert np.mean(shapes == 2.0) == pytest.approx(0.25, abs=0.03)
    mixed = (shapes == 1.0).any(axis=1) & (shapes == 2.0).any(axis=1)
    assert np.mean(mixed) > 0.05


def test_a_false_equilibrium_is_caught_by_every_check() -> None:
    loops, runs = some_runs(4)
    moving = np.flatnonzero(runs.reason == TIME_REACHED)
    assert moving.size > 3
    planted = runs.reason.copy()
    planted[moving] = EQUILIBRIUM
    false = replace(runs, reason=planted)
    assert stays(loops, runs).all()
    assert not stays(loops, false)[moving].any()
    assert not continues(loops, false)[0][moving].any()
    assert (step_along(loops, false)[moving] == CONTRADICTED).all()


def test_a_false_time_reached_is_caught_by_restart_and_stepper() -> None:
    loops, runs = some_runs(5)
    resting = np.flatnonzero(runs.reason == EQUILIBRIUM)
    assert resting.size > 3
    planted = runs.reason.copy()
    planted[resting] = TIME_REACHED
    false = replace(runs, reason=planted)
    assert not continues(loops, false)[0][resting].any()
    verdicts = step_along(loops, false)
    assert (verdicts[resting] == CONTRADICTED).all()
    assert (np.delete(verdicts, resting) < UNSTABLE).all()


def test_a_wrong_end_is_counted() -> None:
    loops, runs = some_runs(6)
    states, end = runs.states.copy(), runs.end.copy()
    states[0, -1, 0] += 0.05
    end[0, 0] += 0.05
    found = check(loops, replace(runs, states=states, end=end))
    assert (found.failures.not_continued, found.failures.contradicted) == (1, 1)


def test_the_stepper_is_of_first_order() -> None:
    loops, runs = some_runs(7)
    assert (step_along(loops, runs) == WHOLE).sum() >= 22
    errors = []
    for fineness in (0.04, 0.01):
        ends, moving = runs.start.copy(), np.zeros(24, bool)
        duration = np.full(24, 0.5)
        march_every(loops.laws, loops.inertia, loops.gains, fineness, duration, 0, 1, ends, moving)
        errors.append(np.median(np.abs(ends - solve(loops, runs.start, 0.5).states[:, -1])))
    assert errors[1] == pytest.approx(0.25 * errors[0], rel=0.3)

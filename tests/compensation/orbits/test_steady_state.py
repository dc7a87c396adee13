"""Verdicts on records whose truth is known: closed forms, and exact trajectories as an encoder sees them."""

import math

import numpy as np
import pytest

from compensation.bifurcation import where_it_ends
from compensation.closed_loop import ClosedLoop, simulate
from compensation.controller import Controller, Gains
from compensation.orbits.steady_state import classify
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot

COUNT = 2 * math.pi / 2**14  # [rad]
TIME = np.arange(0.0, 30.0, 1e-3)  # [s]


def loop(r: float, observer: float, robot: OneLinkRobot) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot, Controller(gains, symmetric_robot()))


def noisy(position: np.ndarray, counts: int = 1) -> np.ndarray:
    jitter = np.random.default_rng(4).integers(-counts, counts + 1, position.size)
    return (np.round(position / COUNT) + jitter) * COUNT


@pytest.mark.parametrize("r", [0.0, 0.8, 0.95, 0.99, 1.005, 1.02, 1.1, 1.3])
@pytest.mark.parametrize("observer", [40.0, 73.5, 120.0])
@pytest.mark.parametrize("robot", [symmetric_robot(), asymmetric_robot()], ids=["symmetric", "asymmetric"])
def test_exact_and_recorded_runs_agree_with_where_they_end(
    r: float, observer: float, robot: OneLinkRobot
) -> None:
    case = loop(r, observer, robot)
    truth = where_it_ends(case, (0.6, 0.0, 0.0), duration=30.0)
    position = simulate(case, (0.6, 0.0, 0.0), duration=30.0, times=TIME).state[:, 0]
    for seen, resolution in ((position, 0.0), (noisy(position, 0), 0.0), (noisy(position), COUNT)):
        found = classify(TIME, seen + 0.3, reference=0.3, resolution=resolution)
        assert found.verdict == truth.verdict, found.why
        if truth.verdict == "equilibrium":
            assert found.position_error == pytest.approx(truth.position_error, abs=1.5 * COUNT)
        else:
            assert found.amplitude == pytest.approx(truth.amplitude, abs=2.5 * COUNT)
            assert found.period == pytest.approx(truth.period, rel=0.01)


def test_few_points_uneven_stamps_and_samples_lost_do_not_matter() -> None:
    case = loop(1.1, 73.5, asymmetric_robot())
    random = np.random.default_rng(1)
    time = np.sort(random.uniform(0.0, 20.0, 401))
    found = classify(time, simulate(case, (1.0, 0.0, 0.0), duration=20.0, times=time).state[:, 0])
    assert found.verdict == "limit_cycle"
    assert found.amplitude == pytest.approx(0.3914, rel=0.01)


@pytest.mark.parametrize("amplitude", [10.0, 100.0])
def test_a_cycle_of_ten_counts_is_seen(amplitude: float) -> None:
    position = noisy(0.2 + amplitude * COUNT * np.sin(2 * np.pi * TIME / 3.1))
    found = classify(TIME, position, reference=0.2, resolution=COUNT)
    assert found.verdict == "limit_cycle"
    assert found.period == pytest.approx(3.1, rel=0.03)
    assert found.amplitude == pytest.approx(amplitude * COUNT, abs=2 * COUNT)


def test_flicker_of_counts_is_rest() -> None:
    found = classify(TIME, noisy(np.full(TIME.size, 0.0123), counts=2), resolution=COUNT)
    assert found.verdict == "equilibrium"
    assert found.position_error == pytest.approx(0.0123, abs=COUNT)


def test_a_cycle_that_sticks_in_every_turn_is_no_rest() -> None:
    phase = (TIME / 8.0) % 1.0
    half = np.clip(4.0 * (phase % 0.5), 0.0, 1.0)  # moves for a quarter of the turn, then sticks
    move = np.where(phase < 0.5, -np.cos(np.pi * half), np.cos(np.pi * half))
    for end in (24.0, 27.3, 29.5):
        cut = end > TIME
        found = classify(TIME[cut], noisy(0.1 * move)[cut], resolution=COUNT)
        assert found.verdict == "limit_cycle", found.why
        assert found.period == pytest.approx(8.0, rel=0.02)


def test_slow_cycles_need_about_three_turns() -> None:
    wave = 0.2 * np.cos(2 * np.pi * TIME / 9.5)
    assert classify(TIME, noisy(wave), resolution=COUNT).verdict == "limit_cycle"
    cut = TIME < 12.0
    short = classify(TIME[cut], noisy(wave)[cut], resolution=COUNT)
    assert short.verdict == "undecided"
    assert "short" in short.why


@pytest.mark.parametrize(("rate", "word"), [(-0.01, "decaying"), (-0.003, "decaying"), (0.02, "growing")])
def test_spirals_are_undecided(rate: float, word: str) -> None:
    wave = 0.2 * np.exp(rate * TIME) * np.cos(2 * np.pi * TIME / 2.5)
    found = classify(TIME, noisy(wave), resolution=COUNT)
    assert found.verdict == "undecided"
    assert word in found.why


def test_rest_after_a_cycle_is_rest_and_too_short_a_rest_is_not() -> None:
    wave = 0.2 * np.sin(2 * np.pi * np.minimum(TIME, 18.25) / 2.0)
    assert classify(TIME, noisy(wave), resolution=COUNT).verdict == "equilibrium"
    cut = TIME < 19.0
    assert classify(TIME[cut], noisy(wave)[cut], resolution=COUNT).verdict != "equilibrium"


def test_drift_is_undecided() -> None:
    found = classify(TIME, noisy(0.02 * TIME), resolution=COUNT)
    assert found.verdict == "undecided"
    assert "drifting" in found.why
    wave = 0.02 * TIME + 0.3 * np.sin(2 * np.pi * TIME / 2.0)
    assert classify(TIME, noisy(wave), resolution=COUNT).verdict == "undecided"


def test_what_is_no_record_is_refused_by_name() -> None:
    still = np.zeros(TIME.size)
    with pytest.raises(ValueError, match=r"time must ascend: 0 s follows 29\.999 s"):
        classify(np.concatenate([TIME[200:], TIME[:200]]), still)
    for name, words in (("time", [TIME.astype(str), still]), ("position", [TIME, still + 1j])):
        with pytest.raises(ValueError, match=f"{name} holds"):
            classify(*words)
    for wrong in ({"reference": math.nan}, {"resolution": -1.0}, {"resolution": math.inf}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            classify(TIME, still, **wrong)


def test_a_record_too_short_says_so() -> None:
    assert "too short" in classify([0.0, 1.0], [0.0, 0.0]).why
    assert classify([], []).verdict == "undecided"
    assert "belong" in classify([0.0, 1.0], [0.0]).why

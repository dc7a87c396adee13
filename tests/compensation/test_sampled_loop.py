"""The sampled loop: its limit is the inclusion, its parts are the controller's, its onset is the rig's."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest

from compensation.controller import Controller, Gains
from compensation.sampled_loop import LongRun, Sampling, run_many, run_sampled
from ident.model.friction import ModelError
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.response import respond
from tests.bad_values import NO_ARRAYS, NO_NUMBERS, NO_WORDS, each_refused, refused

SYMMETRIC, TABLE_1 = symmetric_robot(), asymmetric_robot()
COUNT = 2 * math.pi / 2**18


def controller(r: float, model: OneLinkRobot = SYMMETRIC) -> Controller:
    return Controller(Gains(proportional=0.4, derivative=0.02, observer=73.5, compensation=r), model)


def error_at_20_s(period: float, update: str) -> float:
    sampling = Sampling(period, observer_update="exact" if update == "exact" else "euler")
    run = run_sampled(SYMMETRIC, controller(1.1), sampling, start=(1.0, 0.0), duration=20.0)
    assert run.time[-1] == pytest.approx(20.0, abs=1e-9)
    return float(max(abs(run.position[-1] + 0.2789541574), abs(run.estimate[-1] + 0.0151153949)))


def test_tends_to_the_inclusion_at_first_order() -> None:
    errors = [error_at_20_s(h, "euler") for h in (1e-3, 1e-4, 1e-5)]
    orders = -np.diff(np.log10(errors))
    assert errors[0] < 4e-3
    np.testing.assert_allclose(orders, 1.0, atol=0.05)


def test_the_exact_observer_has_the_same_limit() -> None:
    assert error_at_20_s(1e-5, "exact") < 1e-3


def test_is_what_the_controller_s_equations_say() -> None:
    h, r, delay, limit = 2e-3, 1.05, 2, 0.55
    sampling = Sampling(h, resolution=COUNT, delay=delay, torque_limit=limit)
    run = run_sampled(TABLE_1, controller(r), sampling, start=(0.9, 0.3), duration=2.0, reference=0.1)
    np.testing.assert_array_equal(run.measured, COUNT * np.rint(run.position / COUNT))
    law = SYMMETRIC.friction.positive
    z, commands = -73.5 * run.measured[0], []
    for k, q in enumerate(run.measured):
        estimate = z + 73.5 * q
        assert estimate == pytest.approx(run.estimate[k], abs=1e-12)
        estimate = run.estimate[k]
        feedback = 0.4 * (0.1 - q) - 0.02 * estimate
        dry = math.copysign(float(law.dry(abs(estimate))), estimate) if estimate else 0.0
        commands.append(min(max(feedback + r * dry, -limit), limit))
        z += h * (-(law.viscous_damping / 0.026 + 73.5) * estimate + feedback / 0.026)
    np.testing.assert_allclose(run.torque[delay:], commands[:-delay], atol=1e-12)
    np.testing.assert_array_equal(run.torque[:delay], 0.0)
    position, velocity = respond(TABLE_1, start=(0.9, 0.3), torque=run.torque[:-1], period=h)
    np.testing.assert_array_equal(position, run.position)
    np.testing.assert_array_equal(velocity, run.velocity)


def cycle(r: float, start: float, counts: float, period: float = 1e-3) -> float:
    """max |q| over the last 10 s of 60, 0 where the link rests by then."""
    sampling = Sampling(period, resolution=2 * math.pi / counts)
    q = run_sampled(
        TABLE_1, controller(r, TABLE_1.mean()), sampling, start=(start, 0.0), duration=60.0
    ).measured[-round(10.0 / period) :]
    return 0.0 if np.ptp(q) == 0.0 else float(np.max(np.abs(q)))


@pytest.mark.parametrize("start", [0.6, -0.6, 0.1])
def test_the_asymmetric_rig_cycles_from_just_below_r_1(start: float) -> None:
    assert cycle(0.99, start, 2**18) == 0.0
    assert cycle(1.00, start, 2**18) == pytest.approx(0.185, rel=0.03)
    assert cycle(1.10, start, 2**18) == pytest.approx(0.391, rel=0.02)


def test_from_a_small_negative_start_it_still_rests_at_r_1_02() -> None:
    assert cycle(1.02, -0.1, 2**18) == 0.0


def test_a_coarse_encoder_moves_the_onset_up_and_the_amplitude_down() -> None:
    assert cycle(1.005, 0.6, 20_000) == 0.0
    assert 0.8 < cycle(1.01, 0.6, 20_000) / cycle(1.01, 0.6, 2**18) < 0.95
    assert cycle(1.01, 0.6, 20_000, period=2.5e-4) > 0.0


def test_many_runs_are_the_single_ones_in_order() -> None:
    sampling = Sampling(1e-3, resolution=COUNT)
    controllers = [controller(r) for r in (0.9, 1.1)]
    starts = [(0.6, 0.0), (-0.3, 0.0)]
    alone = [
        run_sampled(TABLE_1, c, sampling, start=s, duration=1.0).measured
        for c, s in zip(controllers, starts, strict=True)
    ]
    np.testing.assert_array_equal(
        run_many([TABLE_1], controllers, sampling, starts=starts, duration=1.0), alone
    )
    with ThreadPoolExecutor(2) as pool:
        spread = run_many([TABLE_1], controllers, sampling, starts=starts, duration=1.0, map=pool.map)
    np.testing.assert_array_equal(spread, alone)


def test_refuses_what_no_controller_can_be() -> None:
    with pytest.raises(ModelError, match="period"):
        Sampling(0.0)
    with pytest.raises(ModelError, match="resolution"):
        Sampling(1e-3, resolution=-1.0)
    with pytest.raises(ModelError, match="limit"):
        Sampling(1e-3, torque_limit=0.0)
    with pytest.raises(ModelError, match="delay"):
        Sampling(1e-3, delay=-1)
    with pytest.raises(ModelError, match="finite"):
        run_sampled(TABLE_1, controller(1.0), Sampling(1e-3), start=(math.nan, 0.0), duration=1.0)
    with pytest.raises(ModelError, match="one for each"):
        run_many([TABLE_1], [controller(1.0)] * 2, Sampling(1e-3), starts=[(0.0, 0.0)] * 3, duration=1.0)


def test_a_run_goes_on_where_it_ended() -> None:
    sampling = Sampling(1e-3, resolution=COUNT, delay=2)
    whole = run_sampled(TABLE_1, controller(1.1), sampling, start=(0.6, 0.0), duration=2.0)
    run = LongRun(TABLE_1, controller(1.1), sampling, start=(0.6, 0.0))
    parts = [np.empty((1, n)) for n in (1, 700, 1300)]
    assert [run.fill(part) for part in parts] == [1, 700, 1300]
    np.testing.assert_array_equal(np.concatenate([part[0] for part in parts]), whole.measured)
    assert (run.end, whole.end) == ("time reached", "time reached")


@pytest.mark.parametrize("delay", [0, 3])
def test_a_rest_for_good_is_one(delay: int) -> None:
    """What is filled up at once is what the samples would have been: no later one differs."""
    sampling = Sampling(1e-3, resolution=COUNT, delay=delay)
    run = LongRun(TABLE_1, controller(0.9), sampling, start=(0.6, 0.0))
    rows = np.empty((5, 30_001))
    made = run.fill(rows)
    assert run.end == "at rest for good"
    assert made < 20_000
    np.testing.assert_array_equal(rows[:, made:] - rows[:, made - 1 : made], 0.0)
    assert abs(rows[4, -1]) <= TABLE_1.friction.positive.static_torque
    measured, estimate, torque = rows[0, -1], rows[3, -1], rows[4, -1]
    dry = math.copysign(float(SYMMETRIC.friction.positive.dry(abs(estimate))), estimate)
    assert torque == pytest.approx(-0.4 * measured - 0.02 * estimate + 0.9 * dry, abs=1e-12)
    with pytest.raises(ModelError, match="does not go on"):
        run.fill(rows)


def test_an_unstable_controller_runs_away_and_is_cut_short() -> None:
    """Euler's observer diverges from L h = 2 on; without an end its torques keep the solver busy for ever."""
    fast = Controller(Gains(0.004, 0.02, observer=1000.0, compensation=0.9), SYMMETRIC)
    run = run_sampled(TABLE_1, fast, Sampling(1e-2), start=(0.6, 0.0), duration=30.0)
    assert run.end == "runs away"
    assert run.time.size == run.torque.size < 100
    assert np.all(np.isfinite(run.torque))
    (position,) = run_many([TABLE_1], [fast], Sampling(1e-2), starts=[(0.6, 0.0)], duration=30.0)
    np.testing.assert_array_equal(np.isfinite(position), np.arange(position.size) < run.time.size)


def test_what_is_no_number_is_refused_by_name() -> None:
    each_refused(Sampling, {}, {"period": (*NO_NUMBERS, math.inf, -1.0)})
    settings = {
        "resolution": (*NO_NUMBERS, math.inf),
        "observer_update": ("rk4", "Euler", *NO_WORDS),
        "delay": (*NO_NUMBERS, 1.5, math.inf),
    }
    each_refused(Sampling, {"period": 1e-3}, settings)
    limits: tuple[Any, ...] = (*NO_NUMBERS, -math.inf)
    for limit in limits:
        refused(partial(Sampling, 1e-3, torque_limit=limit), "torque limit")
    assert Sampling(1e-3, torque_limit=math.inf).torque_limit == math.inf
    run = {"robot": TABLE_1, "controller": controller(1.0), "sampling": Sampling(1e-3)}
    given = {**run, "start": (0.6, 0.0), "duration": 1.0}
    bad = {
        "start": (*NO_ARRAYS, 0.6, (math.nan, 0.0), (0.6, 0.0, 0.0)),
        "duration": (*NO_NUMBERS, math.inf, -1.0, 2**70, 1e300),
        "reference": (*NO_NUMBERS, math.inf),
    }
    each_refused(run_sampled, given, bad)
    wrong = (np.empty(3), np.empty((2, 3)), np.empty((1, 3), np.int64), [[0.0]], None)
    each_refused(LongRun(**run, start=(0.6, 0.0)).fill, {}, {"rows": wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["robots", "controllers", "starts"])
def test_no_runs_are_none(name: str) -> None:
    given = {"robots": [TABLE_1], "controllers": [controller(1.0)], "starts": [(0.6, 0.0)]}
    each_refused(run_many, {**given, "sampling": Sampling(1e-3), "duration": 1.0}, {name: ([], None, 0.6)})
    nothing: dict[str, Any] = {"robots": [], "controllers": [], "starts": []}
    each_refused(run_many, {**nothing, "sampling": Sampling(1e-3), "duration": 1.0}, {"robots": ([],)})

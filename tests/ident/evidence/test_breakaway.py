"""F_s from ramps, with the delay of detection taken out; and starts that are no breakaway."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.breakaway import breakaways
from ident.fit.law_model import Direction
from ident.response import breakaway_delay
from tests.ident.rigs import Rig


@pytest.mark.parametrize("counts", [2000, 20_000, 2**18, 2**20])
@pytest.mark.parametrize("period", [1e-3, 5e-3])
def test_static_torque_of_every_ramp_in_a_log_of_many(counts: int, period: float) -> None:
    rig = Rig(resolution=2 * math.pi / counts, period=period, torque_noise=0.01)
    rates = [0.05, -0.05, 0.2, -0.2, 0.1]
    found = [start for start in breakaways(rig.ramps(rates, np.random.default_rng(1))) if start.why is None]
    assert [start.direction for start in found] == [int(math.copysign(1, rate)) for rate in rates]
    for start, rate in zip(found, rates, strict=True):
        assert start.line.rate == pytest.approx(rate, rel=0.03)
        direction: Direction = "positive" if rate > 0 else "negative"
        delay = breakaway_delay(rig.robot, direction=direction, ramp_rate=abs(rate), travel=start.travel)
        truth = (rig.robot.friction.positive if rate > 0 else rig.robot.friction.negative).static_torque
        assert abs(start.torque) - abs(rate) * delay == pytest.approx(truth, abs=5 * start.line.stderr + 1e-3)


def test_the_delay_matters_for_a_coarse_encoder() -> None:
    rig = Rig(resolution=2 * math.pi / 2000, torque_noise=0.001)
    (start, *_) = breakaways(rig.ramps([0.3], np.random.default_rng(2)))
    assert start.torque > 1.03 * rig.robot.friction.positive.static_torque


@pytest.mark.parametrize("declared", [True, False])
def test_a_ramp_that_ends_at_the_limit_is_censored_and_the_other_direction_stands(declared: bool) -> None:
    rig = Rig(torque_limit=0.55)  # between the two static torques
    recording = rig.ramps([0.2, -0.2, 0.3], np.random.default_rng(3))
    found = breakaways(recording if declared else replace(recording, torque_limit=None))
    assert [(start.direction, start.is_censored) for start in found] == [(1, True), (-1, False), (1, True)]
    for start in found:
        if start.is_censored:
            assert start.torque == pytest.approx(0.55, rel=0.01)
            assert f"F_s >= {start.torque:.4g}" in str(start.why)


def test_a_slow_ramp_is_no_flat_top() -> None:
    recording = Rig(torque_noise=0.02).ramps([0.01], np.random.default_rng(8))
    assert [start.why for start in breakaways(recording)] == [None]


def test_an_encoder_that_drifts_does_not_move_the_onset() -> None:
    rig = Rig(torque_noise=0.005)
    recording = rig.ramps([0.1, -0.1], np.random.default_rng(7))
    count = recording.resolution or 1.0
    drifted = np.round((recording.position + 2e-4 * recording.time) / count) * count
    found = breakaways(replace(recording, position=drifted))
    assert [start.why for start in found] == [None, None]
    directions: tuple[Direction, Direction] = ("positive", "negative")
    for start, direction in zip(found, directions, strict=True):
        delay = breakaway_delay(rig.robot, direction=direction, ramp_rate=0.1, travel=start.travel)
        truth = getattr(rig.robot.friction, direction).static_torque
        assert abs(start.torque) - 0.1 * delay == pytest.approx(truth, rel=0.003)


def test_a_step_of_torque_is_no_breakaway() -> None:
    torque = np.concatenate([np.zeros(1000), np.full(800, 0.8), np.zeros(1500)])
    recording = Rig().torque_driven(torque, np.random.default_rng(4), protocol="breakaway")
    found = breakaways(recording)
    assert found
    assert all(start.why is not None for start in found)


def test_creep_of_a_few_counts_is_no_breakaway() -> None:
    recording = Rig().ramps([0.2], np.random.default_rng(5))
    part = slice(0, int(2.0 / 1e-3))
    ramp = recording.torque[part].copy()
    count = recording.resolution or 0.0
    position = np.round(np.linspace(0, 9, ramp.size) ** 2 / 81 * 9) * count
    creeping = Recording(
        log="creep",
        protocol="breakaway",
        time=recording.time[part].copy(),
        position=position,
        torque=ramp,
        resolution=count,
    )
    found = breakaways(creeping)
    assert [str(start.why)[:7] for start in found] == ["E-CREEP"]


@pytest.mark.parametrize("held", [0.0, 0.5, 1.0])  # part of the creep that stays when the torque is gone
def test_a_ramp_that_is_taken_back_before_the_next_is_creep(held: float) -> None:
    recording = Rig().ramps([0.2], np.random.default_rng(9))
    count, period = recording.resolution or 0.0, recording.sample_period
    ramp = np.concatenate([np.arange(0.0, 0.4, 0.2 * period), np.zeros(500)])
    creep = 8.0 * np.where(np.arange(ramp.size) < ramp.size - 500, (ramp / 0.4) ** 2, held) * count
    position = np.concatenate([np.round(creep / count) * count, recording.position + creep[-1]])
    noise = 0.01 * np.random.default_rng(10).standard_normal(ramp.size)
    torque = np.concatenate([ramp + noise, recording.torque])
    time = period * np.arange(torque.size, dtype=np.float64)
    found = breakaways(replace(recording, time=time, position=position, torque=torque))
    assert [str(start.why)[:7] for start in found] == ["E-CREEP", "None"]


def test_a_ramp_that_is_taken_back_at_once_is_no_flat_top() -> None:
    rig = Rig(torque_noise=0.001)
    up = np.arange(0.0, 0.45, 2e-5)
    torque = np.concatenate([np.zeros(500), up, up[::-1], np.zeros(500)])
    recording = rig.torque_driven(torque, np.random.default_rng(11), protocol="breakaway")
    assert not any(start.is_censored for start in breakaways(replace(recording, torque_limit=None)))


def test_pre_sliding_of_many_fine_counts_is_not_taken_for_the_onset() -> None:
    recording = Rig(resolution=2 * math.pi / 2**20, torque_noise=0.002).ramps([0.1], np.random.default_rng(6))
    smooth = np.convolve(recording.torque, np.full(200, 1 / 200), mode="same")
    sliding = 2e-4 * np.clip(smooth / 0.57, 0.0, 1.0) ** 2
    count = recording.resolution or 1.0
    bent = replace(recording, position=np.round((recording.position + sliding) / count) * count)
    found = [start for start in breakaways(bent) if start.why is None]
    assert len(found) == 1
    assert found[0].torque == pytest.approx(0.5735, rel=0.02)

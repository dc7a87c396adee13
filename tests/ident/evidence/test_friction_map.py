"""Steady runs: slopes for speeds, run-in cut off, and runs that are no steady runs left out by name."""

from __future__ import annotations

import math

import numpy as np
import pytest

from data.recording import FloatArray, Recording
from ident.evidence.friction_map import steady_runs
from tests.ident.rigs import Rig


def _log(position: FloatArray, torque: FloatArray, *, resolution: float = 2e-5) -> Recording:
    counted = np.round(position / resolution) * resolution
    return Recording(
        log="made up",
        protocol="constant_velocity",
        time=np.asarray(1e-3 * np.arange(position.size), dtype=np.float64),
        position=counted,
        torque=torque,
        resolution=resolution,
    )


def test_the_speed_is_the_slope_even_where_differences_are_nearly_all_zero() -> None:
    rig = Rig(resolution=2 * math.pi / 2000)
    (run,) = steady_runs(rig.speeds([0.01], np.random.default_rng(1), duration=12.0))
    assert run.why is None
    assert run.velocity == pytest.approx(0.01, rel=0.02)
    assert abs(run.velocity - 0.01) < 4 * run.velocity_stderr


def test_torque_and_speed_are_those_of_the_law() -> None:
    rig = Rig(torque_noise=0.01)
    speeds = [0.02, 0.2, 2.0, -0.02, -0.2, -2.0]
    found = steady_runs(rig.speeds(speeds, np.random.default_rng(2), duration=3.0))
    for run, speed in zip(found, speeds, strict=True):
        curve = rig.robot.friction.positive if speed > 0 else rig.robot.friction.negative
        truth = math.copysign(float(curve.total(abs(speed))), speed)
        assert run.direction == math.copysign(1, speed)
        assert abs(run.torque - truth) < 5 * run.white_stderr + 1e-4 * abs(truth)


def test_a_run_in_is_cut_off() -> None:
    time = 1e-3 * np.arange(6000)
    velocity = 0.5 * (1 - np.exp(-time / 0.2))
    torque = 0.4 + 0.3 * np.exp(-time / 0.2)
    (run,) = steady_runs(_log(np.cumsum(velocity) * 1e-3, np.asarray(torque, dtype=np.float64)))
    assert run.why is None
    assert run.start_time > 0.4
    assert run.velocity == pytest.approx(0.5, rel=1e-2)
    assert run.torque == pytest.approx(0.4, rel=2e-2)


def test_too_few_counts_withhold_a_run() -> None:
    rig = Rig(resolution=2 * math.pi / 2000)
    (run,) = steady_runs(rig.speeds([0.01], np.random.default_rng(3), duration=3.0))
    assert run.why is not None
    assert run.why.startswith("E-QUANT")


@pytest.mark.parametrize("period", [0.05, 0.4, 2.0])
def test_stick_slip_is_left_out(period: float) -> None:
    time = 1e-3 * np.arange(12_000)
    phase = (time / period) % 1.0
    velocity = np.where(phase < 0.4, 0.0, 0.2 * np.sin(np.pi * (phase - 0.4) / 0.6))
    runs = steady_runs(
        _log(np.asarray(np.cumsum(velocity) * 1e-3), np.asarray(0.5 + 0.05 * phase, dtype=np.float64))
    )
    assert all(run.why is not None for run in runs)
    assert any(run.why is not None and run.why.startswith("E-STICKSLIP") for run in runs)


def test_a_link_that_never_moves_gives_no_run() -> None:
    runs = steady_runs(_log(np.zeros(3000), np.full(3000, 0.2)))
    assert [run.why is None for run in runs] == [False]


def test_two_segments_of_a_drifting_speed_are_corrected_by_its_slope() -> None:
    time = 1e-3 * np.arange(8000)
    velocity = 0.5 * (1 + 0.005 * time)
    (run,) = steady_runs(_log(np.cumsum(velocity) * 1e-3, np.full(time.size, 0.4)))
    assert run.acceleration == pytest.approx(0.0025, rel=0.05)


def test_a_position_that_was_not_updated_is_no_speed() -> None:
    """A frozen stretch in a moving run is never used with a speed of zero."""
    generator = np.random.default_rng(8)
    position = 0.5 * 1e-3 * np.arange(4000)
    for first in (500, 1500, 2900):
        frozen = position.copy()
        frozen[first : first + 1000] = frozen[first]
        log = _log(np.asarray(frozen), 0.4 + 0.005 * generator.standard_normal(4000))
        for run in steady_runs(log):
            assert run.why is not None or abs(run.velocity) * (run.end_time - run.start_time) > 20 * 2e-5

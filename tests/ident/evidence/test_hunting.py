"""A hunting loop is told from a noisy sensor by the momentum that the torque's swing carries."""

from __future__ import annotations

import numpy as np
import pytest

from data.recording import FloatArray, Recording
from ident.evidence.hunting import SAMPLES, hunts, sensor_noise, swing
from ident.evidence.segmentation import Stretch

N = 6000


def _log(torque: FloatArray) -> Recording:
    time = np.asarray(1e-3 * np.arange(N), dtype=np.float64)
    return Recording(
        log="x", protocol="constant_velocity", time=time, position=0.01 * time, torque=torque, resolution=1e-3
    )


def _hunts(torque: FloatArray, noise: float) -> bool:
    found = swing(_log(torque), Stretch(0, N, 6.0, 0.06))
    return hunts(found, speed=0.01, torque=0.4, inertia=0.026, noise=noise)


def test_white_noise_carries_the_momentum_that_it_is_said_to() -> None:
    noise = 0.02 * np.random.default_rng(1).standard_normal(N)
    found = swing(_log(0.4 + noise), Stretch(0, N, 6.0, 0.06))
    assert found.momentum == pytest.approx(0.02**2 * 1e-6 * SAMPLES / 6, rel=0.2)
    assert sensor_noise([0.4 + noise]) == pytest.approx(0.02, rel=0.05)


def test_a_noisy_sensor_does_not_hunt() -> None:
    noise = 0.02 * np.random.default_rng(2).standard_normal(N)
    assert not _hunts(0.4 + noise, 0.02)


def test_a_torque_that_kicks_hard_enough_to_stop_the_link_hunts() -> None:
    kicks = 0.3 * np.sign(np.sin(2 * np.pi * 1e-3 * np.arange(N) / 0.02))
    assert _hunts(np.asarray(0.4 + kicks, dtype=np.float64), 0.01)


def test_kicks_too_fast_for_the_inertia_do_not() -> None:
    kicks = 0.1 * (-1.0) ** np.arange(N)
    assert not _hunts(np.asarray(0.4 + kicks, dtype=np.float64), 0.01)

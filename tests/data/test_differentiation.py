"""The smoother against closed forms, across gaps, and its errors against motion drawn from its own model."""

import math

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise, kinematic_state_transition

from data.differentiation import differentiate
from data.findings import LogError

COUNT = 2 * math.pi / 2**18
TIME = np.arange(2000, dtype=np.float64) * 1e-3
INNER = slice(50, -50)


def test_a_parabola_is_exact() -> None:
    motion = differentiate(TIME, 0.3 + 0.5 * TIME - 2.0 * TIME**2, resolution=None)
    assert np.allclose(motion.velocity, 0.5 - 4.0 * TIME, atol=1e-7)
    assert np.allclose(motion.acceleration, -4.0, atol=1e-4)


@pytest.mark.parametrize("jitter", [0.0, 3e-4])
def test_a_quantised_sine_within_its_errors(jitter: float) -> None:
    time = TIME + np.random.default_rng(0).uniform(-jitter, jitter, TIME.size)
    position = np.rint(np.sin(5 * time) / COUNT) * COUNT
    motion = differentiate(time, position, resolution=COUNT)
    error = np.abs(motion.velocity - 5 * np.cos(5 * time))[INNER]
    assert np.sqrt(np.mean(error**2)) < 1e-3
    assert np.mean(error < 1.96 * motion.velocity_stderr[INNER]) > 0.9
    bend = np.abs(motion.acceleration + 25 * np.sin(5 * time))[INNER]
    assert np.mean(bend < 1.96 * motion.acceleration_stderr[INNER]) > 0.9


def test_white_jerk_is_covered_at_the_nominal_rate() -> None:
    """Motion drawn from the model itself: 95 % intervals hold the truth in 95 % of the samples."""
    rng = np.random.default_rng(4)
    step, noise = 1e-3, 1e-5
    root = np.linalg.cholesky(Q_continuous_white_noise(3, dt=step, spectral_density=200.0))
    move = kinematic_state_transition(2, step)
    states = np.zeros((TIME.size, 3))
    for k in range(1, TIME.size):
        states[k] = move @ states[k - 1] + root @ rng.normal(size=3)
    position = states[:, 0] + rng.normal(0, noise, TIME.size)
    motion = differentiate(TIME, position, resolution=noise * math.sqrt(12))
    for found, error, truth in (
        (motion.velocity, motion.velocity_stderr, states[:, 1]),
        (motion.acceleration, motion.acceleration_stderr, states[:, 2]),
    ):
        inside = np.abs(found - truth)[INNER] < 1.96 * error[INNER]
        assert 0.90 < inside.mean() < 0.99


def test_the_noise_is_found_where_no_count_is_known() -> None:
    rng = np.random.default_rng(1)
    position = np.sin(5 * TIME) + rng.normal(0, 1e-4, TIME.size)
    motion = differentiate(TIME, position, resolution=None)
    error = (motion.velocity - 5 * np.cos(5 * TIME))[INNER]
    assert np.sqrt(np.mean(error**2)) < 5e-3


def test_nothing_is_differentiated_across_a_gap() -> None:
    before, after = TIME[:500], TIME[:600] + 5.0
    time = np.concatenate((before, [2.0], after))
    position = np.concatenate((1.0 * before, [50.0], 100.0 - 2.0 * after))
    motion = differentiate(time, position, resolution=None)
    assert np.allclose(motion.velocity[:500], 1.0, atol=1e-5)
    assert np.isnan(motion.velocity[500])
    assert np.isnan(motion.velocity_stderr[500])
    assert np.allclose(motion.velocity[501:], -2.0, atol=1e-5)


def test_units_of_time_and_position_only_scale_the_result() -> None:
    position = np.rint(np.sin(5 * TIME) / COUNT) * COUNT
    one = differentiate(TIME, position, resolution=COUNT)
    other = differentiate(TIME * 1e3, position * 180 / math.pi, resolution=COUNT * 180 / math.pi)
    assert np.allclose(other.velocity, one.velocity * 180 / math.pi / 1e3, rtol=1e-6, atol=1e-9)
    assert np.allclose(other.velocity_stderr, one.velocity_stderr * 180 / math.pi / 1e3, rtol=1e-4)


def test_what_cannot_be_differentiated() -> None:
    for time, position in (
        (TIME[:3], TIME[:3]),
        (TIME[:9], TIME[:8]),
        (-TIME[:9], TIME[:9]),
        (TIME[:9], TIME[:9] * np.nan),
    ):
        with pytest.raises(LogError):
            differentiate(time, position, resolution=None)

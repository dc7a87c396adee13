"""The compiled smoother against filterpy, sample by sample, and against the posterior solved in one piece."""

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise, kinematic_kf, kinematic_state_transition

from data.kinematic_smoother import FloatArray, smooth


def drawn(samples: int, *, even: bool, seed: int) -> tuple[FloatArray, FloatArray]:
    generator = np.random.default_rng(seed)
    steps = np.ones(samples - 1) if even else generator.uniform(0.4, 2.5, samples - 1)
    time = np.concatenate(([0.0], np.cumsum(steps)))
    return steps, np.asarray(500.0 * np.sin(0.02 * time) + generator.normal(size=samples))


def by_filterpy(
    steps: FloatArray, position: FloatArray, density: float, start: FloatArray, doubt: FloatArray
) -> FloatArray:
    model = kinematic_kf(dim=1, order=2, dt=1.0)
    model.x, model.P = start[:, None], doubt
    spans = [0.0, *steps.tolist()]  # it predicts before each measurement: the first goes nowhere
    moves = [kinematic_state_transition(2, h) for h in spans]
    drives = [Q_continuous_white_noise(3, dt=h, spectral_density=density) for h in spans]
    means, spreads, _, _ = model.batch_filter(position, Fs=moves, Qs=drives)
    states, smoothed, _, _ = model.rts_smoother(means, spreads, Fs=moves, Qs=drives)
    roots = np.sqrt(smoothed[:, [1, 2], [1, 2]])
    return np.stack((states[:, 1, 0], states[:, 2, 0], roots[:, 0], roots[:, 1]))


def in_one_piece(
    steps: FloatArray, position: FloatArray, density: float, start: FloatArray, doubt: FloatArray
) -> FloatArray:
    """All states at once: the normal equations of prior, motion and measurements."""
    samples = position.size
    information, pull = np.zeros((3 * samples, 3 * samples)), np.zeros(3 * samples)
    information[:3, :3] += np.linalg.inv(doubt)
    pull[:3] += np.linalg.solve(doubt, start)
    for k in range(samples):
        information[3 * k, 3 * k] += 1.0
        pull[3 * k] += position[k]
    for k, step in enumerate(steps.tolist()):
        moved = np.hstack((-np.asarray(kinematic_state_transition(2, step)), np.eye(3)))
        weight = np.linalg.inv(Q_continuous_white_noise(3, dt=step, spectral_density=density))
        part = slice(3 * k, 3 * k + 6)
        information[part, part] += moved.T @ weight @ moved
    spread = np.linalg.inv(information)
    state, error = spread @ pull, np.sqrt(np.diag(spread))
    return np.stack((state[1::3], state[2::3], error[1::3], error[2::3]))


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("density", [1e-4, 1e-2, 10.0])
def test_it_is_filterpys_recursion(density: float, even: bool) -> None:
    steps, position = drawn(1500, even=even, seed=3)
    start, doubt = np.array([position[0], 10.0, 0.0]), np.diag([1e3, 1e3, 1e1])
    found = smooth(steps, even, position, density, start, doubt)
    expected = by_filterpy(steps, position, density, start, doubt)
    scale = np.max(np.abs(expected), axis=1, keepdims=True)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-8)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("density", [1e-3, 1.0])
def test_it_is_the_posterior(density: float, even: bool) -> None:
    steps, position = drawn(60, even=even, seed=4)
    start, doubt = np.array([position[0], 10.0, 0.0]), np.diag([10.0, 10.0, 1.0])
    found = smooth(steps, even, position, density, start, doubt)
    np.testing.assert_allclose(
        found, in_one_piece(steps, position, density, start, doubt), rtol=1e-6, atol=1e-8
    )


def test_constant_gains_are_those_of_the_full_recursion() -> None:
    steps, position = drawn(5000, even=True, seed=5)
    start, doubt = np.array([position[0], 10.0, 0.0]), np.diag([1e4, 1e3, 1e2])
    settled = smooth(steps, True, position, 1e-6, start, doubt)
    np.testing.assert_allclose(
        settled, smooth(steps, False, position, 1e-6, start, doubt), rtol=1e-8, atol=1e-9
    )


@pytest.mark.parametrize("even", [True, False])
def test_two_samples_are_enough(even: bool) -> None:
    start, doubt = np.zeros(3), np.eye(3)
    found = smooth(np.ones(1), even, np.array([0.0, 1.0]), 1.0, start, doubt)
    np.testing.assert_allclose(
        found, by_filterpy(np.ones(1), np.array([0.0, 1.0]), 1.0, start, doubt), rtol=1e-10
    )

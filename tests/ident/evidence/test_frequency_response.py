"""The inertia from torque to position: exact hold, delay, both kinds of noise, periodic or not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from data.recording import FloatArray, Recording
from ident.evidence.frequency_response import _impedance, frequency_inertia, response_fit
from tests.ident.rigs import Rig, multisine

J = 0.026
BIAS = 3.0


def _bias(rig: Rig) -> float:
    return float(rig.robot.friction.positive.total(BIAS))


def _multisine_log(rig: Rig, seed: int, *, delay: int = 0, periods: int = 8) -> Recording:
    generator = np.random.default_rng(seed)
    wave = multisine(length=2000, amplitude=0.15, lines=range(2, 120, 3), generator=generator)
    torque = _bias(rig) + np.tile(wave, periods)
    return rig.torque_driven(torque, generator, log=f"log {seed}", speed=BIAS, delay=delay)


def test_the_impedance_is_the_inverse_of_the_held_and_sampled_link() -> None:
    b, h = 0.3, 0.01
    # eq (1) with the state (q, v), held over h: the matrix exponential of the state and its input.
    block = expm(h * np.array([[0.0, 1.0, 0.0], [0.0, -b / J, 1 / J], [0.0, 0.0, 0.0]]))
    angle = np.linspace(0.05, 3.0, 40)
    z = np.exp(1j * angle)
    response = np.array([np.linalg.solve(step * np.eye(2) - block[:2, :2], block[:2, 2])[0] for step in z])
    np.testing.assert_allclose(_impedance(angle, J, b, h), 1 / response, rtol=1e-8)


@pytest.mark.parametrize("delay", [0, 3])
@pytest.mark.parametrize("counts", [20_000, 2**18])
def test_inertia_and_delay_from_a_multisine(delay: int, counts: int) -> None:
    rig = Rig(ripple=0.004, resolution=2 * math.pi / counts)
    result, _ = frequency_inertia([_multisine_log(rig, seed, delay=delay) for seed in range(3)])
    assert result is not None
    assert result.inertia == pytest.approx(J, rel=0.003)
    assert abs(result.inertia - J) < 4 * result.stderr
    for fit in result.fits:
        assert fit.delay == pytest.approx(delay * 1e-3, abs=2e-4)
        assert fit.bias_speed == pytest.approx(BIAS, rel=0.02)
        assert 0 < fit.lowest_speed < BIAS
        assert fit.damping == pytest.approx(0.0828, rel=0.1)


def _chirp(n: int) -> FloatArray:
    t = 1e-3 * np.arange(n)
    return 0.2 * np.sin(2 * np.pi * (0.5 * t + 59.5 / (2e-3 * n) * t**2))


def _held_noise(n: int) -> FloatArray:
    return np.repeat(0.2 * np.random.default_rng(9).standard_normal(n // 10), 10)


@pytest.mark.parametrize("excitation", [_chirp, _held_noise])
def test_inertia_from_an_excitation_that_never_repeats(excitation: object) -> None:
    assert callable(excitation)
    rig = Rig(ripple=0.004)
    torque = _bias(rig) + excitation(16_000)
    fit = response_fit(rig.torque_driven(torque, np.random.default_rng(2), speed=BIAS, delay=1))
    assert not isinstance(fit, str)
    assert fit[0].inertia == pytest.approx(J, rel=0.004)
    assert fit[0].delay == pytest.approx(1e-3, abs=2e-4)


def test_a_single_realisation_that_starts_from_rest_is_enough() -> None:
    rig = Rig()
    start = np.full(3000, _bias(rig) + 0.1)
    generator = np.random.default_rng(3)
    wave = multisine(length=2000, amplitude=0.1, lines=range(2, 100, 3), generator=generator)
    torque = np.concatenate([start, _bias(rig) + np.tile(wave, 5)])
    fit = response_fit(rig.torque_driven(torque, generator, speed=0.0))
    assert not isinstance(fit, str)
    assert fit[0].inertia == pytest.approx(J, rel=0.005)


def test_a_link_at_rest_is_refused_in_words() -> None:
    rig = Rig()
    answer = response_fit(rig.torque_driven(np.zeros(4000), np.random.default_rng(4)))
    assert isinstance(answer, str)

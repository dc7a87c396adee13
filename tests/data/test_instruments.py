"""What sensors make of the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from data.findings import LogError
from data.instruments import Encoder, TorqueChannel

POSITIONS = arrays(np.float64, 20, elements=st.floats(-50, 50))


@given(POSITIONS, st.integers(100, 2**20))
def test_an_encoder_gives_whole_counts_within_half_a_count(position: np.ndarray, counts: int) -> None:
    encoder = Encoder(2 * math.pi / counts)
    measured = encoder.measure(position)
    assert np.all(np.abs(measured - position) <= 0.5 * encoder.resolution * (1 + 1e-9))
    np.testing.assert_array_equal(encoder.measure(measured), measured)
    np.testing.assert_array_equal(encoder.counts(position), np.rint(position / encoder.resolution))


def test_an_ideal_encoder_measures_the_truth() -> None:
    truth = np.array([0.1, -0.2])
    np.testing.assert_array_equal(Encoder(0.0).measure(truth), truth)
    with pytest.raises(LogError, match="no counts"):
        Encoder(0.0).counts(truth)


def test_torque_noise_is_white_with_the_given_deviation() -> None:
    truth = np.sin(np.arange(40_000) * 0.01)
    noise = TorqueChannel(noise=0.01, offset=0.1).measure(truth, np.random.default_rng(7)) - truth - 0.1
    assert abs(noise.mean()) < 4 * 0.01 / 200
    assert noise.std() == pytest.approx(0.01, rel=0.02)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.02


def test_a_late_torque_is_the_earlier_one() -> None:
    truth = np.arange(5.0)
    generator = np.random.default_rng(1)
    np.testing.assert_array_equal(TorqueChannel(delay=2).measure(truth, generator), [0, 0, 0, 1, 2])
    np.testing.assert_array_equal(TorqueChannel(delay=9).measure(truth, generator), np.zeros(5))


def test_a_converter_gives_whole_steps() -> None:
    truth = np.linspace(-1, 1, 101)
    logged = TorqueChannel(resolution=2**-6).measure(truth, np.random.default_rng(1))
    np.testing.assert_array_equal(logged * 64, np.rint(truth * 64))


def test_the_same_seed_gives_the_same_log() -> None:
    channel, truth = TorqueChannel(noise=0.1), np.zeros(10)
    first, second = (channel.measure(truth, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_refuses_impossible_instruments() -> None:
    for broken in (-1.0, math.nan):
        with pytest.raises(LogError):
            Encoder(broken)
        with pytest.raises(LogError):
            TorqueChannel(noise=broken)
        with pytest.raises(LogError):
            TorqueChannel(resolution=broken)
    with pytest.raises(LogError, match="delay"):
        TorqueChannel(delay=-1)

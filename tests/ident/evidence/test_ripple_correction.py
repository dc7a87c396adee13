"""Waves taken out of the evidence: the means of runs, and the scatter that is left."""

from __future__ import annotations

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.friction_map import steady_runs
from ident.evidence.position_ripple import Wave
from ident.evidence.ripple_correction import corrected_runs, without_wave_scatter

SPEED, PERIOD, TORQUE, AMPLITUDE, NOISE = 0.2, 1e-3, 1.5, 0.3, 0.01


def _recording(*, amplitude: float) -> Recording:
    generator = np.random.default_rng(5)
    time = PERIOD * np.arange(20_000, dtype=np.float64)
    position = SPEED * time
    torque = TORQUE + amplitude * np.cos(7.0 * position) + NOISE * generator.standard_normal(time.size)
    return Recording("steady", "constant_velocity", time, position, torque, resolution=1e-6)


def _wave(*, coherent: bool) -> Wave:
    known = {1: np.array([AMPLITUDE, 0.0]), -1: np.array([AMPLITUDE, 0.0])}
    exact = {1: np.zeros((2, 2)), -1: np.zeros((2, 2))}
    return Wave(7.0, 0.0, 0.0, known, exact, AMPLITUDE, coherent)


def test_a_wave_that_is_taken_out_counts_neither_in_the_mean_nor_in_the_scatter() -> None:
    rippled, smooth = _recording(amplitude=AMPLITUDE), _recording(amplitude=0.0)
    (run,), (bare,) = steady_runs(rippled), steady_runs(smooth)
    assert run.block_ratio > 100.0
    assert bare.block_ratio < 3.0
    waves = [_wave(coherent=True)]
    (freed,) = corrected_runs([rippled], without_wave_scatter([rippled], [run], waves), waves)
    assert freed.torque == pytest.approx(TORQUE, abs=5.0 * bare.white_stderr)
    assert freed.white_stderr == pytest.approx(bare.white_stderr, rel=0.02)
    assert freed.block_ratio < 3.0


def test_a_wave_of_unknown_phase_stays_in_the_scatter() -> None:
    rippled = _recording(amplitude=AMPLITUDE)
    runs = steady_runs(rippled)
    assert without_wave_scatter([rippled], runs, [_wave(coherent=False)]) == runs

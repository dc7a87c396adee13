"""The compiled sums are those of the waves written out."""

from __future__ import annotations

import numpy as np
import pytest

from ident.evidence.wave_sums import wave_sums


@pytest.mark.parametrize("spacing", ["equal", "any"])
def test_sums_are_those_of_the_waves_written_out(spacing: str) -> None:
    generator = np.random.default_rng(3)
    position = np.cumsum(generator.uniform(0.01, 0.02, 250)) - 7.0
    torque = generator.normal(size=250)
    smooth, _ = np.linalg.qr(np.column_stack((np.ones(250), np.arange(250.0))))
    grid = 0.7 + 0.05 * np.arange(400, dtype=np.float64)
    if spacing == "any":
        grid = generator.uniform(0.5, 40.0, 50)
    got = wave_sums(grid, position=position, torque=torque, smooth=smooth, stride=0.015)
    waves = np.stack((np.cos(np.outer(position, grid)), np.sin(np.outer(position, grid))), axis=1)
    waves *= np.sinc(0.5 * 0.015 * grid / np.pi)
    waves -= np.einsum("ms,ns,nxw->mxw", smooth, smooth, waves, optimize=True)
    assert np.allclose(got[0], np.einsum("mxw,m->wx", waves, torque), rtol=0, atol=1e-9)
    assert np.allclose(got[1], np.einsum("mxw,myw->wxy", waves, waves), rtol=0, atol=1e-9)

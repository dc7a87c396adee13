"""The compiled filter and smoother beside filterpy's, on one recording of 100,000 samples."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from filterpy.common import Q_continuous_white_noise, kinematic_kf
from numpy.typing import NDArray

from benchmarks.rows import Row, against, in_turns
from data.kinematic_smoother import smooth

SAMPLES: Final = 100_000
DENSITY: Final = 1e-4  # of the jerk, where the noise and the step are 1
ROUNDS: Final = 3


def rows(quick: bool) -> list[Row]:
    """Time of the filter and the smoother over the same positions, and their largest difference."""
    samples = SAMPLES // 20 if quick else SAMPLES
    time = np.arange(samples, dtype=np.float64)
    position = 1e3 * np.sin(0.01 * time) + np.random.default_rng(1).normal(size=samples)
    steps = np.ones(samples - 1)
    start, doubt = np.array([position[0], 10.0, 0.0]), np.diag([100.0, 100.0, 1.0])

    def ours() -> NDArray[np.float64]:
        return smooth(steps, True, position, DENSITY, start, doubt)

    def full() -> NDArray[np.float64]:
        return smooth(steps, False, position, DENSITY, start, doubt)

    def peer() -> NDArray[np.float64]:
        model: Any = kinematic_kf(dim=1, order=2, dt=1.0)
        model.Q = Q_continuous_white_noise(3, dt=1.0, spectral_density=DENSITY)
        back = np.array([[1.0, -1.0, 0.5], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
        model.x = back @ start[:, None]  # its first prediction undoes this
        model.P = back @ (doubt - model.Q) @ back.T
        means, spreads, _, _ = model.batch_filter(position)
        states, smoothed, _, _ = model.rts_smoother(means, spreads)
        roots = np.sqrt(smoothed[:, [1, 2], [1, 2]])
        return np.stack((states[:, 1, 0], states[:, 2, 0], roots[:, 0], roots[:, 1]))

    reference = peer()
    scale = np.max(np.abs(reference), axis=1, keepdims=True)
    taken = in_turns((ours, full, peer), rounds=1 if quick else ROUNDS, repeats=(10, 1, 1))
    found = []
    for case, run, cost in (("equal steps", ours, taken[0]), ("any steps", full, taken[1])):
        error = float(np.max(np.abs(run() - reference) / scale))
        found.append(
            against(
                f"smoother, {samples} samples, {case}",
                "filterpy",
                1e3 * cost,
                1e3 * taken[2],
                error_ours=error,
                error_peer=0.0,
                unit="ms",
            )
        )
    return found

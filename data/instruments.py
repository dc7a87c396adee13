"""What a sensor makes of the truth: true signals in, measured arrays out.

A virtual rig is cut here. What the robot does is the loop's affair; what an encoder and a torque channel
report of it is a matter of measuring, the same for any rig: positions come in whole counts, torques with
noise and late.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from data.findings import LogError
from data.recording import FloatArray


@dataclass(frozen=True)
class Encoder:
    """An incremental encoder: positions in whole counts, to the nearest. Raises `LogError` below 0."""

    resolution: float  # one count [rad]; 0: ideal

    def __post_init__(self) -> None:
        if not (math.isfinite(self.resolution) and self.resolution >= 0):
            raise LogError(f"encoder resolution is {self.resolution} rad a count: it must be finite, >= 0")

    def counts(self, position: FloatArray) -> FloatArray:
        """Whole counts (n,) at true positions (n,) [rad]; of an ideal encoder, raises `LogError`."""
        if self.resolution == 0.0:
            raise LogError("an ideal encoder has no counts: give it a resolution")
        return np.rint(position / self.resolution)

    def measure(self, position: FloatArray) -> FloatArray:
        """Measured positions (n,) [rad] of true ones (n,) [rad]."""
        return position.copy() if self.resolution == 0.0 else self.counts(position) * self.resolution


@dataclass(frozen=True)
class TorqueChannel:
    """What a log calls the torque: the motor's, with white noise, late by whole samples, in whole steps.

    Raises `LogError` for a negative noise, delay or resolution.
    """

    noise: float = 0.0  # standard deviation [N m]
    delay: int = 0  # samples
    offset: float = 0.0  # constant [N m]
    resolution: float = 0.0  # one step of the converter [N m]; 0: continuous

    def __post_init__(self) -> None:
        if not (math.isfinite(self.noise) and self.noise >= 0) or not math.isfinite(self.offset):
            raise LogError(
                f"torque noise {self.noise} and offset {self.offset} N m must be finite, noise >= 0"
            )
        if not (math.isfinite(self.resolution) and self.resolution >= 0):
            raise LogError(f"torque resolution is {self.resolution} N m: it must be finite, >= 0")
        if self.delay < 0:
            raise LogError(f"torque delay is {self.delay} samples: it must be >= 0")

    def measure(self, torque: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Logged torques (n,) [N m] of the motor's (n,) [N m]; the first value stands where none has
        arrived.
        """
        late = np.concatenate((np.full(min(self.delay, torque.size), torque[:1]), torque))[: torque.size]
        analog = late + self.offset + self.noise * generator.standard_normal(torque.size)
        return analog if self.resolution == 0.0 else np.rint(analog / self.resolution) * self.resolution

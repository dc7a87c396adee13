"""One run of a rig, as it was measured: time, position and torque, SI units, with where it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, LogError
from data.protocols import ProtocolName

FloatArray = NDArray[np.float64]
Axis = Literal["rotary", "linear"]
_NOTHING: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class Recording:
    """One run. On a linear axis m, N, N s/m stand where rad, N m, N m s/rad do.

    `time` is strictly increasing; all arrays are (n,), finite, n >= 2, and read-only.
    """

    log: str  # the file, as the campaign names it (posix, relative to it)
    protocol: ProtocolName
    time: FloatArray  # (n,) [s], from the log's first sample
    position: FloatArray  # (n,) [rad]
    torque: FloatArray  # (n,) [N m]
    velocity: FloatArray | None = None  # (n,) [rad/s], checked against the position, never trusted over it
    reference: FloatArray | None = None  # (n,) q_r [rad]; None: 0
    resolution: float | None = None  # one encoder count [rad]; None: unknown
    torque_limit: float | None = None  # [N m]
    axis: Axis = "rotary"
    begun: float | None = None  # when the log's clock starts, from 1970 [s]; None: it does not say
    simulated: bool = False  # written by a virtual rig
    sha256: str = ""
    metadata: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    findings: tuple[Finding, ...] = ()  # what the reader and the screening saw
    breaks: tuple[int, ...] = ()  # samples at which another part begins: how long it took is not known

    def __post_init__(self) -> None:
        n = self.time.size
        if n < 2:
            raise LogError(f"{self.log}: {n} samples; a run needs at least 2. Record it again or exclude it.")
        signals = {"time": self.time, "position": self.position, "torque": self.torque}
        signals |= {
            name: array
            for name, array in (("velocity", self.velocity), ("reference", self.reference))
            if array is not None
        }
        for name, array in signals.items():
            if array.shape != (n,):
                raise LogError(f"{self.log}: {name} has shape {array.shape}, time has ({n},)")
            if not np.all(np.isfinite(array)):
                where = int(np.flatnonzero(~np.isfinite(array))[0])
                raise LogError(
                    f"{self.log}: {name} is {array[where]} at sample {where} (t = {self.time[where]:g} s); "
                    "nothing can be estimated across it. Cut it off with `window`, or exclude the log."
                )
            array.setflags(write=False)
        step = np.diff(self.time)
        if np.any(step <= 0):
            where = int(np.flatnonzero(step <= 0)[0])
            raise LogError(
                f"{self.log}: the clock does not advance at sample {where + 1}: "
                f"{self.time[where]:.9g} s, then {self.time[where + 1]:.9g} s (E-CLOCK)"
            )

    def parts(self) -> tuple[Recording, ...]:
        """The run taken apart at its breaks: itself where it has none."""
        if not self.breaks:
            return (self,)
        return tuple(
            replace(
                self,
                time=self.time[first:past],
                position=self.position[first:past],
                torque=self.torque[first:past],
                velocity=None if self.velocity is None else self.velocity[first:past],
                reference=None if self.reference is None else self.reference[first:past],
                breaks=(),
            )
            for first, past in pairwise((0, *self.breaks, self.time.size))
        )

    @property
    def sample_period(self) -> float:
        """Median time between samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1] - self.time[0])

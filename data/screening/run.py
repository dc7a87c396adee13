"""A run in SI as it is screened, and how a finding of it is made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, Severity
from data.protocols import ProtocolName

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class Run:
    """One run in SI as it is screened; arrays are (n,)."""

    log: str
    protocol: ProtocolName
    time: FloatArray  # [s]
    position: FloatArray  # [rad]
    torque: FloatArray  # [N m]
    velocity: FloatArray | None  # [rad/s]
    reference: FloatArray | None  # [rad]
    breaks: tuple[int, ...] = ()  # samples at which another part of the run begins: nothing joins them

    def named(self) -> dict[str, FloatArray]:
        """The signals that are there, by name."""
        pairs = {
            "position": self.position,
            "torque": self.torque,
            "velocity": self.velocity,
            "reference": self.reference,
        }
        return {name: array for name, array in pairs.items() if array is not None}

    def keep(self, samples: BoolArray) -> Run:
        """The same run with some samples only."""
        before = np.concatenate(([0], np.cumsum(samples)))
        places = sorted({int(before[k]) for k in self.breaks})
        breaks = tuple(place for place in places if 0 < place < before[-1])
        return replace(self.taken(np.flatnonzero(samples)), breaks=breaks)

    def taken(self, samples: IndexArray) -> Run:
        """Samples by number, in their order, as one part."""
        return replace(
            self,
            time=self.time[samples],
            position=self.position[samples],
            torque=self.torque[samples],
            velocity=None if self.velocity is None else self.velocity[samples],
            reference=None if self.reference is None else self.reference[samples],
            breaks=(),
        )


def warning(code: str, text: str, run: Run) -> Finding:
    """A finding with which the run may be used."""
    return Finding(code, Severity.WARN, text, run.log)

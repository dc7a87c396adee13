"""What an integration hands on: states at the times asked for, the events between, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass

from ident.simulation.filippov_system import FloatArray


@dataclass(frozen=True)
class Event:
    """An instant at which the state reached a switching surface, or left one on which it slid."""

    time: float  # [s]
    kind: str
    state: FloatArray  # (n,) on the surface [units of the system]


@dataclass(frozen=True)
class Trajectory:
    """A solution of a Filippov system."""

    time: FloatArray  # (k,) [s]
    state: FloatArray  # (k, n) [units of the system]
    events: tuple[Event, ...]
    end_reason: str  # "time reached", "equilibrium" or "step limit"
    end_time: float  # [s] of an equilibrium: since when the state slides for good
    end_state: FloatArray  # (n,) [units of the system]; of an equilibrium: where the state tends to

"""What an integration hands on: states at the times asked for, the events between, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ident.simulation.filippov_system import FloatArray, Signs


@dataclass(frozen=True)
class Event:
    """An instant at which the state reached a switching surface, or left one on which it slid."""

    time: float  # [s]
    kind: str
    state: FloatArray  # (n,) on the surface [units of the system]


@dataclass(frozen=True)
class Marks:
    """Events as arrays."""

    times: FloatArray  # (e,) [s]
    kinds: Signs  # (e,) indices into `names`
    states: FloatArray  # (e, n) on the surfaces [units of the system]
    names: tuple[str, ...]


@dataclass(frozen=True)
class Trajectory:
    """A solution of a Filippov system."""

    time: FloatArray  # (k,) [s]
    state: FloatArray  # (k, n) [units of the system]
    marks: Marks  # its events, as arrays
    end_reason: str  # "time reached", "equilibrium" or "step limit"
    end_time: float  # [s] of an equilibrium: since when the state slides for good
    end_state: FloatArray  # (n,) [units of the system]; of an equilibrium: where the state tends to

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Every instant at which a surface was met, in order."""
        marks = self.marks
        return tuple(
            Event(time, marks.names[kind], state)
            for time, kind, state in zip(
                marks.times.tolist(), marks.kinds.tolist(), marks.states, strict=True
            )
        )

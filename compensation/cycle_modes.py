"""Through which modes a cycle goes, when it sticks, and what changes where neighbouring motions part.

The *mode sequence* of a motion is the list of its events, in order: the estimate x2 or the velocity v
changes sign, the link sticks or slips. It changes along a branch of cycles where the motion *grazes* a
surface: touches it between two events. Beyond, an event more or less follows, and may move the next halt
of the link by seconds: the return map jumps there, while its multipliers may be as small as ever.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

from compensation.closed_loop import ClosedLoop, simulate
from compensation.loop_runs import TOUCH
from ident.simulation.filippov_system import FloatArray
from ident.simulation.trajectory import Event

TOLERANCE: Final = 1e-12
SLACK: Final = 1e-6  # of the duration: an event at its very end belongs to it
PARTED: Final = 0.02  # of the duration: events so far apart are no longer the same
SURFACES: Final = {
    "estimate reversal": "x2 = 0",
    "velocity reversal": "v = 0",
    "stick": "v = 0",
    "slip": "v = 0",
}


@dataclass(frozen=True)
class Stick:
    """A phase in which the link rests."""

    begin: float  # [s] after the section
    duration: float  # [s]


def events_of(loop: ClosedLoop, point: FloatArray, duration: float) -> tuple[Event, ...]:
    """Events within `duration` [s] after a halt at `point` = (x1 [rad], x2 [rad/s]), but for mere touches."""
    start = (float(point[0]), float(point[1]), -float(point[1]))
    run = simulate(loop, start, duration=duration * (1.0 + SLACK), times=(), tolerance=TOLERANCE)
    return tuple(event for event in run.events if event.kind != TOUCH)


def mode_sequence(events: tuple[Event, ...]) -> tuple[str, ...]:
    """The kinds of events, in order."""
    return tuple(event.kind for event in events)


def stick_phases(events: tuple[Event, ...], period: float) -> tuple[Stick, ...]:
    """Phases of rest of a cycle whose events, from the section on, these are; period [s]."""
    phases = []
    begin: float | None = 0.0 if events and events[0].kind == "slip" else None
    for event in events:
        if event.kind == "slip" and begin is not None:
            phases.append(Stick(begin, event.time - begin))
        begin = event.time if event.kind == "stick" and event.time < period * (1.0 - SLACK) else None
    return tuple(phases)


def parting(one: tuple[Event, ...], other: tuple[Event, ...], duration: float) -> str | None:
    """How two motions of neighbouring starts part within `duration` [s], None where they do not."""
    for here, there in zip_longest(one, other):
        times = [event.time for event in (here, there) if event is not None]
        earlier = here if there is None or (here is not None and here.time <= there.time) else there
        apart = len(times) == 1 or abs(times[0] - times[1]) > PARTED * duration
        if apart or here.kind != there.kind:
            more = "vanishes" if earlier is here else "appears"
            return (
                f"grazes {SURFACES[earlier.kind]} {earlier.time:.4g} s after the section, where an event "
                f"'{earlier.kind}' {more}"
            )
    return None

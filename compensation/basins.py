"""Which starts end where: basins of coexisting attractors, by sampling.

The paper's onset of cycling is a statement about a start: beside the limit cycle the loop may hold rests,
each with a basin of its own. A rectangle of starts is sampled, (x1, v) with the observer at rest (x2 = 0,
x3 = v) as a rig is switched on, and each is followed until it rests for good, which is exact, or cycles.

A rest is labelled by the piece of the equilibrium set in which it lies, a cycle by its extremes. A sample
finds what has a share of the rectangle; an attractor with a smaller one than a cell it may miss.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from compensation.closed_loop import ClosedLoop, simulate
from compensation.equilibria import equilibrium_set
from compensation.loop_parameters import own_time
from compensation.loop_section import LoopSection
from compensation.orbits.periodic_orbits import Cycle, find_cycle
from ident.model.doors import expect
from ident.model.friction import ModelError
from ident.model.numbers import is_count, real_array, shown
from ident.simulation.filippov_system import FloatArray

PATIENCE: Final = 240.0  # times of the loop's own, for which a start is followed
TOLERANCE: Final = 1e-9
SAME: Final = 1e-3  # of the extent: cycles so alike are one
LAST: Final = 6  # halts that must lie on the cycle
UNDECIDED: Final = -1

Kind = Literal["set point", "equilibrium_set", "limit_cycle"]


class Map(Protocol):
    """How to spread the starts: the builtin `map`, or that of an executor."""

    def __call__(
        self, function: Callable[[FloatArray], Attractor | None], items: Iterable[FloatArray], /
    ) -> Iterable[Attractor | None]:
        """The results, in order."""


@dataclass(frozen=True)
class Rectangle:
    """Starts (x1, v) in cells of equal area. Raises `ModelError` for what is no rectangle."""

    x1: tuple[float, float]  # [rad]
    velocity: tuple[float, float]  # [rad/s]
    cells: tuple[int, int]  # along x1, along v

    def __post_init__(self) -> None:
        for name, span in (("x1", self.x1), ("velocity", self.velocity)):
            ends = real_array(span)
            if ends is None or ends.shape != (2,) or not -np.inf < ends[0] < ends[1] < np.inf:
                raise ModelError(
                    f"{name} of the starts is {shown(span)}: an ascending, finite pair (states of eq 8)"
                )
        if np.shape(self.cells) != (2,) or not all(is_count(cell) and cell >= 1 for cell in self.cells):
            raise ModelError(
                f"cells are {shown(self.cells)}: two whole numbers, at least one each way (states of eq 8)"
            )

    @property
    def cell_area(self) -> float:
        """[rad^2/s]."""
        width = (self.x1[1] - self.x1[0]) * (self.velocity[1] - self.velocity[0])
        return width / (self.cells[0] * self.cells[1])

    def starts(self) -> FloatArray:
        """Middles of the cells as states (n, 3); x1 varies fastest."""
        axes = [
            low + (np.arange(count) + 0.5) * (high - low) / count
            for (low, high), count in zip((self.x1, self.velocity), self.cells, strict=True)
        ]
        v, x1 = np.meshgrid(axes[1], axes[0], indexing="ij")
        return np.column_stack([x1.ravel(), np.zeros(x1.size), v.ravel()])


@dataclass(frozen=True)
class Attractor:
    """A piece of the equilibrium set, or a limit cycle."""

    kind: Kind
    x1_min: float  # [rad]
    x1_max: float  # [rad]
    period: float | None = None  # [s]


@dataclass(frozen=True)
class Basins:
    """Attractors, and which start ends at which."""

    attractors: tuple[Attractor, ...]  # the one with the largest basin first
    labels: NDArray[np.int64]  # (n,) index of the attractor, -1 where none was reached in time
    areas: tuple[float, ...]  # of each basin [rad^2/s]
    undecided_area: float  # [rad^2/s]


def basins(
    loop: ClosedLoop,
    starts: Rectangle,
    *,
    duration: float | None = None,
    map: Map = map,
) -> Basins:
    """Where the starts of a rectangle end up, each followed for `duration` [s] at most.

    Without a duration it is some hundred times as long as the loop's slowest time scale.
    """
    expect("loop", loop, ClosedLoop, "eq 8")
    expect("starts", starts, Rectangle, "states of eq 8")
    ends = list(map(partial(where_it_settles, loop, duration=duration), iter(starts.starts())))
    known: list[Attractor] = []
    labels = np.full(len(ends), UNDECIDED, np.int64)
    for index, end in enumerate(ends):
        if end is not None:
            labels[index] = next((k for k, other in enumerate(known) if _same(end, other)), len(known))
            if labels[index] == len(known):
                known.append(end)
    counts = np.bincount(labels[labels >= 0], minlength=len(known))
    order = np.argsort(-counts, kind="stable")
    rank = np.empty(len(known), np.int64)
    rank[order] = np.arange(len(known))
    decided = labels >= 0
    labels[decided] = rank[labels[decided]]
    return Basins(
        attractors=tuple(known[k] for k in order),
        labels=labels,
        areas=tuple(float(counts[k]) * starts.cell_area for k in order),
        undecided_area=float(np.sum(~decided)) * starts.cell_area,
    )


def where_it_settles(
    loop: ClosedLoop, start: FloatArray, *, duration: float | None = None
) -> Attractor | None:
    """The attractor that a start (3,) reaches within `duration` [s], None where it is not settled.

    Without a duration as for `basins`.
    """
    if duration is None:
        duration = PATIENCE * own_time(loop.modes)
    run = simulate(loop, start, duration=duration, times=(), tolerance=TOLERANCE)
    if run.end_reason == "equilibrium":
        return _rest(loop, float(run.end_state[0]))
    halts = [event.state for event in run.events if event.kind in ("stick", "velocity reversal")]
    if len(halts) < LAST:
        return None
    cycle = find_cycle(LoopSection(loop), halts[-1][:2])
    if not isinstance(cycle, Cycle) or not cycle.stable:
        return None
    since = run.end_time - 1.5 * cycle.period
    late = [
        float(event.state[0])
        for event in run.events
        if event.kind in ("stick", "velocity reversal") and event.time >= since
    ]
    low, high = min(late), max(late)
    slack = SAME * (cycle.x1_max - cycle.x1_min)
    for x1_min, x1_max in ((cycle.x1_min, cycle.x1_max), (-cycle.x1_max, -cycle.x1_min)):
        if abs(low - x1_min) <= slack and abs(high - x1_max) <= slack:
            return Attractor("limit_cycle", x1_min, x1_max, cycle.period)
    return None


def _rest(loop: ClosedLoop, x1: float) -> Attractor:
    """The piece of the equilibrium set nearest to a rest x1 [rad]; what touches the set point is one."""
    segments = equilibrium_set(loop.robot, loop.controller).segments
    touching = [segment for segment in segments if segment.touches_zero]
    pieces = [(s.x1_min, s.x1_max) for s in segments if not s.touches_zero]
    pieces.append((min([0.0, *(s.x1_min for s in touching)]), max([0.0, *(s.x1_max for s in touching)])))
    low, high = min(pieces, key=lambda piece: max(piece[0] - x1, x1 - piece[1]))
    return Attractor("equilibrium_set" if low < high else "set point", low, high)


def _same(one: Attractor, other: Attractor) -> bool:
    size = max(one.x1_max - one.x1_min, other.x1_max - other.x1_min)
    apart = max(abs(one.x1_min - other.x1_min), abs(one.x1_max - other.x1_max))
    return one.kind == other.kind and apart <= SAME * size

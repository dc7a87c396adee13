"""How F_s was measured: the breakaways of each direction, their ramp rates, and their spread over places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.evidence.gathering import Evidence
from ident.fit.law_model import DIRECTIONS, SIGN, Direction
from ident.fit.weighting import Weighted, onset_torque


@dataclass(frozen=True)
class BreakawaySummary:
    """The breakaways of one direction; magnitudes."""

    direction: Direction
    used: int
    censored: int  # ended at the torque limit
    torque: tuple[float, float] | None  # least and greatest at the onset, at the rates that they had [N m]
    spread: float | None  # standard deviation of these [N m]
    ramp_rates: tuple[float, float] | None  # slowest and fastest [N m/s]
    places: tuple[float, float] | None  # least and greatest position of rest [rad]


def breakaway_summaries(evidence: Evidence, weighted: Weighted) -> tuple[BreakawaySummary, ...]:
    """One for each direction, those without any breakaway included."""
    found, onset = [], onset_torque(evidence.used_starts, weighted.fit)[0]
    for direction in DIRECTIONS:
        used = [start for start in evidence.used_starts if start.direction == SIGN[direction]]
        torque = onset[weighted.data.start_direction == SIGN[direction]]
        found.append(
            BreakawaySummary(
                direction=direction,
                used=len(used),
                censored=sum(s.is_censored and s.direction == SIGN[direction] for s in evidence.starts),
                torque=_range(list(torque)),
                spread=float(np.std(torque, ddof=1)) if torque.size > 1 else None,
                ramp_rates=_range([abs(start.line.rate) for start in used]),
                places=_range([start.place for start in used]),
            )
        )
    return tuple(found)


def _range(values: list[float]) -> tuple[float, float] | None:
    return (float(min(values)), float(max(values))) if values else None

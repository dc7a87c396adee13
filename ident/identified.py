"""What an identification found, with what it rests on."""

from __future__ import annotations

from dataclasses import dataclass

from ident.estimate import IdentifiedRobot
from ident.evidence.friction_map import MapPoint
from ident.evidence.gathering import Evidence
from ident.fit.breakaway_summary import BreakawaySummary
from ident.fit.weighting import Weighted
from ident.validation.summary import Validation


@dataclass(frozen=True)
class Identification:
    """The identified robot with what it rests on."""

    robot: IdentifiedRobot
    friction_map: tuple[MapPoint, ...]
    fit_report: str  # lmfit's own, the shapes that were compared, the bootstrap, the excitation
    evidence: Evidence  # used or not
    weighted: Weighted | None  # None where the law rests on excitation alone, as of all that follows
    breakaways: tuple[BreakawaySummary, ...]
    validation: Validation | None

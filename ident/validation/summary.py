"""The validation of an identification: what was predicted, and how it compares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from data.recording import Recording
from ident.evidence.gathering import Evidence
from ident.fit.weighting import Weighted
from ident.validation.held_out import CrossValidation, cross_validate
from ident.validation.ramp_motion import RampMotion, predicted_motions


@dataclass(frozen=True)
class Validation:
    """Held-out runs and breakaways, and held-out motion."""

    held_out: CrossValidation
    ramps: tuple[RampMotion, ...]


def validate(recordings: Sequence[Recording], evidence: Evidence, weighted: Weighted) -> Validation:
    """Predict what the fit took, each part from the rest."""
    held_out = cross_validate(recordings, evidence, weighted)
    ramps = predicted_motions(recordings, evidence, held_out)
    return Validation(held_out, ramps)

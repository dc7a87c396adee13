"""What was noticed about a measurement: a code, how grave it is, and a sentence.

The sentence says what was seen (numbers, run, time), what it does to which parameter, and what to do. The
codes (E-GAP, E-STICKSLIP, ...) are the product's; each is explained where it is raised.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """How far a finding reaches."""

    WARN = "warn"  # every number stands, with this said beside it
    WITHHOLD = "withhold"  # a run or a parameter is left out, the rest stands
    REFUSE = "refuse"  # no number at all


@dataclass(frozen=True)
class Finding:
    """One thing that was seen."""

    code: str
    severity: Severity
    text: str
    log: str | None = None  # the log it was seen in, as the campaign names it


class LogError(Exception):
    """A log that cannot be used: the message names the file, the place, the rule, the harm and the remedy."""

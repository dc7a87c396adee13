"""What is assumed of the law before any data are seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ShapeChoice = Literal["fixed", "free", "chosen"]
LawsChoice = Literal["default", "each", "one"]


@dataclass(frozen=True)
class Assumptions:
    """The choices that data do not make by themselves.

    A law for each direction and a constant torque offset cannot both be fitted: moving F_s and F_c up in one
    direction and down in the other is the same as an offset. So it is a law for `each`, without an offset, or
    `one` law for both with an offset; by `default` for each where constant speeds or breakaways were
    recorded, and one where there is nothing but excitation.
    """

    shape: ShapeChoice = "fixed"  # of beta: 1, fitted, or whichever of the two AICc prefers
    laws: LawsChoice = "default"


DEFAULT = Assumptions()

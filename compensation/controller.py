"""The controller: PD law on the observer's estimate and scaled friction compensation, eqs (5)-(6).

    u = u_c + u_fc,   u_c = n1 (q_r - q) - n2 v_hat,   u_fc = r F_f_hat(v_hat)

The controller carries a model of the robot (its `model`): the friction that it compensates, and the b and J
that its observer uses. What the robot really is, it cannot know.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ident.model.friction import ModelError
from ident.model.robot import OneLinkRobot


@dataclass(frozen=True)
class Gains:
    """The four gains of eqs (5)-(7)."""

    proportional: float  # n1 [N m/rad], > 0
    derivative: float  # n2 [N m s/rad], >= 0
    observer: float  # L [1/s], >= 0
    compensation: float  # r [-], >= 0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value) or value < 0:
                raise ModelError(f"{field.name} gain is {value}: a gain is a finite number >= 0 (eqs 5-7)")
        if self.proportional == 0:
            raise ModelError("proportional gain is 0: n1 > 0, or no position is a set point (eq 5)")


@dataclass(frozen=True)
class Controller:
    """Gains and the model that the compensation and the observer use."""

    gains: Gains
    model: OneLinkRobot

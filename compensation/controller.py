"""The controller: PD law on the observer's estimate and scaled friction compensation, eqs (5)-(6).

    u = u_c + u_fc,   u_c = n1 (q_r - q) - n2 v_hat,   u_fc = r F_f_hat(v_hat)

The controller carries a model of the robot (its `model`): the friction that it compensates, and the b and J
that its observer uses. What the robot really is, it cannot know.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

from ident.model.friction import ModelError
from ident.model.numbers import LARGEST, is_one_of, is_quantity, keep_floats, shown
from ident.model.robot import OneLinkRobot

GAIN_OF: Final = {"n1": "proportional", "n2": "derivative", "L": "observer", "r": "compensation"}  # by symbol


@dataclass(frozen=True)
class Gains:
    """The four gains of eqs (5)-(7). Raises `ModelError` for what is no gain."""

    proportional: float  # n1 [N m/rad], > 0
    derivative: float  # n2 [N m s/rad], >= 0
    observer: float  # L [1/s], >= 0
    compensation: float  # r [-], >= 0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (is_quantity(value) and value >= 0):
                raise ModelError(
                    f"{field.name} gain is {shown(value)}: a gain is a finite number >= 0, up to {LARGEST:g} "
                    "(eqs 5-7)"
                )
        if self.proportional == 0:
            raise ModelError("proportional gain is 0: n1 > 0, or no position is a set point (eq 5)")
        keep_floats(self, (field.name for field in fields(self)))


@dataclass(frozen=True)
class Controller:
    """Gains and the model that the compensation and the observer use."""

    gains: Gains
    model: OneLinkRobot

    def __post_init__(self) -> None:
        if not isinstance(self.gains, Gains):
            raise ModelError(f"gains are {self.gains!r}: Gains (eqs 5-7)")
        if not isinstance(self.model, OneLinkRobot):
            raise ModelError(
                f"model is {self.model!r}: the OneLinkRobot that the compensator believes in (eq 6)"
            )


def with_gain(controller: Controller, parameter: str, value: float) -> Controller:
    """The controller with another r [-], L [1/s], n1 [N m/rad] or n2 [N m s/rad].

    Raises `ModelError` for another parameter, or a value that is no gain.
    """
    if not is_one_of(parameter, GAIN_OF):
        raise ModelError(f"parameter is {shown(parameter)}: 'r', 'L', 'n1' or 'n2' (eqs 5-7)")
    return replace(controller, gains=replace(controller.gains, **{GAIN_OF[parameter]: value}))

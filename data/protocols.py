"""What was asked of the rig, and what that identifies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

ProtocolName = Literal["breakaway", "constant_velocity", "frequency_response", "excitation", "set_point"]

IDENTIFIES: Final[dict[ProtocolName, str]] = {
    "breakaway": "the static torque F_s, and the inertia J from the motion after breakaway",
    "constant_velocity": "F_c, v_s, beta and b: the friction at each speed",
    "frequency_response": "the inertia J",
    "excitation": "J, b and F_c from any motion under known torque",
    "set_point": "nothing: the recorded closed loop that a prediction is held against",
}


@dataclass(frozen=True)
class SetPoint:
    """How a set-point run's controller was set, eqs (5)-(7)."""

    proportional_gain: float  # n1 [N m/rad]
    derivative_gain: float  # n2 [N m s/rad]
    observer_gain: float  # L [1/s]
    compensation_gain: float  # r [-]
    sample_period: float | None = None  # [s]; None: the log's own
    observer_update: Literal["euler", "exact"] = "euler"
    delay: int = 0  # samples between measuring and acting

"""How a rig's loop was set: gains, sampling, and the friction model that its controller used.

These values travel from campaign.toml through robot.json to every question that is asked later; a value that
no file gives is None, and the question that needs it says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ident.model.friction import StribeckFriction
from ident.model.robot import OneLinkRobot

ObserverUpdate = Literal["euler", "exact"]
LawChoice = Literal["per-direction", "mean"]


@dataclass(frozen=True)
class Compensator:
    """The friction model in a controller. Where no inertia is given, the observer uses the fitted one."""

    friction: StribeckFriction
    inertia: float | None = None  # J^ of the observer [kg m^2]

    def model(self, fitted: OneLinkRobot) -> OneLinkRobot:
        """What the controller believes the robot to be."""
        return OneLinkRobot(fitted.inertia if self.inertia is None else self.inertia, self.friction)


@dataclass(frozen=True)
class LoopDefaults:
    """The loop of the campaign's set-point runs, as far as one value holds for all of them."""

    proportional: float | None = None  # n1 [N m/rad]
    derivative: float | None = None  # n2 [N m s/rad]
    observer: float | None = None  # L [1/s]
    compensation: float | None = None  # r [-]
    sample_period: float | None = None  # [s]; 0: continuous; None: not given
    resolution: float | None = None  # one encoder count [rad]; None: not given
    observer_update: ObserverUpdate = "euler"
    delay: int = 0  # samples between measuring and acting
    torque_limit: float | None = None  # [N m]
    compensator: Compensator | None = None  # None: the mean of the robot's two directions


def resolution_of(encoder_counts: float, axis: str = "rotary") -> float:
    """One encoder count: 2 pi / counts [rad] on a rotary axis, 1 / counts [m] on a linear one."""
    return (2.0 * math.pi if axis == "rotary" else 1.0) / encoder_counts

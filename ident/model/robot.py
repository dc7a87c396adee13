"""The one-link robot, eq (1): J q'' + b q' = u - F_f(q').

The viscous damping b stands in the curve of each direction, as Table 1 prints it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ident.model.friction import ModelError, StribeckFriction
from ident.model.numbers import LARGEST, is_quantity, keep_floats, shown


@dataclass(frozen=True)
class OneLinkRobot:
    """An inertia under set-valued friction; also what a compensator believes the robot to be.

    Raises `ModelError` for an inertia that nothing can have.
    """

    inertia: float  # J [kg m^2]
    friction: StribeckFriction

    def __post_init__(self) -> None:
        if not (is_quantity(self.inertia) and self.inertia > 0):
            raise ModelError(
                f"inertia is {shown(self.inertia)} kg m^2: a finite J > 0, up to {LARGEST:g} (eq 1)"
            )
        if not isinstance(self.friction, StribeckFriction):
            raise ModelError(f"friction is {self.friction!r}: a StribeckFriction (eqs 2-4)")
        keep_floats(self, ("inertia",))

    def mean(self) -> OneLinkRobot:
        """The symmetric robot with the means of the two directions."""
        return OneLinkRobot(inertia=self.inertia, friction=self.friction.mean())

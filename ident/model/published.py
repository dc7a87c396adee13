"""What van de Wouw, Mallon and Nijmeijer (2004) printed: Table 1, the inertia, the gains of the figures.

Only the two columns are typed. The paper's L_c = 73.07 follows from their unrounded means; the printed
mean column, rounded to four digits, gives 72.99.
"""

from __future__ import annotations

from typing import Final

from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot

INERTIA: Final = 0.026  # J [kg m^2], section 2

POSITIVE: Final = StribeckCurve(  # Table 1, dq/dt > 0
    static_torque=0.5735, coulomb_torque=0.3990, stribeck_velocity=0.0688, viscous_damping=0.0828
)
NEGATIVE: Final = StribeckCurve(  # Table 1, dq/dt < 0
    static_torque=0.5123, coulomb_torque=0.3887, stribeck_velocity=0.0817, viscous_damping=0.0790
)

PROPORTIONAL_GAIN: Final = 0.4  # n1 [N m/rad], figures 4 and 6 to 9
DERIVATIVE_GAIN: Final = 0.02  # n2 [N m s/rad], figures 4 and 6 to 9
OBSERVER_GAIN: Final = 73.5  # L [1/s], figures 7 and 9
LOW_OBSERVER_GAIN: Final = 40.0  # L [1/s], figure 6


def asymmetric_robot() -> OneLinkRobot:
    """Table 1's two columns as one robot."""
    return OneLinkRobot(inertia=INERTIA, friction=StribeckFriction(positive=POSITIVE, negative=NEGATIVE))


def symmetric_robot() -> OneLinkRobot:
    """The robot of the paper's analysis: the unrounded means of Table 1's two columns."""
    return asymmetric_robot().mean()

r"""The set-valued Stribeck law, eqs (2)-(4) of van de Wouw, Mallon and Nijmeijer (2004).

For one direction of motion, at speed s = |v| > 0, the dry friction has the magnitude

    g(s) = F_c + dF exp(-(s / v_s)^beta),    dF = F_s - F_c,                                 eq (3)

and the viscous part adds b s. At rest the friction is whatever balances the applied torque, as long as
that lies in the interval [-F_s(negative), F_s(positive)]: the law is set-valued, and offers an interval
instead of a convention for sign(0). A `StribeckCurve` is one column of Table 1; `StribeckFriction` joins the
curves of the two directions, which real joints do not share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ident.model.numbers import LARGEST, is_number, is_quantity, keep_floats, real_array, shown

STEEPEST_SHAPE: Final = 100.0


class ModelError(ValueError):
    """A model value breaks a rule of the law; the message names the parameter, the rule and its source."""


@dataclass(frozen=True)
class StribeckCurve:
    """Friction of one direction of motion: one column of Table 1.

    Torques are magnitudes. Raises `ModelError` for a value that no friction can have.
    """

    static_torque: float  # F_s [N m]
    coulomb_torque: float  # F_c [N m]
    stribeck_velocity: float  # v_s [rad/s]
    viscous_damping: float  # b [N m s/rad]
    stribeck_shape: float = 1.0  # beta [-]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not is_quantity(value):
                raise ModelError(
                    f"{field.name} is {shown(value)}: a friction parameter is a finite number up to "
                    f"{LARGEST:g} (eq 3)"
                )
        if self.coulomb_torque < 0:
            raise ModelError(f"coulomb_torque is {self.coulomb_torque:g} N m: F_c >= 0 (eq 3)")
        if self.static_torque < self.coulomb_torque:
            raise ModelError(
                f"static_torque {self.static_torque:g} N m is below "
                f"coulomb_torque {self.coulomb_torque:g} N m: F_s >= F_c (eq 3)"
            )
        if self.stribeck_velocity <= 0:
            raise ModelError(f"stribeck_velocity is {self.stribeck_velocity:g} rad/s: v_s > 0 (eq 3)")
        if self.stribeck_shape <= 0:
            raise ModelError(f"stribeck_shape is {self.stribeck_shape:g}: beta > 0 (eq 3)")
        if self.stribeck_shape > STEEPEST_SHAPE:
            raise ModelError(
                f"stribeck_shape is {self.stribeck_shape:g}: beta <= {STEEPEST_SHAPE:g}, above which the "
                "fall at v_s is a jump that no record resolves (eq 3)"
            )
        if self.viscous_damping < 0:
            raise ModelError(f"viscous_damping is {self.viscous_damping:g} N m s/rad: b >= 0 (eq 1)")
        keep_floats(self, (field.name for field in fields(self)))

    @property
    def stribeck_torque(self) -> float:
        """dF = F_s - F_c [N m]."""
        return self.static_torque - self.coulomb_torque

    def dry(self, speed: ArrayLike) -> NDArray[np.float64]:
        """Dry friction magnitude g(s) [N m] at speeds s >= 0 [rad/s], any shape; F_s at 0. Eq (3).

        Raises `ModelError` for what is no speed.
        """
        s = real_array(speed)
        if s is None or not np.all(s >= 0.0):
            raise ModelError(f"speed is {shown(speed)}: a magnitude s >= 0 [rad/s] (eq 3)")
        with np.errstate(over="ignore", under="ignore"):  # (s/v_s)^beta may be infinite: exp(-inf) is 0
            fading = np.exp(-((s / self.stribeck_velocity) ** self.stribeck_shape))
        return self.coulomb_torque + self.stribeck_torque * fading

    def total(self, speed: ArrayLike) -> NDArray[np.float64]:
        """Dry and viscous friction magnitude g(s) + b s [N m] at speeds s >= 0 [rad/s]: figure 2's curve."""
        return self.dry(speed) + self.viscous_damping * np.asarray(speed, dtype=np.float64)

    @property
    def steepest_fall(self) -> float:
        """eta dF / v_s [N m s/rad], the largest -dg/ds over s > 0: -lambda of eqs (12)-(13).

        Infinite for beta < 1 (the slope at 0 is), 0 without a Stribeck effect.
        """
        if self.stribeck_torque == 0.0:
            return 0.0
        return steepest_fall_factor(self.stribeck_shape) * self.stribeck_torque / self.stribeck_velocity


def steepest_fall_factor(shape: float) -> float:
    """eta of eq (13), for a Stribeck shape beta > 0, else `ModelError`; infinite for beta < 1.

    With y = (s / v_s)^beta, -dg/ds = (dF / v_s) beta y^((beta-1)/beta) e^-y peaks at y = (beta-1)/beta.
    """
    if not (is_number(shape) and shape > 0.0):
        raise ModelError(f"shape is {shape!r}: beta > 0 (eq 13)")
    if shape < 1.0:
        return math.inf
    if shape == 1.0:
        return 1.0
    y = (shape - 1.0) / shape
    return float(shape * y**y * math.exp(-y))


@dataclass(frozen=True)
class StribeckFriction:
    """The set-valued law with a curve for each direction of motion, eqs (2)-(4)."""

    positive: StribeckCurve
    negative: StribeckCurve

    def __post_init__(self) -> None:
        for field in fields(self):
            curve = getattr(self, field.name)
            if not isinstance(curve, StribeckCurve):
                raise ModelError(f"{field.name} is {curve!r}: a StribeckCurve for that direction (eqs 2-4)")

    @classmethod
    def symmetric(cls, curve: StribeckCurve) -> StribeckFriction:
        """One curve for both directions, as the paper uses it from section 3 on."""
        return cls(positive=curve, negative=curve)

    def torque_interval(self, velocity: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest dry friction torque [N m] at velocities of any shape [rad/s]. Eqs (2), (4).

        The two agree wherever the link moves; at rest they are (-F_s(negative), F_s(positive)). Raises
        `ModelError` for what is no velocity.
        """
        v = real_array(velocity)
        if v is None or np.any(np.isnan(v)):
            raise ModelError(f"velocity is {shown(velocity)}: real numbers [rad/s] (eqs 2-4)")
        forward, backward = self.positive.dry(np.abs(v)), -self.negative.dry(np.abs(v))
        return np.where(v > 0, forward, backward), np.where(v < 0, backward, forward)

    def mean(self) -> StribeckFriction:
        """The symmetric law whose parameters are the means of the two directions: Table 1's third column."""
        means = {
            field.name: 0.5 * (getattr(self.positive, field.name) + getattr(self.negative, field.name))
            for field in fields(StribeckCurve)
        }
        return StribeckFriction.symmetric(StribeckCurve(**means))

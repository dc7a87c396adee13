"""[virtual_rig]: the true robot, its instruments, and what is played on it. Only `record` and `demo` read it.

Every key may be left out. What is left out is Table 1's robot, or is scaled from the robot that is given, so
that another inertia or friction is played at speeds and ramp rates that show its own Stribeck curve. On a
linear axis m, N, kg, N s/m stand where rad, N m, kg m^2, N m s/rad do.

Keys
----
robot               {inertia, positive = {static_torque, ...}, negative = {...}}; Table 1's two columns
encoder_counts      counts a revolution (a metre); those of [rig], else 2^18
sample_period       [s]; 0.001
torque_noise        standard deviation of the torque channel [N m]; 2 % of the mean F_s
ripple              {amplitude, harmonic, phase}: a torque that depends on the position; none
ramp_rates          of the breakaway ramps [N m/s]; a fifth and three fifths of the mean F_s per second
ramps               in a breakaway log, each from where the last one came to rest; 5
travel              after which a ramp is ended [rad]; what 20 v_s cover in a second
speeds              magnitudes [rad/s], each played in both directions; 14 in ratio from v_s / 15 to 33 v_s
speed_loop          {damping, stiffness, integral, filter}: the speed loop; scaled from the robot
multisine           {bias, lowest, highest, lines, period, periods, realisations, swing}
compensation_gains  r of the set-point runs; 0.8 to 1.3
starts              positions from which each r is run, at rest [rad]; far and near, scaled by F_s / n1
duration            of a set-point run [s]; 19 periods 2 pi sqrt(J / n1), at least 10
json_protocols      protocols whose MCAP logs are JSON, the others being CDR; frequency_response
seed                of the noise and the phases; 1
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from data.protocols import ProtocolName
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot
from ident.model.robot import OneLinkRobot

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Positives = Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)]


class _Table(BaseModel):
    """Strict, frozen, no unknown keys."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")


class TrueCurve(_Table):
    """The friction of one direction, eq (3)."""

    static_torque: Positive  # F_s [N m]
    coulomb_torque: NotNegative  # F_c [N m]
    stribeck_velocity: Positive  # v_s [rad/s]
    viscous_damping: NotNegative  # b [N m s/rad]
    stribeck_shape: Positive = 1.0  # beta [-]

    def curve(self) -> StribeckCurve:
        """The curve; raises `ModelError` where F_s < F_c."""
        return StribeckCurve(**self.model_dump())


class TrueRobot(_Table):
    """The robot that the logs come from."""

    inertia: Positive  # J [kg m^2]
    positive: TrueCurve
    negative: TrueCurve

    @model_validator(mode="after")
    def _admissible(self) -> Self:
        try:
            self.robot()
        except ModelError as broken:
            raise ValueError(str(broken)) from None
        return self

    def robot(self) -> OneLinkRobot:
        """As a value of the model."""
        return OneLinkRobot(self.inertia, StribeckFriction(self.positive.curve(), self.negative.curve()))


class RippleSettings(_Table):
    """A torque amplitude x mean F_c x sin(harmonic x q + phase), on top of the friction."""

    amplitude: Annotated[float, Field(ge=0, lt=1)]  # fraction of the mean F_c [-]
    harmonic: Positive = 12.0  # periods a revolution (a metre on a linear axis)
    phase: Number = 0.0  # [rad]


class SpeedLoopSettings(_Table):
    """u = damping (v_r - v_f) + stiffness e + integral x the integral of e, e = q_r - q, v_f filtered."""

    damping: Positive  # k_d [N m s/rad]
    stiffness: Positive  # k_p [N m/rad]
    integral: Positive  # k_i [N m/(rad s)]
    filter: Positive  # corner of the velocity filter [rad/s]


class MultisineSettings(_Table):
    """A periodic torque of sparse odd lines on a bias speed."""

    bias: Positive | None = None  # [rad/s]; 40 v_s
    lowest: Positive = 1.0  # [Hz]
    highest: Positive = 40.0  # [Hz]
    lines: Annotated[int, Field(ge=3, le=200)] = 20
    period: Positive = 2.0  # [s]
    periods: Annotated[int, Field(ge=2, le=100)] = 4  # in a log
    realisations: Annotated[int, Field(ge=2, le=100)] = 6  # logs, each with other phases
    swing: Annotated[float, Field(gt=0, lt=0.9)] = 0.3  # largest deviation of the speed, part of the bias

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.highest <= self.lowest:
            raise ValueError(f"highest {self.highest:g} Hz is not above lowest {self.lowest:g} Hz")
        if self.lowest * self.period < 1:
            raise ValueError(f"lowest {self.lowest:g} Hz has no whole cycle in a period of {self.period:g} s")
        return self


class VirtualRig(_Table):
    """The whole table; the module's text says what each key means."""

    robot: TrueRobot | None = None
    encoder_counts: Positive | None = None
    sample_period: Annotated[float, Field(ge=1e-5, le=0.05)] = 0.001
    torque_noise: NotNegative | None = None
    ripple: RippleSettings | None = None
    ramp_rates: Positives | None = None
    ramps: Annotated[int, Field(ge=1, le=100)] = 5
    travel: Positive | None = None
    speeds: Positives | None = None
    speed_loop: SpeedLoopSettings | None = None
    multisine: MultisineSettings = MultisineSettings()
    compensation_gains: Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False)] = (
        0.8,
        0.9,
        0.95,
        0.97,
        0.98,
        0.99,
        1.0,
        1.01,
        1.02,
        1.05,
        1.1,
        1.2,
        1.3,
    )
    starts: Annotated[tuple[Number, ...], Field(min_length=1, strict=False)] | None = None
    duration: Annotated[float, Field(gt=0, le=3600)] | None = None
    json_protocols: Annotated[tuple[ProtocolName, ...], Field(strict=False)] = ("frequency_response",)
    seed: Annotated[int, Field(ge=0)] = 1

    @model_validator(mode="after")
    def _sampled(self) -> Self:
        if self.multisine.highest * self.sample_period > 0.4:
            raise ValueError(
                f"multisine.highest {self.multisine.highest:g} Hz is above 0.4 of the sampling rate "
                f"{1 / self.sample_period:g} Hz"
            )
        return self

    def true_robot(self) -> OneLinkRobot:
        """The robot that the logs come from: Table 1's two columns unless one is given."""
        return asymmetric_robot() if self.robot is None else self.robot.robot()

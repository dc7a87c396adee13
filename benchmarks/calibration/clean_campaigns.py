"""Campaigns of rigs of many sizes in which nothing is wrong, before anything has screened them.

A rig is Table 1's, one with both directions alike, a scaled one, or a linear axis. Its encoder has 10^4 to
2^18 counts (scaled with v_s), its torque noise is 0.2 to 2 % of F_c, its sample rate 250 Hz to 4 kHz, but no
slower than the link's time constant J / (dF/v_s - b) asks for. That is 5 to 200 ms, and J follows from it.

Steady speeds are held by the virtual rig's speed loop where the encoder lets it, or are imposed (a loop that
closes on a better sensor than the log's); ramps and multisines are always played on the link.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from data.instruments import Encoder, TorqueChannel
from data.protocols import ProtocolName
from data.recording import Axis, FloatArray
from data.screening.run import Run
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import asymmetric_robot
from ident.model.robot import OneLinkRobot
from ident.response import NO_RIPPLE, TorqueRipple, plant_array
from pipelines.settings.virtual_rig import MultisineSettings, TrueCurve, TrueRobot, VirtualRig
from pipelines.virtual.bench import Bench, Motion, play_ramps, play_speed
from pipelines.virtual.protocols import multisines, speed_loop

LOOP_COUNTS: Final = 2.0**16  # from which the speed loop holds the slowest speeds
LOOP_PERIODS: Final = 10.0  # in J / (dF/v_s - b), from which it does
SPEEDS: Final = 10  # in each direction
SLOWEST: Final = 0.12  # v_s
FASTEST: Final = 30.0  # v_s
RATES: Final = (0.15, 0.45)  # F_s per second, of the ramps


@dataclass(frozen=True)
class Rig:
    """The truth, and what measures it."""

    robot: OneLinkRobot
    axis: Axis
    period: float  # [s]
    resolution: float  # one encoder count [rad]
    noise: float  # standard deviation of the torque [N m]
    declared: bool  # whether the campaign knows the encoder
    torque_limit: float | None  # as declared [N m]
    fine: bool  # whether the speed loop holds the slowest speeds on this encoder
    ripple: TorqueRipple = NO_RIPPLE

    @property
    def velocity(self) -> float:
        """v_s, of the mean law [rad/s]."""
        return self.robot.mean().friction.positive.stribeck_velocity

    @property
    def static(self) -> float:
        """F_s, of the mean law [N m]."""
        return self.robot.mean().friction.positive.static_torque

    @property
    def coulomb(self) -> float:
        """F_c, of the mean law [N m]."""
        return self.robot.mean().friction.positive.coulomb_torque

    @property
    def is_symmetric(self) -> bool:
        """Whether both directions have one law."""
        return self.robot.friction.positive == self.robot.friction.negative

    def bench(self, limit: float = math.inf) -> Bench:
        """What plays protocols on the link; `limit` is the actuator's own [N m]."""
        return Bench(plant_array(self.robot, self.ripple), self.period, self.resolution, limit)

    def virtual(self) -> VirtualRig:
        """The rig as a [virtual_rig] table."""
        friction = self.robot.friction
        positive, negative = (TrueCurve(**vars(curve)) for curve in (friction.positive, friction.negative))
        robot = TrueRobot(inertia=self.robot.inertia, positive=positive, negative=negative)
        rate = 1.0 / self.period
        tones = MultisineSettings(highest=min(40.0, 0.2 * rate), periods=3, realisations=3)
        return VirtualRig(robot=robot, sample_period=self.period, multisine=tones)

    def logged(self, log: str, protocol: ProtocolName, motion: Motion, generator: np.random.Generator) -> Run:
        """What the instruments make of a motion."""
        return Run(
            log=log,
            protocol=protocol,
            time=self.period * np.arange(motion.position.size, dtype=np.float64),
            position=Encoder(self.resolution).measure(motion.position),
            torque=TorqueChannel(noise=self.noise).measure(motion.torque, generator),
            velocity=None,
            reference=None,
        )


@dataclass(frozen=True)
class Campaign:
    """A rig and its logs in SI, not yet screened."""

    rig: Rig
    logs: tuple[Run, ...]

    def of(self, protocol: ProtocolName) -> tuple[Run, ...]:
        """The logs of one protocol."""
        return tuple(log for log in self.logs if log.protocol == protocol)

    def without(self, logs: Sequence[Run]) -> Campaign:
        """The same campaign less some logs."""
        names = {log.log for log in logs}
        return replace(self, logs=tuple(log for log in self.logs if log.log not in names))

    def with_log(self, changed: Run) -> Campaign:
        """The same campaign with the log of that name changed."""
        return replace(self, logs=tuple(changed if log.log == changed.log else log for log in self.logs))


def clean_campaign(generator: np.random.Generator, rig: Rig | None = None) -> Campaign:
    """Constant speeds both ways, ramps at two rates both ways, three multisines."""
    rig = random_rig(generator) if rig is None else rig
    speeds = rig.velocity * np.geomspace(SLOWEST, FASTEST, SPEEDS)
    logs = [steady_log(rig, sign * float(speed), generator) for sign in (1.0, -1.0) for speed in speeds]
    logs += [ramp_log(rig, sign * rate * rig.static, generator) for rate in RATES for sign in (1.0, -1.0)]
    return Campaign(rig, (*logs, *multisine_logs(rig, generator)))


def random_rig(generator: np.random.Generator) -> Rig:
    """A rig of any size."""
    kind = generator.choice(["table 1", "alike", "rotary", "linear"])
    robot = asymmetric_robot()
    if kind == "alike":
        robot = robot.mean()
    if kind in {"rotary", "linear"}:
        robot = random_robot(generator, linear=kind == "linear")
    velocity = robot.mean().friction.positive.stribeck_velocity
    counts = 10.0 ** generator.uniform(4.0, math.log10(2.0**18))
    pace = robot.inertia / _steepest(robot)
    rates = [rate for rate in (250.0, 500.0, 1000.0, 2000.0, 4000.0) if pace * rate > 3.0]
    period = 1.0 / float(generator.choice(rates))
    coulomb = robot.mean().friction.positive.coulomb_torque
    static = robot.mean().friction.positive.static_torque
    return Rig(
        robot=robot,
        axis="linear" if kind == "linear" else "rotary",
        period=period,
        resolution=velocity / 0.07525 * 2.0 * math.pi / counts,
        noise=coulomb * 10.0 ** generator.uniform(math.log10(0.002), math.log10(0.02)),
        declared=bool(generator.random() < 0.7),
        torque_limit=4.0 * static if generator.random() < 0.5 else None,
        fine=counts > LOOP_COUNTS and pace > LOOP_PERIODS * period,
    )


def random_robot(generator: np.random.Generator, *, linear: bool) -> OneLinkRobot:
    """A robot with a Stribeck effect that shows, half of them with both directions alike."""
    static = 0.54 * 10.0 ** generator.uniform(0.0, 2.5 if linear else 1.5)
    velocity = 0.075 * 10.0 ** generator.uniform(-1.0, 0.0 if linear else 0.7)
    forward = StribeckCurve(
        static_torque=static,
        coulomb_torque=static * generator.uniform(0.6, 0.8),
        stribeck_velocity=velocity,
        viscous_damping=static / velocity * generator.uniform(0.003, 0.02),
    )
    backward = forward
    if generator.random() < 0.5:
        a, b, c = generator.uniform(0.85, 1.15, 3)
        backward = StribeckCurve(
            static_torque=a * forward.static_torque,
            coulomb_torque=a * forward.coulomb_torque,
            stribeck_velocity=b * velocity,
            viscous_damping=c * forward.viscous_damping,
        )
    friction = StribeckFriction(forward, backward)
    pace = 10.0 ** generator.uniform(math.log10(0.005), math.log10(0.2))
    return OneLinkRobot(pace * _steepest(OneLinkRobot(1.0, friction)), friction)


def _steepest(robot: OneLinkRobot) -> float:
    """Largest dF/v_s - b [N m s/rad]."""
    curves = (robot.friction.positive, robot.friction.negative)
    return max(curve.steepest_fall - curve.viscous_damping for curve in curves)


def steady_log(
    rig: Rig, speed: float, generator: np.random.Generator, *, duration: float | None = None, name: str = ""
) -> Run:
    """A constant speed, held by the loop on a fine encoder, else imposed; the slower, the longer."""
    if duration is None:
        scale = rig.velocity
        duration = min(max(0.6 * scale / abs(speed), 2.0), 5.0)
        duration = max(duration, 80.0 * rig.resolution / abs(speed), 800.0 * rig.period)
    start = float(generator.uniform(-40.0, 40.0)) * rig.velocity
    log = name or f"velocity/{speed:.4g}.csv"
    if rig.fine:
        loop = speed_loop(rig.virtual())
        settling = 3.0 * loop.stiffness / loop.integral
        motion = play_speed(
            rig.bench(), speed=speed, duration=duration, loop=loop, start=start, settling=settling
        )
        return rig.logged(log, "constant_velocity", motion, generator)
    time = np.arange(0.0, duration, rig.period)
    return rig.logged(log, "constant_velocity", imposed(rig, start, speed * np.ones(time.size)), generator)


def imposed(rig: Rig, start: float, velocity: FloatArray) -> Motion:
    """A motion with given velocities (n,) [rad/s], the torque that it takes held between samples."""
    position = start + np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1])))) * rig.period
    curves = rig.robot.friction
    friction = np.where(
        velocity > 0.0,
        curves.positive.total(np.abs(velocity)),
        np.where(velocity < 0.0, -curves.negative.total(np.abs(velocity)), 0.0),
    )
    ripple = rig.ripple.amplitude * np.sin(rig.ripple.harmonic * position + rig.ripple.phase)
    torque = rig.robot.inertia * np.gradient(velocity, rig.period) + friction - ripple * (velocity != 0.0)
    return Motion(position, velocity, torque, np.zeros(position.size))


def ramp_log(
    rig: Rig,
    rate: float,
    generator: np.random.Generator,
    *,
    ramps: int = 3,
    limit: float = math.inf,
    name: str = "",
) -> Run:
    """Ramps from rest at a rate [N m/s] that carries the direction."""
    motion = play_ramps(
        rig.bench(limit),
        rate=rate,
        ramps=ramps,
        travel=20.0 * rig.velocity,
        start=float(generator.uniform(-20.0, 20.0)) * rig.velocity,
    )
    return rig.logged(name or f"breakaway/{rate:.4g}.csv", "breakaway", motion, generator)


def multisine_logs(rig: Rig, generator: np.random.Generator) -> tuple[Run, ...]:
    """Multisines on a bias speed, each of other phases."""
    return tuple(
        rig.logged(f"frf/{run.label}.csv", "frequency_response", run.play(generator), generator)
        for run in multisines(rig.virtual(), rig.bench(rig.torque_limit or math.inf))
    )

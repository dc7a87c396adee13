"""A rig for the estimators' tests, independent of `ident.response` and of the virtual rig.

The robot is integrated in small fixed steps by the midpoint rule, with the sign of the velocity watched at
each step: slow, plain, and sharing no line with the code that is tested. Torque is held between samples, the
encoder rounds to counts, the logged torque carries white noise, and a position-dependent ripple acts on the
link. Speeds are imposed (a perfect speed loop with a slight wobble), ramps and excitations are simulated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from data.protocols import ProtocolName
from data.recording import FloatArray, Recording
from ident.model.published import asymmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.compiled import owning


@dataclass(frozen=True)
class Rig:
    """The truth, and what measures it."""

    robot: OneLinkRobot = field(default_factory=asymmetric_robot)
    period: float = 1e-3  # [s]
    resolution: float = 2 * math.pi / 2**18  # [rad]
    torque_noise: float = 0.01  # standard deviation [N m]
    ripple: float = 0.0  # amplitude [N m]
    ripple_cycles: float = 7.0  # cycles a 2 pi of position
    torque_limit: float = math.inf  # [N m]

    def law(self) -> FloatArray:
        """J, then F_s, F_c, v_s, beta, b of the positive and of the negative direction."""
        numbers = [self.robot.inertia]
        for curve in (self.robot.friction.positive, self.robot.friction.negative):
            numbers += [
                curve.static_torque,
                curve.coulomb_torque,
                curve.stribeck_velocity,
                curve.stribeck_shape,
                curve.viscous_damping,
            ]
        return np.array(numbers)

    def substeps(self) -> int:
        """Steps a sample, short against the fastest rate of the law."""
        fall = max(c.steepest_fall for c in (self.robot.friction.positive, self.robot.friction.negative))
        return max(4, math.ceil(20 * self.period * fall / self.robot.inertia))

    def recorded(
        self,
        log: str,
        protocol: ProtocolName,
        *,
        position: FloatArray,
        torque: FloatArray,
        generator: np.random.Generator,
    ) -> Recording:
        """What the instruments make of true signals (n,)."""
        noise = self.torque_noise * generator.standard_normal(torque.size)
        measured = np.round(position / self.resolution) * self.resolution if self.resolution else position
        return Recording(
            log=log,
            protocol=protocol,
            time=np.asarray(self.period * np.arange(torque.size), dtype=np.float64),
            position=measured.copy(),
            torque=torque + noise,
            resolution=self.resolution or None,
            torque_limit=None if math.isinf(self.torque_limit) else self.torque_limit,
        )

    def ramps(
        self,
        rates: Sequence[float],
        generator: np.random.Generator,
        *,
        log: str = "ramps",
        start: float = 0.0,
        travel: float = 1.5,
        rest: float = 0.5,
    ) -> Recording:
        """Ramps at signed rates [N m/s], each until the link has moved `travel` [rad], in one log."""
        slowest = min(abs(rate) for rate in rates)
        strongest = max(self.law()[1], self.law()[6])
        longest = 2.5 * strongest / slowest + 2.0
        n = int(len(rates) * (longest + 2 * rest + 2.0) / self.period)
        position, torque, used = _ramps(
            self.law(),
            np.asarray(rates, dtype=np.float64),
            start,
            travel,
            rest,
            self.period,
            self.substeps(),
            self.ripple,
            self.ripple_cycles,
            self.torque_limit,
            n,
        )
        return self.recorded(
            log, "breakaway", position=position[:used], torque=torque[:used], generator=generator
        )

    def speeds(
        self,
        speeds: Sequence[float],
        generator: np.random.Generator,
        *,
        log: str = "speeds",
        duration: float = 4.0,
        rest: float = 0.0,
        wobble: float = 0.0,
        start: float = 0.0,
    ) -> Recording:
        """Imposed speeds [rad/s], each for `duration` [s] with short cosine changes between, in one log."""
        changes = 0.05 * duration
        pieces: list[FloatArray] = []
        last = 0.0
        for speed in speeds:
            s = np.arange(0.0, 1.0, self.period / changes)
            pieces.append(last + (speed - last) * 0.5 * (1 - np.cos(np.pi * s)))
            t = np.arange(0.0, duration, self.period)
            pieces.append(speed * (1 + wobble * np.sin(2 * np.pi * 3.3 * t)))
            last = speed
            if rest:
                pieces.append(speed * 0.5 * (1 + np.cos(np.pi * s)))
                pieces.append(np.zeros(int(rest / self.period)))
                last = 0.0
        velocity = np.concatenate(pieces)
        position = (
            start + np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))]) * self.period
        )
        acceleration = np.gradient(velocity, self.period)
        friction = self.robot.friction
        total = np.where(
            velocity > 0,
            friction.positive.total(np.abs(velocity)),
            np.where(velocity < 0, -friction.negative.total(np.abs(velocity)), 0.0),
        )
        ripple = self.ripple * np.sin(self.ripple_cycles * position) * (velocity != 0)
        torque = self.robot.inertia * acceleration + total + ripple
        return self.recorded(log, "constant_velocity", position=position, torque=torque, generator=generator)

    def torque_driven(
        self,
        torque: FloatArray,
        generator: np.random.Generator,
        *,
        log: str = "driven",
        protocol: ProtocolName = "frequency_response",
        speed: float = 0.0,
        delay: int = 0,
    ) -> Recording:
        """The link under a torque (n,) that acts `delay` samples after it is logged."""
        acting = np.concatenate([np.full(delay, torque[0]), torque[: torque.size - delay]])
        position = _driven(
            self.law(), acting, speed, self.period, self.substeps(), self.ripple, self.ripple_cycles
        )
        return self.recorded(log, protocol, position=position, torque=torque, generator=generator)


def multisine(
    *, length: int, amplitude: float, lines: Sequence[int], generator: np.random.Generator
) -> FloatArray:
    """One period (length,) of a random-phase multisine with the given root mean square [N m]."""
    phases = generator.uniform(0, 2 * np.pi, len(lines))
    t = np.arange(length)
    wave = np.sum(
        [np.cos(2 * np.pi * k * t / length + p) for k, p in zip(lines, phases, strict=True)], axis=0
    )
    return np.asarray(amplitude * wave / np.sqrt(np.mean(wave**2)), dtype=np.float64)


@owning
def _friction(law: FloatArray, v: float) -> float:
    k = 1 if v > 0 else 6
    s = abs(v)
    total = law[k + 1] + (law[k] - law[k + 1]) * math.exp(-((s / law[k + 2]) ** law[k + 3])) + law[k + 4] * s
    return float(total) if v > 0 else -float(total)


@owning
def _step(
    law: FloatArray, q: float, v: float, u: float, h: float, ripple: float, cycles: float
) -> tuple[float, float]:
    acting = u - ripple * math.sin(cycles * q)
    if v == 0.0:
        if -law[6] <= acting <= law[1]:
            return q, 0.0
        v = 1e-300 if acting > 0 else -1e-300
    a1 = (acting - _friction(law, v)) / law[0]
    middle = v + 0.5 * h * a1
    if middle * v <= 0:
        stop = -v / a1
        return q + 0.5 * v * stop, 0.0
    a2 = (u - ripple * math.sin(cycles * (q + 0.5 * h * v)) - _friction(law, middle)) / law[0]
    after = v + h * a2
    if after * v <= 0:
        stop = -v / a2
        return q + 0.5 * v * stop, 0.0
    return q + h * 0.5 * (v + after), after


@owning
def _sample(
    law: FloatArray, q: float, v: float, u: float, period: float, steps: int, ripple: float, cycles: float
) -> tuple[float, float]:
    for _ in range(steps):
        q, v = _step(law, q, v, u, period / steps, ripple, cycles)
    return q, v


@owning
def _driven(
    law: FloatArray, torque: FloatArray, speed: float, period: float, steps: int, ripple: float, cycles: float
) -> FloatArray:
    position = np.empty(torque.size)
    q, v = 0.0, speed
    for k in range(torque.size):
        position[k] = q
        q, v = _sample(law, q, v, torque[k], period, steps, ripple, cycles)
    return position


@owning
def _ramps(
    law: FloatArray,
    rates: FloatArray,
    start: float,
    travel: float,
    rest: float,
    period: float,
    steps: int,
    ripple: float,
    cycles: float,
    limit: float,
    n: int,
) -> tuple[FloatArray, FloatArray, int]:
    position, torque = np.empty(n), np.empty(n)
    q, v, k = start, 0.0, 0
    for rate in rates:
        still = 0
        while still * period < rest and k < n:
            position[k], torque[k] = q, 0.0
            q, v = _sample(law, q, v, 0.0, period, steps, ripple, cycles)
            still = still + 1 if v == 0.0 else 0
            k += 1
        origin, elapsed = q, 0
        while abs(q - origin) < travel and k < n and abs(rate) * elapsed * period < 1.2 * limit:
            u = max(-limit, min(limit, rate * elapsed * period))
            position[k], torque[k] = q, u
            q, v = _sample(law, q, v, u, period, steps, ripple, cycles)
            elapsed += 1
            k += 1
    still = 0
    while still * period < rest and k < n:
        position[k], torque[k] = q, 0.0
        q, v = _sample(law, q, v, 0.0, period, steps, ripple, cycles)
        still = still + 1 if v == 0.0 else 0
        k += 1
    return position, torque, k

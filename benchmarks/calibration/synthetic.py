r"""Synthetic campaigns: evidence drawn from a law and from instruments that are both known.

A campaign is made where the logs have already become data (`ident.evidence`), so that thousands of them can
be had: steady runs, breakaways and an inertia from the frequency response, each with every error that its
description speaks of, and no others:

- a steady run's torque has white noise and a difference from run to run, and its speed is the slope of a
  position in counts;
- a breakaway's torque has the error of its ramp's line and a difference from place to place, and is read when
  the link has moved by counts, by which time the ramp has risen (`ident.response.breakaway_delay`);
- the motion after a breakaway is that of the robot under the ramp, at a place where all of the friction is
  off by as much as F_s is, with speeds that err as a smoothed encoder's do and a torque with white noise;
- the inertia has an error whose size is itself an estimate with few degrees of freedom.

The designs that are held to targets have no motion: with it there are more ways to v_s.

Every other rig is the published one, give or take a tenth; the rest are unlike it in torque, speed and
inertia.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from data.recording import FloatArray
from ident.evidence.breakaway import Breakaway, RampLine
from ident.evidence.frequency_response import FrequencyInertia, ResponseFit
from ident.evidence.friction_map import LEAST_COUNTS, SteadyRun
from ident.evidence.gathering import Evidence
from ident.evidence.hunting import Swing
from ident.evidence.momentum import NODES, WINDOWS, Momentum
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.published import INERTIA, NEGATIVE, POSITIVE
from ident.model.robot import OneLinkRobot
from ident.response import breakaway_delay, respond

Rig = Literal["published", "unlike"]
Errors = Callable[[np.random.Generator, int], FloatArray]  # n draws of variance 1

SPAN: Final = (0.07, 28.0)  # speeds in parts of the v_s that the experimenter expects: 0.005 to 2 rad/s
PERIOD: Final = 1e-3  # [s]
DURATION: Final = 10.0  # [s] of a steady run at least
LEAST_TRAVEL: Final = 0.1  # [rad] of one: slow runs last longer
LONGEST: Final = 30.0  # [s]
ONSET_COUNTS: Final = 3.5
NEAR: Final = 1e-3  # [rad] from which the motion after a breakaway is used
FAR: Final = 1.5  # [rad] up to which
SPEED_WINDOWS: Final = 40.0  # of a motion, over one of which a speed is read
RESPONSE_ERROR: Final = 2e-3  # of J
RESPONSE_DOF: Final = 3
GUESS: Final = 0.15  # by which the experimenter's v_s is off


def gaussian(generator: np.random.Generator, n: int) -> FloatArray:
    """Normal errors (n,)."""
    return generator.standard_normal(n)


def heavy_tailed(generator: np.random.Generator, n: int) -> FloatArray:
    """Errors (n,) of Student's t with 5 degrees of freedom, scaled to variance 1."""
    return generator.standard_t(5, n) * math.sqrt(3.0 / 5.0)


def skewed(generator: np.random.Generator, n: int) -> FloatArray:
    """Errors (n,) of a gamma distribution of shape 4, with mean 0 and variance 1."""
    return (generator.gamma(4.0, size=n) - 4.0) / 2.0


@dataclass(frozen=True)
class Design:
    """What an experimenter records, and how much it strays."""

    name: str
    speeds: FloatArray  # (n,) in parts of the expected v_s, each way
    starts: int = 5  # breakaways each way
    noise: tuple[float, float] = (1.0, 1.0)  # on every spread, positive and negative
    counts: int = 2**18  # of the encoder, a revolution
    free_beta: bool = False
    errors: Errors = gaussian
    motion: bool = False  # after breakaway
    response: bool = True  # a frequency response


def _in_ratio(n: int) -> FloatArray:
    return np.asarray(np.geomspace(*SPAN, n), dtype=np.float64)


GOOD: Final = Design("good", _in_ratio(30))
DESIGNS: Final = (
    GOOD,
    Design("few-speeds", _in_ratio(9), starts=3),
    Design("no-low-speeds", np.linspace(20.0 * SPAN[0], SPAN[1], 30), starts=0),
    Design("free-beta", _in_ratio(30), free_beta=True),
    Design("asymmetric-noise", _in_ratio(30), noise=(1.0, 4.0)),
    Design("coarse-encoder", _in_ratio(30), counts=2000),
)
ADVERSARIES: Final = (
    Design("heavy-tails", _in_ratio(30), errors=heavy_tailed),
    Design("skewed", _in_ratio(30), errors=skewed),
    Design("motion", _in_ratio(30), motion=True),
    Design("motion-alone", _in_ratio(30), motion=True, response=False),
    Design("motion-for-low-speeds", np.linspace(20.0 * SPAN[0], SPAN[1], 30), motion=True),
)


@dataclass(frozen=True)
class Campaign:
    """The truth and what was seen of it."""

    robot: OneLinkRobot
    evidence: Evidence


def campaign(design: Design, generator: np.random.Generator) -> Campaign:
    """One campaign of a design, on a rig drawn with it."""
    rig: Rig = "published" if generator.random() < 0.5 else "unlike"
    robot = _robot(rig, design.free_beta, generator)
    resolution = 2 * math.pi / design.counts
    spread = math.exp(generator.uniform(math.log(3e-3), math.log(3e-2)))  # of F_c
    place = spread * math.exp(generator.uniform(0.0, math.log(3.0)))
    runs: list[SteadyRun] = []
    starts: list[Breakaway] = []
    momenta: list[Momentum] = []
    for sign, curve, noise in zip((1, -1), _curves(robot), design.noise, strict=True):
        expected = _expected_velocity(robot) * math.exp(GUESS * generator.standard_normal())
        own = noise * spread * curve.coulomb_torque * design.errors(generator, design.speeds.size)
        runs += [
            _run(robot, sign, float(speed), float(error), resolution, generator)
            for speed, error in zip(expected * design.speeds, own, strict=True)
        ]
        own = noise * place * curve.coulomb_torque * design.errors(generator, design.starts)
        begun = [_start(robot, sign, float(error), resolution, generator) for error in own]
        starts += begun
        if design.motion:
            momenta += [
                _motion(robot, start, float(error), resolution, generator)
                for start, error in zip(begun, own, strict=True)
            ]
    response = _response(robot, generator) if design.response else None
    return Campaign(robot, Evidence(tuple(runs), tuple(starts), tuple(momenta), response, {}))


def _robot(rig: Rig, free_beta: bool, generator: np.random.Generator) -> OneLinkRobot:
    """Both directions differ by about a tenth in everything."""
    beta = generator.uniform(0.8, 1.5) if free_beta else 1.0
    if rig == "published":
        curves = [_about(curve, beta, generator) for curve in (POSITIVE, NEGATIVE)]
        inertia = INERTIA * math.exp(0.1 * generator.standard_normal())
        return OneLinkRobot(inertia, StribeckFriction(*curves))
    coulomb = math.exp(generator.uniform(math.log(0.05), math.log(50.0)))  # [N m]
    velocity = POSITIVE.stribeck_velocity * math.exp(generator.uniform(-1.6, 1.6))
    stribeck = coulomb * generator.uniform(0.2, 1.0)
    typical = StribeckCurve(
        static_torque=coulomb + stribeck,
        coulomb_torque=coulomb,
        stribeck_velocity=velocity,
        viscous_damping=coulomb * generator.uniform(0.15, 1.0) / (SPAN[1] * velocity),
    )
    rise = math.exp(generator.uniform(math.log(3e-3), math.log(5e-2)))  # [s], J / (dF / v_s)
    curves = [_about(typical, beta, generator) for _ in range(2)]
    return OneLinkRobot(rise * stribeck / velocity, StribeckFriction(*curves))


def _about(curve: StribeckCurve, beta: float, generator: np.random.Generator) -> StribeckCurve:
    coulomb, stribeck, velocity, damping, shape = np.exp(0.1 * generator.standard_normal(5))
    coulomb *= curve.coulomb_torque
    return StribeckCurve(
        static_torque=coulomb + stribeck * curve.stribeck_torque,
        coulomb_torque=coulomb,
        stribeck_velocity=velocity * curve.stribeck_velocity,
        viscous_damping=damping * curve.viscous_damping,
        stribeck_shape=1.0 if beta == 1.0 else beta * shape,
    )


def _curves(robot: OneLinkRobot) -> tuple[StribeckCurve, StribeckCurve]:
    return robot.friction.positive, robot.friction.negative


def _expected_velocity(robot: OneLinkRobot) -> float:
    return robot.friction.mean().positive.stribeck_velocity


def _run(
    robot: OneLinkRobot,
    sign: int,
    speed: float,
    error: float,
    resolution: float,
    generator: np.random.Generator,
) -> SteadyRun:
    """A run at a speed [rad/s], its torque off by an `error` [N m] beside white noise."""
    curve = _curves(robot)[0 if sign > 0 else 1]
    duration = min(max(DURATION, LEAST_TRAVEL / speed), LONGEST)
    samples = int(duration / PERIOD)
    white = 0.02 * curve.coulomb_torque / math.sqrt(samples)
    acceleration = 0.01 * speed / duration * generator.standard_normal()
    measured, velocity_stderr = _slope(speed, samples, resolution, generator)
    torque = float(curve.total(speed)) + robot.inertia * acceleration + error
    torque += white * generator.standard_normal()
    counts = speed * duration / resolution
    return SteadyRun(
        log=f"{sign * speed:.4g}",
        velocity=sign * measured,
        velocity_stderr=velocity_stderr,
        torque=sign * torque,
        acceleration=sign * acceleration,
        white_stderr=white,
        block_ratio=1.0,
        travel=speed * duration,
        swing=Swing(0.0, 0.0, PERIOD),
        start_time=0.0,
        end_time=duration,
        why=None if counts >= LEAST_COUNTS else "E-QUANT: too slow for the encoder",
    )


def _slope(
    speed: float, samples: int, resolution: float, generator: np.random.Generator
) -> tuple[float, float]:
    """Slope of a position in counts, and its error as `ident.evidence.friction_map` states it [rad/s]."""
    kept = max(1, samples // 2000)  # rounding is a sawtooth: fewer samples make its error no smaller
    time = PERIOD * np.arange(0, samples, kept, dtype=np.float64)
    position = np.round((speed * time + generator.random() * resolution) / resolution) * resolution
    centred = time - time.mean()
    slope = float(centred @ position / (centred @ centred))
    duration = PERIOD * samples
    counts = max(speed * duration / resolution, 1.0)
    share = min(6.0**-0.5, math.hypot(1.5 / counts, time.size**-0.5))
    return slope, share * resolution / duration


def _start(
    robot: OneLinkRobot, sign: int, error: float, resolution: float, generator: np.random.Generator
) -> Breakaway:
    """A breakaway at a place where F_s is off by an `error` [N m]."""
    curve = _curves(robot)[0 if sign > 0 else 1]
    rate = curve.static_torque * math.exp(generator.uniform(math.log(0.01), math.log(0.05)))  # [N m/s]
    travel = ONSET_COUNTS * resolution
    # The link rests anywhere within its count.
    moved = travel + resolution * (generator.random() - 0.5)
    delay = breakaway_delay(
        robot, direction="positive" if sign > 0 else "negative", ramp_rate=rate, travel=moved
    )
    stderr = 5e-4 * curve.coulomb_torque
    torque = curve.static_torque + error + rate * delay + stderr * generator.standard_normal()
    return Breakaway(
        log="ramps",
        direction=sign,
        line=RampLine(sign * torque, stderr, sign * rate, 0.0),
        travel=travel,
        travel_stderr=0.4 * resolution,
        place=0.0,
        onset_time=1.0,
        onset=1000,
        end=1001,
        end_time=1.001,
    )


def _motion(
    robot: OneLinkRobot, start: Breakaway, error: float, resolution: float, generator: np.random.Generator
) -> Momentum:
    """The motion under the ramp at a place where the friction is off by an `error` [N m]."""
    curve = _curves(robot)[0 if start.direction > 0 else 1]
    there = replace(
        curve, static_torque=curve.static_torque + error, coulomb_torque=curve.coulomb_torque + error
    )
    samples = math.ceil(2.0 * math.sqrt(2.0 * FAR * robot.inertia / curve.stribeck_torque) / PERIOD)
    time = PERIOD * np.arange(samples, dtype=np.float64)
    torque = np.asarray(there.static_torque + abs(start.line.rate) * time)
    moving = OneLinkRobot(robot.inertia, StribeckFriction.symmetric(there))
    position, speed = respond(moving, start=(0.0, 0.0), torque=torque, period=PERIOD)
    first, past = (int(np.searchsorted(position, far)) for far in (NEAR, FAR))
    edges = np.linspace(first, min(past, samples), WINDOWS + 1).astype(int)
    white, width = 0.02 * curve.coulomb_torque, PERIOD * (edges[-1] - first) / SPEED_WINDOWS
    speed_error = resolution / width
    windows = np.diff(np.eye(edges.size), axis=0)
    duration = PERIOD * np.diff(edges)
    variance = duration * PERIOD * white**2
    impulse = np.diff(np.concatenate([[0.0], np.cumsum(torque)])[edges]) * PERIOD
    nodes = np.array([np.linspace(a, b, NODES) for a, b in itertools.pairwise(edges)])
    return Momentum(
        log="ramps",
        direction=start.direction,
        impulse=impulse + np.sqrt(variance) * generator.standard_normal(WINDOWS),
        duration=duration,
        travel=np.diff(position[edges]),
        gain=np.diff(speed[edges] + speed_error * generator.standard_normal(edges.size)),
        nodes=np.interp(nodes, np.arange(samples + 1), speed),
        places=np.zeros_like(nodes),
        speed_covariance=speed_error**2 * windows @ windows.T,
        impulse_variance=variance,
    )


def _response(robot: OneLinkRobot, generator: np.random.Generator) -> FrequencyInertia:
    """The inertia about a bias speed far above v_s, its stated error estimated from few stretches."""
    true_error = RESPONSE_ERROR * robot.inertia
    stated = true_error * math.sqrt(generator.chisquare(RESPONSE_DOF) / RESPONSE_DOF)
    value = robot.inertia + true_error * generator.standard_normal()
    bias = SPAN[1] * _expected_velocity(robot)
    fit = ResponseFit(
        log="multisine",
        inertia=value,
        stderr=stated,
        damping=robot.friction.positive.viscous_damping,
        delay=0.0,
        bias_speed=bias,
        lowest_speed=0.8 * bias,
        frequency=np.array([1.0]),
        impedance=np.array([1.0 + 1.0j]),
        weight=np.array([1.0]),
    )
    return FrequencyInertia(value, stated, RESPONSE_DOF, 0.8 * bias, (fit,))

"""What a virtual rig plays: each protocol as runs, scaled to the robot where the campaign leaves it open.

A run is a label (the part of the log's name that the campaign's glob leaves open), what its log says of it,
and the motion, played when it is asked for.

The speed loop has to damp the falling part of the Stribeck curve: its damping k_d is 1.22 times the largest
dF/v_s - b of either direction, and its velocity filter 2.6 k_d / J fast, or the "constant" speed would be
stick-slip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from data.recording import FloatArray
from ident.model.friction import StribeckCurve
from pipelines.settings.virtual_rig import SpeedLoopSettings, VirtualRig
from pipelines.virtual.bench import Bench, Motion, play_ramps, play_speed, play_torque


@dataclass(frozen=True)
class Run:
    """One log to be recorded."""

    label: str
    metadata: Mapping[str, str]
    play: Callable[[np.random.Generator], Motion]
    log: str | None = None  # the log's name where the campaign itself gives it


def rounded(value: float) -> float:
    """Two significant digits: what somebody would dial in."""
    return float(f"{value:.2g}")


def speed_loop(rig: VirtualRig) -> SpeedLoopSettings:
    """The speed loop that is given, or one for this robot: k_d/J, the filter, k_p/k_d and k_i/k_p in one
    scale.
    """
    if rig.speed_loop is not None:
        return rig.speed_loop
    robot = rig.true_robot()
    curves = (robot.friction.positive, robot.friction.negative)
    fall = max(_usable_fall(curve) - curve.viscous_damping for curve in curves)
    rate = max(1.2245 * fall / robot.inertia, 0.05 / rig.sample_period)
    rate = min(rate, 0.2 / rig.sample_period)
    damping = rate * robot.inertia
    return SpeedLoopSettings(
        damping=damping,
        stiffness=0.173 * rate * damping,
        integral=0.0025 * rate**2 * damping,
        filter=2.6 * rate,
    )


def _usable_fall(curve: StribeckCurve) -> float:
    fall = curve.steepest_fall
    return fall if math.isfinite(fall) else 2.0 * curve.stribeck_torque / curve.stribeck_velocity


def breakaways(rig: VirtualRig, bench: Bench) -> Iterator[Run]:
    """Torque ramps, a log for each direction and rate."""
    mean = rig.true_robot().mean().friction.positive
    rates = rig.ramp_rates or tuple(rounded(part * mean.static_torque) for part in (0.2, 0.6))
    travel = rig.travel or rounded(20.0 * mean.stribeck_velocity)
    for direction, sign in (("p", 1.0), ("n", -1.0)):
        for number, rate in enumerate(rates):
            play = partial(
                _played_ramps,
                bench,
                rate=sign * rate,
                ramps=rig.ramps,
                travel=travel,
                start=0.37 * number * travel,
            )
            yield Run(f"{direction}_rate{rate:g}", {"ramp_rate": f"{rate:g}"}, play)


def _played_ramps(
    bench: Bench, _: np.random.Generator, *, rate: float, ramps: int, travel: float, start: float
) -> Motion:
    return play_ramps(bench, rate=rate, ramps=ramps, travel=travel, start=start)


def constant_speeds(rig: VirtualRig, bench: Bench) -> Iterator[Run]:
    """One speed a log, both directions; the slower, the longer, between 8 s and 20 s."""
    scale = rig.true_robot().mean().friction.positive.stribeck_velocity
    speeds = rig.speeds or tuple(rounded(s) for s in np.geomspace(scale / 15.0, 33.0 * scale, 14))
    loop = speed_loop(rig)
    for direction, sign in (("p", 1.0), ("n", -1.0)):
        for number, speed in enumerate(speeds):
            play = partial(
                _played_speed,
                bench,
                speed=sign * speed,
                duration=min(max(5.0 * scale / speed, 8.0), 20.0),
                loop=loop,
                start=3.1 * number * scale,
            )
            yield Run(f"{direction}{speed:g}", {"speed": f"{sign * speed:g}"}, play)


def _played_speed(
    bench: Bench,
    _: np.random.Generator,
    *,
    speed: float,
    duration: float,
    loop: SpeedLoopSettings,
    start: float,
) -> Motion:
    settling = 3.0 * loop.stiffness / loop.integral
    return play_speed(bench, speed=speed, duration=duration, loop=loop, start=start, settling=settling)


def multisines(rig: VirtualRig, bench: Bench) -> Iterator[Run]:
    """Realisations of a multisine with other phases, on a bias speed."""
    settings = rig.multisine
    for number in range(1, settings.realisations + 1):
        metadata = {"period": f"{settings.period:g}", "realisation": f"{number}"}
        yield Run(f"{number}", metadata, partial(_played_multisine, rig, bench))


def _played_multisine(rig: VirtualRig, bench: Bench, generator: np.random.Generator) -> Motion:
    settings, robot = rig.multisine, rig.true_robot()
    curve = robot.friction.positive
    bias = settings.bias or rounded(40.0 * robot.mean().friction.positive.stribeck_velocity)
    hold = 2.0 * robot.inertia  # [N m s/rad]: a pole at 2 rad/s, far below the lowest line
    n = round(settings.period / bench.period)
    lowest, highest = settings.lowest * settings.period, settings.highest * settings.period
    harmonics = odd_lines(lowest, highest, settings.lines)
    phases = generator.uniform(0, 2 * np.pi, harmonics.size)
    lines = np.exp(1j * (2 * np.pi * np.outer(np.arange(n) / n, harmonics) + phases))
    rate = 2 * np.pi * harmonics / settings.period
    impedance = 1j * rate * robot.inertia + curve.viscous_damping + hold
    swing = float(np.max(np.abs((lines @ (1.0 / impedance)).real)))
    waves = np.sum(lines.real, axis=1)  # the same torque in every line
    friction = float(curve.total(bias))
    room = max(0.9 * bench.torque_limit - friction, 0.0) / float(np.max(np.abs(waves)))
    signal = friction + min(settings.swing * bias / swing, room) * waves
    whole = np.tile(signal, settings.periods + 2)
    return play_torque(bench, whole, lead=2 * n, start=0.0, speed=bias, hold=hold)


def odd_lines(lowest: float, highest: float, lines: int) -> FloatArray:
    """At most `lines` odd harmonics, about evenly in ratio between the harmonics `lowest` and `highest`."""
    wanted = np.geomspace(lowest, highest, lines)
    odd = np.unique(2 * np.ceil((wanted - 1) / 2) + 1)
    return np.asarray(odd[odd <= max(highest, odd[0])], dtype=np.float64)


def excitations(rig: VirtualRig, bench: Bench) -> Iterator[Run]:
    """Free motion under known torque: three incommensurate sines, through both directions."""
    for number in (1, 2):
        yield Run(f"{number}", {}, partial(_played_excitation, rig, bench))


def _played_excitation(rig: VirtualRig, bench: Bench, generator: np.random.Generator) -> Motion:
    robot = rig.true_robot().mean()
    time = np.arange(round(20.0 / bench.period)) * bench.period
    rates = 2 * np.pi * np.array([0.37, 0.83, 1.91])
    waves = np.sin(np.outer(time, rates) + generator.uniform(0, 2 * np.pi, 3))
    signal = robot.friction.positive.static_torque * (waves @ np.array([1.2, 0.6, 0.4]))
    return play_torque(bench, signal, lead=0, start=0.0)

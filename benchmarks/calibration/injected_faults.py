"""One fault put into a clean campaign, of a random size above the threshold from which it matters.

Each function injects the fault of one code and says which severity it deserves. A log-level fault comes with
the logs that show it; a fault of the fit with the whole campaign. What else may be said beside it is listed:
a campaign without ramps is told that ramps are missing, whatever it was meant to show.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.optimize import brentq, nnls

from benchmarks.calibration.clean_campaigns import (
    Campaign,
    Rig,
    clean_campaign,
    imposed,
    multisine_logs,
    ramp_log,
    random_rig,
    steady_log,
)
from data.findings import Severity
from data.recording import FloatArray
from data.screening.run import Run
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from ident.response import TorqueRipple

Stage = Literal["log", "evidence", "fit"]
Generator = np.random.Generator
WARN, WITHHOLD, REFUSE = Severity.WARN, Severity.WITHHOLD, Severity.REFUSE


@dataclass(frozen=True)
class Injected:
    """A campaign with one fault."""

    campaign: Campaign
    severities: tuple[Severity, ...]  # any of which is right
    stage: Stage  # how far the campaign has to go until it shows
    also: tuple[str, ...] = ()  # codes that may be withheld or refused beside it


def _one(log: Run, rig: Rig, *severities: Severity, stage: Stage = "log") -> Injected:
    return Injected(Campaign(rig, (log,)), severities, stage)


def any_log(rig: Rig, generator: Generator) -> Run:
    """A log of any protocol."""
    kind = generator.integers(4)
    if kind == 0:
        return ramp_log(rig, float(generator.choice([-0.45, 0.45])) * rig.static, generator, ramps=2)
    if kind == 1:
        return multisine_logs(rig, generator)[0]
    return _fast_log(rig, generator)


def _fast_log(rig: Rig, generator: Generator, *, duration: float = 2.0) -> Run:
    """A constant speed between v_s and 30 v_s."""
    speed = float(generator.choice([-1.0, 1.0])) * rig.velocity * 30.0 ** generator.uniform(0.1, 1.0)
    return steady_log(rig, speed, generator, duration=duration)


# What a log shows by itself ----------------------------------------------------------------------------


def wrap(generator: Generator) -> Injected:
    """The encoder starts again after a turn, or after 2^n counts; or jumps by nearly a turn and does not."""
    rig = random_rig(generator)
    log = _fast_log(rig, generator)
    way = np.ptp(log.position)
    turn = 2.0 * math.pi
    if rig.axis == "rotary" and way > 0.3 * turn and generator.random() < 0.5:
        modulus = turn
    else:
        modulus = rig.resolution * 2.0 ** math.floor(math.log2(0.7 * way / rig.resolution))
    rig = replace(rig, declared=rig.declared or modulus != turn)
    middle = log.position[log.position.size // 2]
    origin = middle + (generator.uniform(0.0, 0.3) if generator.random() < 0.5 else 0.0) * modulus
    step = float(np.max(np.abs(np.diff(log.position)))) + rig.resolution
    if generator.random() < 0.75 or 0.008 * modulus < 10.0 * step:
        wrapped = (log.position - origin) % modulus
        return _one(replace(log, position=wrapped), rig, WARN)
    half = log.position.size // 2
    size = modulus * (1.0 + float(generator.choice([-1.0, 1.0])) * generator.uniform(0.008, 0.018))
    jump = math.copysign(size, generator.uniform(-1.0, 1.0)) * (np.arange(log.position.size) >= half)
    return _one(replace(log, position=log.position + jump), rig, REFUSE)


def spike(generator: Generator) -> Injected:
    """Single wrong positions: few are dropped with a warning, many refuse the log."""
    rig = random_rig(generator)
    log = any_log(rig, generator)
    few = generator.random() < 0.5
    share = generator.uniform(0.0015, 0.007) if few else generator.uniform(0.016, 0.06)
    n = log.position.size
    count = max(round(share * n), 2)
    places = generator.choice(np.arange(3, n - 3), count, replace=False)
    if few:
        places = np.sort(places)
        places = places[np.diff(places, prepend=-10) > 4]
    step = float(np.max(np.abs(np.diff(log.position)))) + rig.resolution
    sizes = 10.0 ** generator.uniform(math.log10(20.0), 4.0, places.size) * step
    position = log.position.copy()
    position[places] += sizes * generator.choice([-1.0, 1.0], places.size)
    return _one(replace(log, position=position), rig, WARN if few else REFUSE)


def gap(generator: Generator) -> Injected:
    """Lost samples, or a clock with single long steps."""
    rig = random_rig(generator)
    log = any_log(rig, generator)
    n = log.time.size
    keep = np.ones(n, np.bool_)
    for _ in range(int(generator.integers(1, 6))):
        first = int(generator.integers(20, n - 120))
        keep[first : first + int(generator.integers(4, 100))] = False
    return _one(log.keep(keep), rig, WARN)


def clock(generator: Generator) -> Injected:
    """A clock that is set back, repeats a stamp, was not set, or delivers late; or never runs."""
    rig = random_rig(generator)
    log = any_log(rig, generator)
    n = log.time.size
    time = log.time + generator.choice([0.0, 7.5])
    kind = generator.choice(["back", "equal", "zero", "late", "stopped"])
    place = int(generator.integers(n // 5, 4 * n // 5))
    if kind == "back":
        time[place:] -= rig.period * (1.0 + 10.0 ** generator.uniform(-1.0, 2.5))
    elif kind == "equal":
        width = int(generator.integers(1, 5))
        time[place : place + width] = time[place - 1]
    elif kind == "zero":
        time[place : place + int(generator.integers(1, 5))] = 0.0
    elif kind == "late":
        for k in generator.choice(np.arange(n // 6) * 5 + 5, 4, replace=False):
            time[[k, k + 1]] = time[[k + 1, k]]
    else:
        time = np.floor(np.arange(n) / 7.0) * 7.0 * rig.period
    return _one(replace(log, time=time), rig, REFUSE if kind == "stopped" else WARN)


def saturation(generator: Generator) -> Injected:
    """A torque cut off by the actuator or in the log, at a limit that is declared, or is not."""
    rig = replace(random_rig(generator), torque_limit=None)
    quiet = replace(rig, noise=0.0)
    if generator.random() < 0.5:
        limit = rig.static * generator.uniform(0.5, 0.9)
        log = _held(
            ramp_log(quiet, float(generator.choice([-0.45, 0.45])) * rig.static, generator, limit=limit)
        )
    else:
        log = multisine_logs(quiet, generator)[0]
        limit = float(np.quantile(np.abs(log.torque), generator.uniform(0.85, 0.95)))
    noise = rig.noise * generator.standard_normal(log.torque.size)
    if generator.random() < 0.5:
        torque = np.clip(log.torque, -limit, limit) + noise
    else:
        torque = np.clip(log.torque + noise, -limit, limit)
    declared = replace(rig, torque_limit=limit if generator.random() < 0.4 else None)
    return _one(replace(log, torque=torque), declared, WARN)


def _held(log: Run) -> Run:
    """A log of ramps with each largest torque held three times as long, at rest."""
    size = np.abs(log.torque)
    often = np.where(size == size.max(), 3, 1)
    torque, position = np.repeat(log.torque, often), np.repeat(log.position, often)
    return replace(
        log, time=np.arange(torque.size) * (log.time[1] - log.time[0]), position=position, torque=torque
    )


def unit(generator: Generator) -> Injected:
    """A velocity, a position or a torque in another unit than was said."""
    rig = random_rig(generator)
    kind = generator.choice(["velocity", "position", "torque", "one protocol"])
    log = any_log(rig, generator)
    if kind == "velocity":
        factor = float(generator.choice([180.0 / math.pi, 30.0 / math.pi, 0.5 / math.pi, 1000.0]))
        velocity = np.gradient(log.position, log.time) * factor
        return _one(replace(log, velocity=velocity), rig, REFUSE)
    if kind == "position":
        factor = float(generator.choice([180.0 / math.pi, 0.5 / math.pi, 1000.0]))
        if rig.axis == "linear":
            factor = 1000.0
        log = _fast_log(rig, generator)
        return _one(replace(log, position=log.position * factor), replace(rig, declared=True), REFUSE)
    if kind == "torque":
        factor = float(generator.choice([1000.0, 1e3 / 9.81, 20.0]))
        torque = log.torque * factor
        return _one(replace(log, torque=torque), replace(rig, torque_limit=3.0 * rig.static), REFUSE)
    rig = replace(rig, torque_limit=None)
    whole = small_campaign(rig, generator)
    protocol = generator.choice(["constant_velocity", "breakaway", "frequency_response"])
    factor = float(generator.choice([1000.0, 1e-3]))
    logs = tuple(
        replace(own, torque=own.torque * factor) if own.protocol == protocol else own for own in whole.logs
    )
    return Injected(replace(whole, logs=logs), (REFUSE,), "evidence")


def sign(generator: Generator) -> Injected:
    """A torque, or a position, of the wrong sign."""
    rig = random_rig(generator)
    log = any_log(rig, generator)
    if generator.random() < 0.5:
        return _one(replace(log, torque=-log.torque), rig, REFUSE)
    return _one(replace(log, position=-log.position), rig, REFUSE)


# What the runs of a log show -----------------------------------------------------------------------------


def quantisation(generator: Generator) -> Injected:
    """A speed that covers 2 to 17 counts in its run."""
    rig = random_rig(generator)
    duration = max(2.0, 800.0 * rig.period)
    speed = float(generator.choice([-1.0, 1.0])) * generator.uniform(2.0, 17.0) * rig.resolution / duration
    time = np.arange(0.0, duration, rig.period)
    motion = imposed(rig, float(generator.uniform(-1.0, 1.0)), np.full(time.size, speed))
    log = rig.logged("velocity/slow.csv", "constant_velocity", motion, generator)
    return _one(log, rig, WITHHOLD, stage="evidence")


def creep(generator: Generator) -> Injected:
    """A ramp that ends after a few counts of pre-sliding, without breakaway."""
    rig = random_rig(generator)
    rest, rate = 0.5, 0.45 * rig.static
    n_rest = max(round(rest / rig.period), 20)
    side = float(generator.choice([-1.0, 1.0]))
    top = generator.uniform(0.5, 0.9) * rig.static
    ramp = np.arange(0.0, top, rate * rig.period)
    torque = side * np.concatenate((np.zeros(n_rest), ramp, np.zeros(n_rest)))
    counts = generator.uniform(5.0, 15.0)
    give = counts * rig.resolution * (ramp / top) ** 2
    place = float(generator.uniform(-1.0, 1.0))
    held = np.full(n_rest, give[-1] * generator.uniform(0.0, 0.5))
    position = place + side * np.concatenate((np.zeros(n_rest), give, held))
    whole = ramp_log(rig, side * rate, generator, ramps=1)
    offset = float(whole.position[0]) - float(position[-1])
    torque = np.concatenate((torque, whole.torque))
    torque[: position.size] += rig.noise * generator.standard_normal(position.size)
    measured = np.rint((position + offset) / rig.resolution) * rig.resolution
    log = replace(
        whole,
        time=rig.period * np.arange(torque.size, dtype=np.float64),
        position=np.concatenate((measured, whole.position)),
        torque=torque,
    )
    return _one(log, rig, WARN, stage="evidence")


def unsteady(generator: Generator) -> Injected:
    """A speed that settles late (trimmed), or drifts all the time (withheld)."""
    rig = replace(random_rig(generator), fine=False)
    speed = rig.velocity * float(generator.choice([-1.0, 1.0])) * 20.0 ** generator.uniform(0.0, 1.0)
    duration = max(4.0, 2000.0 * rig.period, 400.0 * rig.resolution / abs(speed))
    time = np.arange(0.0, duration, rig.period)
    part = time / duration
    if generator.random() < 0.5:
        settling = generator.uniform(0.12, 0.18)
        shape = 1.0 + generator.choice([-0.3, 0.3]) * np.exp(-part / settling)
        right = (WARN,)
    else:
        shape = 1.0 + float(generator.choice([-1.0, 1.0])) * generator.uniform(0.1, 0.4) * (part - 0.5)
        right = (WITHHOLD,)
    motion = imposed(rig, float(generator.uniform(-1.0, 1.0)), speed * shape)
    log = rig.logged("velocity/unsteady.csv", "constant_velocity", motion, generator)
    return _one(log, rig, *right, stage="evidence")


def stick_slip(generator: Generator) -> Injected:
    """A slow "constant" speed that is stick and slip."""
    rig = random_rig(generator)
    speed = 0.3 * rig.velocity * float(generator.choice([-1.0, 1.0]))
    speed = math.copysign(max(abs(speed), 40.0 * rig.resolution), speed)
    periods = int(generator.integers(6, 30))
    sticking = generator.uniform(0.15, 0.7)
    duration = max(3.0, 60.0 * periods * rig.period, 60.0 * periods * rig.resolution / abs(speed))
    time = np.arange(0.0, duration, rig.period)
    phase = (time * periods / duration + generator.random()) % 1.0
    slip = np.clip((phase - sticking) / (1.0 - sticking), 0.0, 1.0)
    velocity = speed / (1.0 - sticking) * 2.0 * np.sin(math.pi * slip) ** 2
    motion = imposed(rig, float(generator.uniform(-1.0, 1.0)), velocity)
    rising = np.sign(speed) * rig.static * (0.6 + 0.4 * phase / sticking)
    motion = replace(motion, torque=np.where(velocity == 0.0, rising, motion.torque))
    log = rig.logged("velocity/slow.csv", "constant_velocity", motion, generator)
    return _one(log, rig, WITHHOLD, stage="evidence")


def small_campaign(rig: Rig, generator: Generator) -> Campaign:
    """Six speeds each way, a ramp log each way, two multisines."""
    speeds = rig.velocity * np.geomspace(0.2, 30.0, 6)
    logs = [steady_log(rig, s * float(v), generator, duration=None) for s in (1.0, -1.0) for v in speeds]
    logs += [ramp_log(rig, s * 0.45 * rig.static, generator, ramps=2) for s in (1.0, -1.0)]
    return Campaign(rig, (*logs, *multisine_logs(rig, generator)[:2]))


def position(generator: Generator) -> Injected:
    """A torque that depends on the place, of 3 to 10 % of F_c."""
    rig = random_rig(generator)
    waves = generator.uniform(2.0, 9.0) / (15.0 * rig.velocity)
    amplitude = generator.uniform(0.03, 0.1) * rig.coulomb
    rig = replace(
        rig, ripple=TorqueRipple(amplitude, 2.0 * math.pi * waves, float(generator.uniform(0.0, 6.0)))
    )
    return Injected(small_campaign(rig, generator), (WARN,), "evidence")


# What the fit shows ---------------------------------------------------------------------------------------


def offset(generator: Generator) -> Injected:
    """A constant offset of the torque of 3 to 15 % of F_c, on a rig with one law both ways."""
    rig = _alike(random_rig(generator))
    size = float(generator.choice([-1.0, 1.0])) * generator.uniform(0.03, 0.15) * rig.coulomb
    return _everywhere(clean_campaign(generator, rig), lambda log: replace(log, torque=log.torque + size))


def drift(generator: Generator) -> Injected:
    """Friction that falls by 8 to 25 % over the campaign as the rig warms up."""
    rig = random_rig(generator)
    whole = clean_campaign(generator, rig)
    order = generator.permutation(len(whole.logs))
    loss = generator.uniform(0.08, 0.25)
    logs = []
    for place, number in enumerate(order.tolist()):
        log = whole.logs[number]
        warm = 1.0 - loss * place / (order.size - 1)
        driven = log.protocol == "frequency_response"
        logs.append(log if driven else replace(log, torque=log.torque * warm))
    return Injected(
        Campaign(rig, tuple(logs)), (WARN,), "fit", also=("E-NOSTRIBECK", "E-LOWSPEED", "E-BOUND")
    )


def low_speed(generator: Generator) -> Injected:
    """No speed under 7 v_s, and no ramps."""
    rig = random_rig(generator)
    speeds = rig.velocity * np.geomspace(7.0, 60.0, 9)
    logs = [steady_log(rig, s * float(v), generator) for s in (1.0, -1.0) for v in speeds]
    logs += multisine_logs(rig, generator)
    return Injected(
        Campaign(rig, tuple(logs)), (WITHHOLD,), "fit", also=("E-NOSTRIBECK", "E-BOUND", "E-LOCAL")
    )


def direction(generator: Generator) -> Injected:
    """All runs of one direction are missing."""
    whole = clean_campaign(generator)
    side = float(generator.choice([-1.0, 1.0]))
    there = [log for log in whole.logs if log.protocol == "frequency_response" or _way(log) * side > 0.0]
    return Injected(replace(whole, logs=tuple(there)), (WITHHOLD,), "fit")


def no_stribeck(generator: Generator) -> Injected:
    """Friction that does not rise towards rest."""
    rig = random_rig(generator)

    def flat(curve: StribeckCurve) -> StribeckCurve:
        return replace(curve, static_torque=curve.coulomb_torque)

    friction = rig.robot.friction
    robot = OneLinkRobot(
        rig.robot.inertia, StribeckFriction(flat(friction.positive), flat(friction.negative))
    )
    return Injected(clean_campaign(generator, replace(rig, robot=robot)), (WITHHOLD,), "fit")


def at_bound(generator: Generator) -> Injected:
    """Friction that falls at high speeds: the damping would have to be negative."""
    whole = clean_campaign(generator)
    rig = whole.rig
    loss = generator.uniform(0.15, 0.3)

    def falling(log: Run) -> Run:
        if log.protocol != "constant_velocity":
            return log
        part = abs(_way(log) / (log.time[-1] - log.time[0])) / (30.0 * rig.velocity)
        damping = rig.robot.mean().friction.positive.viscous_damping * 30.0 * rig.velocity
        fall = (damping + loss * rig.coulomb) * part
        return replace(log, torque=log.torque - math.copysign(fall, _way(log)))

    return _everywhere(whole, falling, WITHHOLD)


def few(generator: Generator) -> Injected:
    """Two speeds and a ramp each way, one fewer than the law's parameters and three more allow."""
    rig = random_rig(generator)
    speeds = rig.velocity * np.geomspace(0.3, 20.0, int(generator.integers(2, 4)))
    logs = [steady_log(rig, s * float(v), generator) for s in (1.0, -1.0) for v in speeds]
    logs += [ramp_log(rig, s * 0.45 * rig.static, generator, ramps=2) for s in (1.0, -1.0)]
    return Injected(Campaign(rig, (*logs, *multisine_logs(rig, generator))), (REFUSE,), "fit")


def speed_error(generator: Generator) -> Injected:
    """Slow runs of 30 to 45 counts where the curve is steep, under a quiet torque."""
    rig = random_rig(generator)
    rig = replace(rig, fine=False, noise=0.002 * rig.coulomb)
    speeds = rig.velocity * np.geomspace(0.15, 30.0, 10)
    logs = []
    for side in (1.0, -1.0):
        for speed in speeds.tolist():
            slow = speed < 2.0 * rig.velocity
            duration = generator.uniform(30.0, 45.0) * rig.resolution / speed if slow else None
            if slow and duration is not None and duration < 40.0 * rig.period:
                duration = 40.0 * rig.period
            logs.append(steady_log(rig, side * speed, generator, duration=duration))
    logs += [ramp_log(rig, s * 0.45 * rig.static, generator) for s in (1.0, -1.0)]
    return Injected(
        Campaign(rig, (*logs, *multisine_logs(rig, generator))),
        (WARN,),
        "fit",
        also=("E-LOWSPEED", "E-QUANT"),
    )


def lack_of_fit(generator: Generator) -> Injected:
    """Friction with a bump that no Stribeck law has, at speeds that were each run three times."""
    rig = random_rig(generator)
    size = generator.uniform(0.1, 0.2) * rig.coulomb
    centre = rig.velocity * generator.uniform(6.0, 12.0)
    logs = []
    for side, speed, again in itertools.product((1.0, -1.0), np.geomspace(0.2, 30.0, 8).tolist(), range(3)):
        name = f"velocity/{side * speed:.4g}_{again}.csv"
        log = steady_log(rig, side * speed * rig.velocity, generator, name=name)
        bump = size * math.exp(-((math.log(speed * rig.velocity / centre) / 0.6) ** 2))
        logs.append(replace(log, torque=log.torque + math.copysign(bump, side)))
    logs += [ramp_log(rig, s * 0.45 * rig.static, generator) for s in (1.0, -1.0)]
    return Injected(
        Campaign(rig, (*logs, *multisine_logs(rig, generator))),
        (WARN,),
        "fit",
        also=("E-BOUND", "E-LOWSPEED", "E-NOSTRIBECK"),
    )


def two_minima(generator: Generator) -> Injected:
    """A friction that falls in two steps far apart: a Stribeck velocity explains either as well."""
    rig = replace(random_rig(generator), fine=False)
    speeds = np.geomspace(0.06, 300.0, 24)
    torques = _two_steps(speeds, generator)
    logs = []
    for side, (speed, torque) in itertools.product((1.0, -1.0), zip(speeds, torques, strict=True)):
        log = steady_log(rig, side * float(speed) * rig.velocity, generator)
        plain = float(np.median(np.abs(log.torque)))
        logs.append(replace(log, torque=log.torque + side * (rig.coulomb * float(torque) - plain)))
    campaign = Campaign(rig, (*logs, *multisine_logs(rig, generator)))
    also = ("E-LOWSPEED", "E-BOUND", "E-NOSTRIBECK", "E-LACKOFFIT")
    return Injected(campaign, (WARN, WITHHOLD), "fit", also=also)


def _two_steps(speeds: FloatArray, generator: Generator) -> FloatArray:
    """Torques in F_c at speeds (n,) in v_s, the steps so high that both minima over v_s are equally deep."""
    height = generator.uniform(0.4, 0.8)
    early = np.exp(-((speeds / 0.3) ** 4))
    late = np.exp(-((speeds / 30.0) ** 4))
    grid = np.geomspace(0.06, 100.0, 80)
    bases = [np.column_stack((np.ones_like(speeds), np.exp(-speeds / v), speeds / 300.0)) for v in grid]

    def torques(part: float) -> FloatArray:
        return np.asarray(1.0 + 3e-4 * speeds + height * (part * early + (1.0 - part) * late))

    def favour(part: float) -> float:
        """By how much the late step is explained worse than the early one."""
        misfit = np.array([nnls(basis, torques(part))[1] for basis in bases])
        return float(misfit[grid > 3.0].min() - misfit[grid < 3.0].min())

    return torques(float(brentq(favour, 0.1, 0.9, xtol=1e-4)))


def missing_tests(generator: Generator) -> Injected:
    """No ramps, or no frequency response."""
    whole = clean_campaign(generator)
    protocol = generator.choice(["breakaway", "frequency_response"])
    logs = tuple(log for log in whole.logs if log.protocol != protocol)
    return Injected(replace(whole, logs=logs), (WARN,), "fit", also=("E-LOWSPEED",))


def _alike(rig: Rig) -> Rig:
    return replace(rig, robot=rig.robot.mean())


def _way(log: Run) -> float:
    """Signed travel [rad]."""
    return float(log.position[-1] - log.position[0])


def _everywhere(
    whole: Campaign,
    change: Callable[[Run], Run],
    *severities: Severity,
    also: tuple[str, ...] = (),
) -> Injected:
    logs = tuple(change(log) for log in whole.logs)
    return Injected(replace(whole, logs=logs), severities or (WARN,), "fit", also)


FAULTS: Final[Mapping[str, Callable[[Generator], Injected]]] = {
    "E-WRAP": wrap,
    "E-SPIKE": spike,
    "E-QUANT": quantisation,
    "E-GAP": gap,
    "E-CLOCK": clock,
    "E-SAT": saturation,
    "E-OFFSET": offset,
    "E-POSITION": position,
    "E-DRIFT": drift,
    "E-UNIT": unit,
    "E-SIGN": sign,
    "E-LOWSPEED": low_speed,
    "E-CREEP": creep,
    "E-STEADY": unsteady,
    "E-STICKSLIP": stick_slip,
    "E-DIRECTION": direction,
    "E-NOSTRIBECK": no_stribeck,
    "E-BOUND": at_bound,
    "E-FEW": few,
    "E-SPEEDERR": speed_error,
    "E-LACKOFFIT": lack_of_fit,
    "E-LOCAL": two_minima,
    "E-TESTS": missing_tests,
}

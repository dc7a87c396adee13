r"""The loop as a rig runs it: sampled, quantised, held.

At sample k, a sample period h after the last one, the controller

1. measures q_k, rounded to encoder counts;
2. estimates v_hat = z + L q_k (z is set so that v_hat = 0 at the first sample);
3. commands u_k = n1 (q_r - q_k) - n2 v_hat + r F^(v_hat), with F^(0) = 0, kept within the torque limit;
4. steps z with q_k and u_c = n1 (q_r - q_k) - n2 v_hat held (`compensation.observer`).

The motor holds u_k until the next sample, `delay` samples later than it was measured for; before the first
command arrives the torque is 0. Between samples the robot moves exactly (`ident.response`). With h and the
resolution going to 0 this is inclusion (8). A rig differs from it by a few per cent where it matters: the
encoder's counts move the onset of limit cycling more than the sample period does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from compensation.controller import Controller
from compensation.observer import euler_change, exact_change
from ident.model.friction import ModelError
from ident.model.robot import OneLinkRobot
from ident.response import NO_RIPPLE, TorqueRipple, advance_with_ripple, law_array, plant_array
from ident.simulation.compiled import compiled

FloatArray = NDArray[np.float64]
_Settings = tuple[float, float, bool, int, float, float]  # h, resolution, exact?, delay, limit, reference
T = TypeVar("T")
R = TypeVar("R")


class Map(Protocol):
    """Python's `map`, or anything that keeps its order: a thread pool's, say; the kernels release the GIL."""

    def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterable[R]:
        """`function` of each item, in order."""
        ...


@dataclass(frozen=True)
class Sampling:
    """How the controller runs. Raises `ModelError` for what no controller can be."""

    period: float  # h [s]
    resolution: float = 0.0  # one encoder count [rad]; 0: not rounded
    observer_update: Literal["euler", "exact"] = "euler"
    delay: int = 0  # samples between measuring and acting
    torque_limit: float = math.inf  # [N m]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period) and self.period > 0):
            raise ModelError(f"sample period is {self.period} s: a sampled loop needs one > 0")
        if not (math.isfinite(self.resolution) and self.resolution >= 0):
            raise ModelError(f"encoder resolution is {self.resolution} rad a count: it must be >= 0")
        if self.delay < 0:
            raise ModelError(f"delay is {self.delay} samples: it must be >= 0")
        if not self.torque_limit > 0:
            raise ModelError(f"torque limit is {self.torque_limit} N m: it must be > 0")


@dataclass(frozen=True)
class SampledRun:
    """A run at its sampling instants; every array is (n,)."""

    time: FloatArray  # [s]
    position: FloatArray  # true q [rad]
    measured: FloatArray  # q as the encoder gave it [rad]
    velocity: FloatArray  # true v [rad/s]
    estimate: FloatArray  # v_hat [rad/s]
    torque: FloatArray  # [N m], held by the motor from this sample to the next


@compiled
def _compensation(estimate: float, model: FloatArray) -> float:
    """F^(v_hat) [N m], 0 at 0."""
    if estimate == 0.0:
        return 0.0
    first = 1 if estimate > 0.0 else 6
    ratio = abs(estimate) / model[first + 2]
    shape = model[first + 4]
    fading = math.exp(-ratio if shape == 1.0 else -math.pow(ratio, shape))
    magnitude = model[first + 1] + (model[first] - model[first + 1]) * fading
    return float(magnitude if estimate > 0.0 else -magnitude)


@compiled
def _run(
    plant: FloatArray,
    controller: FloatArray,
    settings: _Settings,
    start: tuple[float, float],
    rows: FloatArray,
) -> None:
    """Fill `rows` (5, n), measured first, or (1, m) with every so-many-th measured position only.

    `controller` (15,) holds n1, n2, L, r and the `law_array` of its model.
    """
    period, resolution, exact, delay, limit, reference = settings
    n1, n2, gain, scale = controller[0], controller[1], controller[2], controller[3]
    model = controller[4:]
    position, velocity = start
    pending = np.zeros(delay + 1)
    z = 0.0
    for k in range(rows.shape[1]):
        measured = resolution * np.rint(position / resolution) if resolution > 0.0 else position
        if k == 0:
            z = -gain * measured
        estimate = z + gain * measured
        feedback = n1 * (reference - measured) - n2 * estimate
        command = feedback + scale * _compensation(estimate, model)
        pending[k % (delay + 1)] = min(max(command, -limit), limit)
        torque = pending[(k + 1) % (delay + 1)]
        rows[0, k] = measured
        if rows.shape[0] == 5:
            rows[1, k], rows[2, k], rows[3, k], rows[4, k] = position, velocity, estimate, torque
        if exact:
            z += exact_change(estimate, feedback, period, gain, model)
        else:
            z += euler_change(estimate, feedback, period, gain, model)
        position, velocity = advance_with_ripple(position, velocity, torque, period, plant)


def run_sampled(
    robot: OneLinkRobot,
    controller: Controller,
    sampling: Sampling,
    *,
    start: tuple[float, float],
    duration: float,
    reference: float = 0.0,
    ripple: TorqueRipple = NO_RIPPLE,
) -> SampledRun:
    """One run from q [rad] and v [rad/s] for `duration` [s], towards the `reference` q_r [rad].

    The last sample is the last one not after `duration`. Raises `ModelError` for a start, duration or
    reference that is not finite.
    """
    rows = _checked_rows(5, start, duration, sampling, reference)
    _run(
        plant_array(robot, ripple),
        _controller_array(controller),
        _settings(sampling, reference),
        (float(start[0]), float(start[1])),
        rows,
    )
    time = sampling.period * np.arange(rows.shape[1], dtype=np.float64)
    return SampledRun(
        time=time, measured=rows[0], position=rows[1], velocity=rows[2], estimate=rows[3], torque=rows[4]
    )


def run_many(
    robots: Sequence[OneLinkRobot],
    controllers: Sequence[Controller],
    sampling: Sampling,
    *,
    starts: Sequence[tuple[float, float]],
    duration: float,
    reference: float = 0.0,
    map: Map = map,
) -> FloatArray:
    """Measured positions of many runs, (m, n) [rad], at 0, h, 2 h, ...

    Parameters
    ----------
    robots, controllers, starts
        One for each of the m runs, or a single one for all of them.
    sampling, duration, reference
        As in `run_sampled`, for all runs.
    map
        How to spread the runs: Python's own, or a thread pool's (the kernel releases the interpreter lock).

    Raises `ModelError` where the numbers of robots, controllers and starts do not fit, or as `run_sampled`.
    """
    m = max(len(robots), len(controllers), len(starts))
    for name, values in (("robots", robots), ("controllers", controllers), ("starts", starts)):
        if len(values) not in (1, m):
            raise ModelError(f"{len(values)} {name} for {m} runs: give one for each, or one for all")
    settings = _settings(sampling, reference)
    rows = [_checked_rows(1, starts[i % len(starts)], duration, sampling, reference) for i in range(m)]

    def play(i: int) -> FloatArray:
        start = starts[i % len(starts)]
        plant = plant_array(robots[i % len(robots)])
        carried = _controller_array(controllers[i % len(controllers)])
        _run(plant, carried, settings, (float(start[0]), float(start[1])), rows[i])
        return np.asarray(rows[i][0])

    return np.array(list(map(play, range(m))))


def _checked_rows(
    count: int, start: tuple[float, float], duration: float, sampling: Sampling, reference: float
) -> FloatArray:
    if not all(map(math.isfinite, (*start, duration, reference))) or duration < 0:
        raise ModelError(
            f"start {start}, duration {duration} s, reference {reference} rad: finite, and duration >= 0"
        )
    return np.empty((count, math.floor(duration / sampling.period * (1 + 1e-12)) + 1))


def _controller_array(controller: Controller) -> FloatArray:
    gains = controller.gains
    return np.array(
        [
            gains.proportional,
            gains.derivative,
            gains.observer,
            gains.compensation,
            *law_array(controller.model),
        ]
    )


def _settings(sampling: Sampling, reference: float) -> _Settings:
    return (
        float(sampling.period),
        float(sampling.resolution),
        sampling.observer_update == "exact",
        int(sampling.delay),
        float(sampling.torque_limit),
        float(reference),
    )

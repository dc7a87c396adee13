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

A run ends before its time in two ways, both certain. At rest for good: the link stands and a step changes
neither z nor what the motor waits for, bit for bit, so no later sample can differ. Run away: a controller
that samples too slowly for its own gains (Euler's observer diverges from L h = 2 on) lets its estimate grow
without bound; a million times faster than anything in the loop is no motion of a rig any more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from compensation.controller import Controller
from compensation.observer import euler_change, exact_change
from ident.model.friction import ModelError
from ident.model.numbers import (
    is_count,
    is_number,
    is_number_or_inf,
    is_one_of,
    keep_floats,
    real_array,
    shown,
)
from ident.model.robot import OneLinkRobot
from ident.response import NO_RIPPLE, TorqueRipple, advance_with_ripple, law_array, plant_array
from ident.simulation.compiled import compiled, owning

FloatArray = NDArray[np.float64]
_Settings = tuple[float, float, bool, int, float, float]  # h, resolution, exact?, delay, limit, reference
_FASTEST: Final = 1e6  # times the speeds of the loop: an estimate beyond has run away
ENDS: Final = ("time reached", "at rest for good", "runs away")
_REACHED, _AT_REST, _AWAY = range(3)
ObserverUpdate = Literal["euler", "exact"]
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
    observer_update: ObserverUpdate = "euler"
    delay: int = 0  # samples between measuring and acting
    torque_limit: float = math.inf  # [N m]

    def __post_init__(self) -> None:
        if not (is_number(self.period) and self.period > 0):
            raise ModelError(f"sample period is {self.period!r} s: a finite h > 0 (eqs 5-7, as sampled)")
        if not (is_number(self.resolution) and self.resolution >= 0):
            raise ModelError(
                f"encoder resolution is {self.resolution!r} rad a count: finite, >= 0 (eqs 5-7, as sampled)"
            )
        if not is_one_of(self.observer_update, get_args(ObserverUpdate)):
            update = shown(self.observer_update)
            raise ModelError(f"observer_update is {update}: 'euler' or 'exact', for eq (7)")
        if not (is_count(self.delay) and self.delay >= 0):
            raise ModelError(f"delay is {self.delay!r}: a whole number of samples >= 0 (eqs 5-7, as sampled)")
        if not (is_number_or_inf(self.torque_limit) and self.torque_limit > 0):
            raise ModelError(
                f"torque limit is {self.torque_limit!r} N m: > 0, inf for none (eqs 5-7, as sampled)"
            )
        keep_floats(self, ("period", "resolution", "torque_limit"))


@dataclass(frozen=True)
class SampledRun:
    """A run at its sampling instants; every array is (n,)."""

    time: FloatArray  # [s]
    position: FloatArray  # true q [rad]
    measured: FloatArray  # q as the encoder gave it [rad]
    velocity: FloatArray  # true v [rad/s]
    estimate: FloatArray  # v_hat [rad/s]
    torque: FloatArray  # [N m], held by the motor from this sample to the next
    end: str = ENDS[_REACHED]  # of `ENDS`; a run that ran away is cut short there


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


@owning
def _run(
    plant: FloatArray,
    controller: FloatArray,
    settings: _Settings,
    memory: FloatArray,
    pending: FloatArray,
    rows: FloatArray,
) -> tuple[int, int]:
    """Go on from `memory` and `pending` and fill `rows` (5, n), measured first, or (1, n), measured only.

    `controller` (15,) holds n1, n2, L, r and the `law_array` of its model; `memory` (5,) q, v, z, the number
    of samples so far and the speed of an estimate that has run away; `pending` (delay + 1,) the torques on
    their way. Returns how many samples were made and the number of the end in `ENDS`; after a rest for good
    all rows are filled.
    """
    period, resolution, exact, delay, limit, reference = settings
    n1, n2, gain, scale = controller[0], controller[1], controller[2], controller[3]
    model = controller[4:]
    position, velocity, z, fastest = memory[0], memory[1], memory[2], memory[4]
    first = int(memory[3])
    made, end = rows.shape[1], 0
    for j in range(rows.shape[1]):
        k = first + j
        measured = resolution * np.rint(position / resolution) if resolution > 0.0 else position
        if k == 0:
            z = -gain * measured
        estimate = z + gain * measured
        if not abs(estimate) <= fastest:
            made, end = j, 2
            break
        feedback = n1 * (reference - measured) - n2 * estimate
        command = feedback + scale * _compensation(estimate, model)
        pending[k % (delay + 1)] = min(max(command, -limit), limit)
        torque = pending[(k + 1) % (delay + 1)]
        rows[0, j] = measured
        if rows.shape[0] == 5:
            rows[1, j], rows[2, j], rows[3, j], rows[4, j] = position, velocity, estimate, torque
        before, place, speed = z, position, velocity
        if exact:
            z += exact_change(estimate, feedback, period, gain, model)
        else:
            z += euler_change(estimate, feedback, period, gain, model)
        position, velocity = advance_with_ripple(position, velocity, torque, period, plant)
        still = speed == 0.0 and velocity == 0.0 and position == place and z == before
        if still and np.all(pending == torque):
            for row in range(rows.shape[0]):
                rows[row, j + 1 :] = rows[row, j]
            made, end = j + 1, 1
            break
    memory[0], memory[1], memory[2], memory[3] = position, velocity, z, first + made
    return made, end


class LongRun:
    """A run that is watched stretch by stretch, each going on where the last one ended."""

    def __init__(
        self,
        robot: OneLinkRobot,
        controller: Controller,
        sampling: Sampling,
        *,
        start: tuple[float, float],
        reference: float = 0.0,
        ripple: TorqueRipple = NO_RIPPLE,
    ) -> None:
        """From q [rad] and v [rad/s]; raises `ModelError` for a start or reference that is not finite."""
        x0 = real_array(start)
        if x0 is None or x0.shape != (2,) or not np.all(np.isfinite(x0)):
            raise ModelError(f"start is {shown(start)}: two finite numbers q [rad], v [rad/s] (eq 1)")
        if not is_number(reference):
            raise ModelError(f"reference is {reference!r}: a finite q_r [rad] (eq 5)")
        gains, model = controller.gains, controller.model.friction
        turning = math.sqrt(gains.proportional / robot.inertia)
        speeds = (model.positive.stribeck_velocity, model.negative.stribeck_velocity, abs(start[1]))
        fastest = _FASTEST * (sum(speeds) + turning * abs(reference - start[0]))
        self._plant, self._controller = plant_array(robot, ripple), _controller_array(controller)
        self._settings = _settings(sampling, reference)
        self._memory = np.array([start[0], start[1], 0.0, 0.0, fastest])
        self._pending = np.zeros(sampling.delay + 1)
        self.end = ENDS[_REACHED]

    def fill(self, rows: FloatArray) -> int:
        """The next samples into `rows` (1, n), measured only, or (5, n); returns how many were run.

        A run at rest for good is filled up with its last sample; one that ran away leaves the rows after it
        as they are. Both go on no further. Raises `ModelError` for a run that has ended, or other rows.
        """
        if not (
            isinstance(rows, np.ndarray)
            and rows.dtype == np.float64
            and rows.ndim == 2
            and rows.shape[0] in (1, 5)
        ):
            raise ModelError(
                f"rows are {shown(rows)}: an array of floats, (1, n) or (5, n) (eqs 5-7, as sampled)"
            )
        if self.end != ENDS[_REACHED]:
            raise ModelError(f"a run that has ended ({self.end}) does not go on")
        made, end = _run(self._plant, self._controller, self._settings, self._memory, self._pending, rows)
        self.end = ENDS[end]
        return int(made)


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

    The last sample is the last one not after `duration`, or before the controller runs away. Raises
    `ModelError` for a start, duration or reference that is not finite.
    """
    rows = _rows(5, duration, sampling)
    run = LongRun(robot, controller, sampling, start=start, reference=reference, ripple=ripple)
    made = run.fill(rows)
    if run.end == ENDS[_AWAY]:
        rows = rows[:, :made]
    time = sampling.period * np.arange(rows.shape[1], dtype=np.float64)
    return SampledRun(
        time=time,
        measured=rows[0],
        position=rows[1],
        velocity=rows[2],
        estimate=rows[3],
        torque=rows[4],
        end=run.end,
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
    """Measured positions of many runs, (m, n) [rad], at 0, h, 2 h, ...; NaN from where a run has run away.

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
    given = (("robots", robots), ("controllers", controllers), ("starts", starts))
    for name, values in given:
        if not isinstance(values, (Sequence, np.ndarray)):
            raise ModelError(f"{name} are {shown(values)}: a list, one for each run (eqs 5-7, as sampled)")
    m = max(len(robots), len(controllers), len(starts), 1)
    for name, values in given:
        if len(values) not in (1, m):
            raise ModelError(
                f"{len(values)} {name} for {m} runs: give one for each, or one for all (eqs 5-7, as sampled)"
            )
    runs = [
        LongRun(
            robots[i % len(robots)],
            controllers[i % len(controllers)],
            sampling,
            start=starts[i % len(starts)],
            reference=reference,
        )
        for i in range(m)
    ]
    rows = [_rows(1, duration, sampling) for _ in runs]

    def play(i: int) -> FloatArray:
        made = runs[i].fill(rows[i])
        if runs[i].end == ENDS[_AWAY]:
            rows[i][0, made:] = math.nan
        return np.asarray(rows[i][0])

    return np.array(list(map(play, range(m))))


def _rows(count: int, duration: float, sampling: Sampling) -> FloatArray:
    if not (is_number(duration) and duration >= 0):
        raise ModelError(f"duration is {duration!r}: a finite number of seconds >= 0 (eqs 5-7, as sampled)")
    samples = float(duration) / sampling.period * (1 + 1e-12)
    try:
        return np.empty((count, math.floor(samples) + 1))
    except (MemoryError, OverflowError, ValueError):  # of numpy: more than an array can have
        raise ModelError(
            f"duration is {duration!r} s: {samples:.3g} samples of {sampling.period} s are more than there "
            "is memory for (eqs 5-7, as sampled)"
        ) from None


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

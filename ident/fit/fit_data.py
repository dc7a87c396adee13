"""The data of the joint fit, as values and as the flat arrays of the compiled fits."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.evidence.momentum import NODES, Momentum
from ident.fit.bounded_least_squares import Box, Workspace, workspace
from ident.fit.law_model import SIGN, LawModel
from ident.fit.normal_equations import OFFSET, ROW, Motions, Problem, Steady
from ident.fit.ramp_rates import RateTrend

LEAST_SHAPE, LARGEST_SHAPE = 0.05, 8.0  # of beta
UNFELT = 1e-2  # of the slowest speed: a Stribeck velocity that no run feels, e^-100
LARGEST_EFFECT = 100.0  # times the largest torque seen: a dF that no speed bounds stops there
STRAIGHT = 1e3  # times the fastest speed: one under which the curve is a line


@dataclass(frozen=True)
class FitData:
    """All that is fitted, as magnitudes along the motion. n steady runs, m breakaways."""

    model: LawModel
    run_direction: NDArray[np.int64]  # (n,) +1 or -1
    speed: FloatArray  # (n,) [rad/s]
    torque: FloatArray  # (n,) [N m]
    acceleration: FloatArray  # (n,) along the motion [rad/s^2]
    run_stderr: FloatArray  # (n,) [N m]
    start_direction: NDArray[np.int64]  # (m,)
    start_torque: FloatArray  # (m,) at the onset, at zero ramp rate, shifted by censored ones [N m]
    start_stderr: FloatArray  # (m,) [N m]
    momenta: tuple[Momentum, ...]
    whitening: tuple[FloatArray, ...]  # (k, k) for each momentum: the inverse square root of its covariance
    inertia: tuple[float, float] | None  # from the frequency response, with its standard error
    # What a swinging speed adds to the mean torque of a curved law, taken off `torque` already.
    sway: FloatArray = field(default_factory=lambda: np.zeros(()))  # (n,) [N m]
    trend: RateTrend | None = None  # over the ramp rates, that the start torques are less of
    # (g, n + m): of the variance of each run, then each breakaway, the part that each estimated spread makes
    shares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))  # [-]
    motion_dof: float = np.inf  # behind the scale of the momenta's covariance [-]
    longest: float = STRAIGHT  # v_s that the fit may try, in parts of the fastest speed [-]
    inertia_dof: float = np.inf  # behind the standard error of the frequency response's inertia [-]

    @property
    def has_inertia(self) -> bool:
        """Whether anything in the data knows J."""
        return self.inertia is not None or bool(self.momenta)

    @property
    def free(self) -> tuple[str, ...]:
        """The parameters that are fitted."""
        return tuple(name for name in self.model.names if self.model.is_free(name, inertia=self.has_inertia))

    @cached_property
    def problem(self) -> Problem:
        """The data as the compiled fits see them."""
        return flat_problem(self)

    @cached_property
    def box(self) -> Box:
        """Where the compiled parameters may lie: a Stribeck velocity from one that no run feels to a line."""
        names, free = self.model.names, set(self.free)
        low, high = np.zeros(len(names)), np.full(len(names), np.inf)
        reach = np.full(len(names), np.inf)
        low[OFFSET] = -np.inf
        for place, name in enumerate(names):
            if name.endswith("stribeck_velocity"):
                low[place] = np.log(UNFELT * float(np.min(self.speed)))
                high[place] = np.log(self.longest * float(np.max(self.speed)))
                reach[place] = 1.5
            elif name.endswith("stribeck_torque"):
                high[place] = LARGEST_EFFECT * float(np.max(np.abs(self.torque)))
            elif name.endswith("stribeck_shape"):
                low[place], high[place], reach[place] = LEAST_SHAPE, LARGEST_SHAPE, 1.0
        return Box(low, high, reach, np.array([name in free for name in names]))

    @cached_property
    def work(self) -> Workspace:
        """Memory of the compiled fits."""
        return workspace(len(self.model.names))


def flat_problem(data: FitData) -> Problem:
    """Runs and then breakaways, motions, and the inertia."""
    inertia = (0.0, 0.0) if data.inertia is None else (data.inertia[0], 1.0 / data.inertia[1])
    return Problem(
        steady=_steady(data),
        motions=_motions(data),
        inertia=np.array(inertia),
        combination=np.zeros(len(data.model.names)),
        tie=np.zeros(2),
        row=np.zeros(ROW),
    )


def _steady(data: FitData) -> Steady:
    sign = np.concatenate([data.run_direction, data.start_direction])
    speed = np.concatenate([data.speed, np.zeros(data.start_torque.size)])
    return Steady(
        sign=sign.astype(np.float64),
        block=_blocks(data, sign),
        speed=speed,
        log_speed=_log(speed),
        torque=np.concatenate([data.torque, data.start_torque]),
        acceleration=np.concatenate([data.acceleration, np.zeros(data.start_torque.size)]),
        weight=1.0 / np.concatenate([data.run_stderr, data.start_stderr]),
    )


def _motions(data: FitData) -> Motions:
    sizes = [motion.gain.size for motion in data.momenta]
    widest, windows = max(sizes, default=1), sum(sizes)
    first = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64)
    whitened = np.zeros((4, windows))
    whitening = np.zeros((windows, widest))
    speed = np.zeros((windows, NODES))
    for motion, own, begun in zip(data.momenta, data.whitening, first[:-1], strict=True):
        part = slice(begun, begun + motion.gain.size)
        whitened[:, part] = np.array([motion.impulse, motion.duration, motion.travel, motion.gain]) @ own.T
        whitening[part, : motion.gain.size] = own * motion.duration
        speed[part] = motion.nodes
    sign = np.array([motion.direction for motion in data.momenta], dtype=np.int64)
    return Motions(
        sign=sign.astype(np.float64),
        block=_blocks(data, sign),
        weight=np.ones(sign.size),
        first=first,
        impulse=whitened[0].copy(),
        duration=whitened[1].copy(),
        travel=whitened[2].copy(),
        gain=whitened[3].copy(),
        whitening=whitening,
        speed=speed,
        log_speed=_log(speed),
        fading=np.zeros((3, widest)),
    )


def _blocks(data: FitData, sign: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where the parameters begin that each datum depends on."""
    blocks = np.zeros(sign.size, dtype=np.int64)
    for direction in data.model.directions:
        law = data.model.law_of(direction)
        if law is not None:
            blocks[sign == SIGN[direction]] = data.model.place(law)
    return blocks


def _log(speed: FloatArray) -> FloatArray:
    """ln of speeds >= 0; of 0, of which no kernel takes it, 0."""
    return np.asarray(np.log(np.where(speed > 0, speed, 1.0)))

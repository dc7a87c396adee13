"""The set-point runs of a virtual rig: the closed loop of figure 10, at every gain from every start.

The loop is the one that predictions play (`compensation.sampled_loop`), with the campaign's own gains;
where the campaign does not say which model the controller used, it is the mean of the true robot's two
directions. A gain that the campaign expects in each log's metadata is written there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from compensation.controller import Controller, Gains
from compensation.sampled_loop import Sampling, run_sampled
from ident.model.published import DERIVATIVE_GAIN, OBSERVER_GAIN, PROPORTIONAL_GAIN
from ident.model.robot import OneLinkRobot
from ident.response import TorqueRipple
from pipelines.settings.set_point import FromMetadata, Gain, SetPointSettings
from pipelines.settings.virtual_rig import VirtualRig
from pipelines.virtual.bench import Bench, Motion
from pipelines.virtual.protocols import Run, rounded

_FAR, _NEAR = 0.442, 0.074  # of F_s / n1: 0.6 and 0.1 rad on Table 1's robot


def set_points(
    rig: VirtualRig, settings: SetPointSettings, bench: Bench, ripple: TorqueRipple
) -> Iterator[Run]:
    """Every r from every start, or the logs that the campaign's table of r names."""
    truth = rig.true_robot()
    model = truth.mean() if settings.compensator is None else settings.compensator.model(truth)
    sampling = Sampling(
        settings.sample_period or rig.sample_period,
        resolution=bench.resolution,
        observer_update=settings.observer_update,
        delay=settings.delay,
        torque_limit=bench.torque_limit,
    )
    for log, r, start in _cases(rig, settings, truth):
        gains = Gains(
            proportional=_value(settings.proportional_gain, log, PROPORTIONAL_GAIN),
            derivative=_value(settings.derivative_gain, log, DERIVATIVE_GAIN),
            observer=_value(settings.observer_gain, log, OBSERVER_GAIN),
            compensation=r,
        )
        swing = 2.0 * math.pi * math.sqrt(truth.inertia / gains.proportional)
        play = partial(
            _played,
            truth,
            Controller(gains, model),
            sampling,
            start=start,
            duration=rig.duration or max(10.0, round(19.0 * swing)),
            ripple=ripple,
        )
        metadata = _metadata(settings, gains) | {"start": f"{start:g}"}
        yield Run(f"r{r:.3f}_{'n' if start < 0 else 'p'}{abs(start):g}", metadata, play, log)


def _played(
    truth: OneLinkRobot,
    controller: Controller,
    sampling: Sampling,
    _: np.random.Generator,
    *,
    start: float,
    duration: float,
    ripple: TorqueRipple,
) -> Motion:
    run = run_sampled(truth, controller, sampling, start=(start, 0.0), duration=duration, ripple=ripple)
    return Motion(run.position, run.velocity, run.torque, np.zeros(run.time.size))


def _cases(
    rig: VirtualRig, settings: SetPointSettings, truth: OneLinkRobot
) -> Iterator[tuple[str | None, float, float]]:
    """Log (None: named by its label), r and start of every run."""
    starts = rig.starts or _scaled_starts(settings, truth)
    gain = settings.compensation_gain
    if isinstance(gain, Mapping):
        for (log, r), start in zip(gain.items(), itertools.cycle(starts), strict=False):
            yield log, r, start
        return
    gains: Sequence[float] = (gain,) if isinstance(gain, float) else rig.compensation_gains
    for r, start in itertools.product(gains, starts):
        yield None, r, start


def _scaled_starts(settings: SetPointSettings, truth: OneLinkRobot) -> tuple[float, ...]:
    n1 = _value(settings.proportional_gain, None, PROPORTIONAL_GAIN)
    reach = truth.mean().friction.positive.static_torque / n1
    far, near = rounded(_FAR * reach), rounded(_NEAR * reach)
    return far, -far, near, -near


def _value(gain: Gain, log: str | None, published: float) -> float:
    """A gain of one run; the paper's where the campaign leaves it to the log."""
    if isinstance(gain, Mapping):
        return gain.get(log or "", published)
    return published if isinstance(gain, FromMetadata) else gain


def _metadata(settings: SetPointSettings, gains: Gains) -> dict[str, str]:
    """The gains that the campaign expects in the log, and r in any case."""
    written = {"r": f"{gains.compensation:.12g}"}
    for name in ("proportional", "derivative", "observer", "compensation"):
        gain = getattr(settings, f"{name}_gain")
        if isinstance(gain, FromMetadata):
            written[gain.key] = f"{getattr(gains, name):.12g}"
    return written

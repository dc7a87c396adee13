"""The gains of a question: what the command line says, else what the campaign of the robot file says.

A gain that neither gives is wrong usage, and so is one that no controller can have; the message names the
option to give.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from compensation.controller import Gains
from ident.model.friction import ModelError
from ident.model.numbers import LARGEST
from pipelines.exit_status import UsageError
from pipelines.settings.loop import LoopDefaults

if TYPE_CHECKING:
    from compensation.sampled_loop import Sampling

OPTIONS: Final = {
    "compensation": "--compensation-gain",
    "observer": "--observer-gain",
    "proportional": "--proportional",
    "derivative": "--derivative",
}


class MissingGainsError(UsageError):
    """A loop that neither the robot's campaign nor the command line tells in full."""


@dataclass(frozen=True)
class GainOptions:
    """What the command line said; None where it was silent."""

    compensation: float | None = None  # r [-]
    observer: float | None = None  # L [1/s]
    proportional: float | None = None  # n1 [N m/rad]
    derivative: float | None = None  # n2 [N m s/rad]
    sample_period: float | None = None  # [s]; 0: continuous


def chosen_loop(defaults: LoopDefaults, options: GainOptions) -> LoopDefaults:
    """The defaults with the command line laid over them; raises `UsageError` for a value that no loop has."""
    spoken = {
        name: value for name in (*OPTIONS, "sample_period") if (value := getattr(options, name)) is not None
    }
    for name, value in spoken.items():
        if not 0.0 <= value <= LARGEST:
            option = OPTIONS.get(name, "--sample-period")
            raise UsageError(f"{option} is {value}: give a finite number >= 0, up to {LARGEST:g}")
    return replace(defaults, **spoken)


def with_exact(defaults: LoopDefaults, options: GainOptions) -> LoopDefaults:
    """The defaults with r = 1 where nothing says r: for questions that exact compensation answers."""
    if defaults.compensation is None and options.compensation is None:
        return replace(defaults, compensation=1.0)
    return defaults


def chosen_gains(defaults: LoopDefaults, options: GainOptions, *, source: str) -> Gains:
    """All four gains; raises `MissingGainsError` naming all that are missing, `UsageError` for bad ones.

    `source` is how a message calls the robot file. The caller gives a swept gain its first value.
    """
    loop = chosen_loop(defaults, options)
    values = {name: getattr(loop, name) for name in OPTIONS}
    missing = [OPTIONS[name] for name, value in values.items() if value is None]
    if missing:
        raise MissingGainsError(
            f"{source} gives no single value for {' and '.join(missing)} (its campaign has no set-point "
            "runs, or they differ): say it on the command line"
        )
    try:
        return Gains(**values)
    except ModelError as broken:
        raise UsageError(str(broken)) from None


def chosen_sampling(
    defaults: LoopDefaults, options: GainOptions, *, resolution: float | None = None
) -> Sampling | None:
    """How the loop is sampled; None: continuous, the inclusion (8) itself.

    `resolution` [rad per count] overrides the campaign's. An encoder without a sample period is wrong usage:
    a continuous loop measures its position exactly.
    """
    from compensation.sampled_loop import Sampling  # noqa: PLC0415  (loads kernels: only where a loop is sampled)

    loop = chosen_loop(defaults, options)
    if not loop.sample_period:
        if resolution:
            raise UsageError("--encoder-counts needs a sampled loop: give --sample-period as well")
        return None
    counted = loop.resolution if resolution is None else resolution
    return Sampling(
        period=loop.sample_period,
        resolution=counted or 0.0,
        observer_update=loop.observer_update,
        delay=loop.delay,
        torque_limit=math.inf if loop.torque_limit is None else loop.torque_limit,
    )

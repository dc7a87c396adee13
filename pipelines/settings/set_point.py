"""How the controller of a set-point experiment was set: one value for all runs, or one for each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from data.findings import LogError
from data.protocols import SetPoint
from pipelines.settings.loop import Compensator, ObserverUpdate


@dataclass(frozen=True)
class FromMetadata:
    """A gain that stands in each log's metadata."""

    key: str


Gain = float | FromMetadata | Mapping[str, float]  # one for all, in each log, or by log


@dataclass(frozen=True)
class SetPointSettings:
    """How the controller of a set-point experiment was set, as far as the campaign says it."""

    proportional_gain: Gain  # n1 [N m/rad]
    derivative_gain: Gain  # n2 [N m s/rad]
    observer_gain: Gain  # L [1/s]
    compensation_gain: Gain  # r [-]
    sample_period: float | None  # [s]; None: the log's own
    observer_update: ObserverUpdate
    delay: int
    compensator: Compensator | None  # None: the fitted mean

    def for_log(self, log: str, metadata: Mapping[str, str]) -> SetPoint:
        """The settings of one run; raises `LogError` where its metadata lack a gain."""
        names = ("proportional_gain", "derivative_gain", "observer_gain", "compensation_gain")
        gains = {name: _gain_of(getattr(self, name), name, log, metadata) for name in names}
        if gains["proportional_gain"] == 0:
            raise LogError(f"{log}: proportional_gain is 0: n1 > 0, or no position is a set point")
        return SetPoint(
            **gains,
            sample_period=self.sample_period,
            observer_update=self.observer_update,
            delay=self.delay,
        )


def _gain_of(gain: Gain, name: str, log: str, metadata: Mapping[str, str]) -> float:
    """The number that a gain is for one log; raises `LogError`."""
    if isinstance(gain, float):
        return gain
    if isinstance(gain, Mapping):
        return gain[log]
    if gain.key not in metadata:
        known = ", ".join(sorted(metadata)[:8]) or "none at all"
        raise LogError(
            f"{log}: {name} should stand in its metadata as {gain.key!r}, and does not (it has: {known}). "
            "Correct the key in the campaign, give a table by file name, or exclude the log"
        )
    try:
        value = float(metadata[gain.key])
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise LogError(
            f"{log}: {name} stands in its metadata as {gain.key!r} = {metadata[gain.key]!r}: a gain is a "
            "finite number >= 0. Give a table by file name, or exclude the log"
        )
    return value


def one_value(gain: Gain) -> float | None:
    """The value that holds for every run; None where it differs or is not known before the logs are read."""
    if isinstance(gain, Mapping):
        values = set(gain.values())
        return values.pop() if len(values) == 1 else None
    return gain if isinstance(gain, float) else None

"""All detectors in their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data.findings import Finding, LogError
from data.protocols import IDENTIFIES
from data.screening.clock import FEWEST_SAMPLES, advance, gaps, long_parts
from data.screening.position import drop_spikes, unwrap
from data.screening.run import Run
from data.screening.scale import require_sizes, require_torque_size, require_velocity_unit
from data.screening.torque import flat_top, require_torque_sign, saturation


@dataclass(frozen=True)
class Screened:
    """A run that may be used, and what was seen."""

    signals: Run
    findings: tuple[Finding, ...]
    torque_limit: float | None  # as declared, or where the torque is flat [N m]


def screen(run: Run, *, clock: str, resolution: float | None, torque_limit: float | None) -> Screened:
    """Screen one run.

    Parameters
    ----------
    run
        In SI.
    clock
        What its time is, for messages: "header stamps", "column 't'".
    resolution
        One encoder count [rad]; None: unknown.
    torque_limit
        Of the actuator [N m]; None: unknown.

    Raises
    ------
    LogError
        When a detector refuses the run.
    """
    require_finite(run)
    require_sizes(run)
    require_samples(run)
    run, clocks = advance(run, clock)
    run, lost = long_parts(run)
    run, wraps = unwrap(run, resolution)
    run, spikes = drop_spikes(run, resolution)
    require_velocity_unit(run, resolution)
    require_torque_size(run, torque_limit)
    require_torque_sign(run, resolution)
    limit = flat_top(run) if torque_limit is None else torque_limit
    saturated = saturation(run, limit, declared=torque_limit is not None)
    return Screened(run, (*clocks, *lost, *wraps, *spikes, *gaps(run, clock), *saturated), limit)


def require_finite(run: Run) -> None:
    """Refuse times and signals that are no finite numbers."""
    for name, array in {"time": run.time, **run.named()}.items():
        bad = np.flatnonzero(~np.isfinite(array))
        if not bad.size:
            continue
        k = int(bad[0])
        when = f", t = {run.time[k]:.6g} s" if np.isfinite(run.time[k]) else ""
        raise LogError(
            f"{run.log}: {name} is {array[k]} at sample {k}{when}"
            + (f" (and {bad.size - 1} more)" if bad.size > 1 else "")
            + f"; it would spoil {IDENTIFIES[run.protocol]}. Cut it off with `window`, or exclude the log"
        )


def require_samples(run: Run) -> None:
    """Refuse a run that is empty or too short."""
    if run.time.size < FEWEST_SAMPLES:
        raise LogError(
            f"{run.log}: {run.time.size} samples; a run needs at least {FEWEST_SAMPLES} to say anything "
            f"about {IDENTIFIES[run.protocol]}. Record it again or exclude it"
        )

"""From a log file to a `Recording`: the file door.

A log is opened by its format, the columns that the campaign names are read, units become SI, the clock is
chosen and said, the run is cut to its window, screened, and handed on with everything that was noticed. What
comes out can be trusted or says why not; what cannot be used is one `LogError`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from data.doors.csv import read_csv_log
from data.doors.door import Door, Logged
from data.doors.messages import read_bag_log, read_mcap_log
from data.doors.tables import read_mat_log, read_parquet_log
from data.files import ByteArray, read_bytes
from data.findings import LogError
from data.protocols import ProtocolName
from data.recording import Axis, Recording
from data.resolution import lattice_spacing
from data.screening.run import Run
from data.screening.scale import require_count
from data.screening.screen import require_samples, screen
from data.signals import Format, RigSignals, log_format

_TURN: Final = 2.0 * np.pi
_READERS: Final[dict[Format, Callable[[Door, ByteArray], Logged]]] = {
    "csv": read_csv_log,
    "mcap": read_mcap_log,
    "parquet": read_parquet_log,
    "mat": read_mat_log,
    "bag": read_bag_log,
}


def read_recording(
    path: Path,
    *,
    log: str,
    protocol: ProtocolName,
    signals: RigSignals,
    axis: Axis = "rotary",
    encoder_counts: float | None = None,
    torque_limit: float | None = None,
    window: tuple[float, float] | None = None,
    salvage: bool = False,
) -> Recording:
    """Read one run.

    Parameters
    ----------
    path, log
        The file, and what the campaign calls it.
    protocol
        What was asked of the rig.
    signals
        How the rig's logs name things.
    axis, encoder_counts, torque_limit
        Of the rig: counts in a revolution (linear: in a metre), limit [N m].
    window
        Begin and end [s] from the start of the log; None: all of it.
    salvage
        Go on with what a damaged log still holds.

    Raises
    ------
    LogError
        When the file is missing, damaged, lacks a signal, contradicts a unit, or is refused by the screening.
    """
    file_format = log_format(path)
    door = Door(path, log, signals.of(file_format), axis, encoder_counts, salvage)
    content = read_bytes(path, log=log)
    logged = _READERS[file_format](door, content)
    run = Run(
        log=log,
        protocol=protocol,
        time=logged.time,
        position=logged.signals["position"],
        torque=logged.signals["torque"],
        velocity=logged.signals.get("velocity"),
        reference=logged.signals.get("reference"),
        breaks=logged.breaks,
    )
    if window is not None:
        run = _cut(run, window)
    recording = screened_recording(
        run, clock=logged.clock, axis=axis, encoder_counts=encoder_counts, torque_limit=torque_limit
    )
    return replace(
        recording,
        begun=logged.begun,
        simulated=logged.metadata.get("simulated", "").strip().lower() == "true",
        sha256=hashlib.sha256(content.data).hexdigest(),
        metadata=logged.metadata,
        findings=(*logged.findings, *recording.findings),
    )


def screened_recording(
    run: Run,
    *,
    clock: str,
    axis: Axis = "rotary",
    encoder_counts: float | None = None,
    torque_limit: float | None = None,
) -> Recording:
    """A run in SI as a recording, screened; `clock` says what its time is. Parameters as `read_recording`.

    Raises
    ------
    LogError
        When the screening refuses the run.
    """
    require_samples(run)
    resolution = _resolution(run, axis=axis, encoder_counts=encoder_counts)
    screened = screen(run, clock=clock, resolution=resolution, torque_limit=torque_limit)
    kept = screened.signals
    return Recording(
        log=run.log,
        protocol=run.protocol,
        time=kept.time,
        position=kept.position,
        torque=kept.torque,
        velocity=kept.velocity,
        reference=kept.reference,
        resolution=resolution,
        torque_limit=screened.torque_limit,
        axis=axis,
        findings=screened.findings,
        breaks=kept.breaks,
    )


def _resolution(run: Run, *, axis: Axis, encoder_counts: float | None) -> float | None:
    """One encoder count [rad], declared or found; raises LogError where the positions belie the declared."""
    found = lattice_spacing(run.position[np.isfinite(run.position)])
    if encoder_counts is None:
        return found
    declared = (_TURN if axis == "rotary" else 1.0) / encoder_counts
    if found is not None:
        require_count(run, found=found, declared=declared)
    return declared


def _cut(run: Run, window: tuple[float, float]) -> Run:
    begin, end = window
    inside = (run.time >= begin) & (run.time <= end)
    if not inside.any():
        raise LogError(
            f"{run.log}: nothing lies in its window of {begin:g} to {end:g} s; the log lasts "
            f"{run.time[-1] - run.time[0]:g} s from its start"
        )
    return run.keep(inside)

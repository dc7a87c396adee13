"""The recordings of a campaign: every log read as its experiment says, those left out listed with the reason.

Reading is spread over logs by a `map` argument. A log that cannot be used refuses the campaign; to go on
without it, the user excludes it by name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from data.ingest import read_recording
from data.protocols import ProtocolName, SetPoint
from data.recording import Recording
from ident.estimate import RunUse
from pipelines.executors.processes import Spread
from pipelines.executors.serial import serial_map
from pipelines.progress import Progress, Silent, counted
from pipelines.settings.campaign import Campaign, Experiment
from pipelines.settings.loop import Compensator


@dataclass(frozen=True)
class LogToRead:
    """One log, and all that its reader must know; it may travel to another process."""

    path: Path
    log: str
    campaign: Campaign
    experiment: Experiment
    salvage: bool


@dataclass(frozen=True)
class SetPointRun:
    """A recorded set-point run and how its controller was set."""

    recording: Recording
    set_point: SetPoint
    compensator: Compensator | None


@dataclass(frozen=True)
class ReadLogs:
    """What a campaign's logs gave."""

    recordings: tuple[Recording, ...]
    excluded: tuple[RunUse, ...]


@dataclass(frozen=True)
class SetPointLogs:
    """What the set-point logs of a campaign gave."""

    runs: tuple[SetPointRun, ...]
    excluded: tuple[RunUse, ...]


IDENTIFYING: tuple[ProtocolName, ...] = ("breakaway", "constant_velocity", "frequency_response", "excitation")


def read_logs(
    campaign: Campaign,
    protocols: Iterable[ProtocolName],
    *,
    salvage: bool = False,
    map: Spread = serial_map,
    progress: Progress | None = None,
) -> ReadLogs:
    """Every log of the given protocols; raises `LogError` for one that cannot be used."""
    wanted = set(protocols)
    experiments = [experiment for experiment in campaign.experiments if experiment.protocol in wanted]
    tasks = [
        LogToRead(campaign.folder / log, log, campaign, experiment, salvage)
        for experiment in experiments
        for log in experiment.logs
        if log not in experiment.exclude
    ]
    tick = (progress or Silent()).stage("reading logs", len(tasks))
    recordings = tuple(counted(map(read_log, tasks), tick))
    excluded = tuple(
        RunUse(log, _sha256(campaign.folder / log), experiment.protocol, used=False, why=why)
        for experiment in experiments
        for log, why in experiment.exclude.items()
    )
    return ReadLogs(recordings, excluded)


def read_log(task: LogToRead) -> Recording:
    """Read one log as its experiment says; raises `LogError`."""
    rig = task.campaign.rig
    recording = read_recording(
        task.path,
        log=task.log,
        protocol=task.experiment.protocol,
        signals=task.experiment.signals,
        axis=rig.axis,
        encoder_counts=rig.encoder_counts,
        torque_limit=rig.torque_limit,
        window=task.experiment.window.get(task.log),
        salvage=task.salvage,
    )
    return replace(recording, metadata=dict(recording.metadata))  # a plain dict travels between processes


def set_point_logs(
    campaign: Campaign,
    *,
    salvage: bool = False,
    map: Spread = serial_map,
    progress: Progress | None = None,
) -> SetPointLogs:
    """Every recorded set-point run with its settings, and those excluded; raises `LogError`."""
    logs = read_logs(campaign, ("set_point",), salvage=salvage, map=map, progress=progress)
    settings = {
        log: experiment.set_point
        for experiment in campaign.experiments
        if experiment.set_point is not None
        for log in experiment.logs
    }
    runs = []
    for recording in logs.recordings:
        setting = settings[recording.log]
        runs.append(
            SetPointRun(recording, setting.for_log(recording.log, recording.metadata), setting.compensator)
        )
    return SetPointLogs(tuple(runs), logs.excluded)


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

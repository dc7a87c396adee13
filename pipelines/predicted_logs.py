"""Predicted runs as logs, to be looked at beside the recordings: `predicted/RUN.mcap`, one a set-point run.

Each holds the motion of the fitted robot in the loop as it ran, from the run's own start, for as long as it
was recorded: joint states on `/predicted/joint_states` (position in encoder counts' steps as the controller
measured it [rad], velocity [rad/s], torque [N m]), on the clock of the recording, so that a viewer lays one
over the other. `simulated = true` stands in its metadata.

`pipelines.viewer_layout` writes the layout under which a viewer plots both.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Final

import numpy as np

from compensation.sampled_loop import SampledRun, run_sampled
from data.mcap.writer import write_mcap
from pipelines.onset import JudgedRun
from pipelines.results.folder import ResultFolder
from pipelines.run_outcomes import LoopAsRun

FOLDER: Final = "predicted"
TOPIC: Final = "/predicted/joint_states"
_NANOSECONDS: Final = 1e9


def write_predicted_logs(folder: ResultFolder, runs: Sequence[JudgedRun], *, robot: str) -> list[str]:
    """Write the prediction of each run that has one; returns the files' names.

    `robot` says which robot moves in them.
    """
    written: list[str] = []
    for judged in runs:
        if judged.loop is not None:
            written.append(_name(judged.run.recording.log, written))
            _write(folder, written[-1], judged, judged.loop, robot)
    return written


def predicted_run(loop: LoopAsRun) -> SampledRun:
    """The loop as it ran, from its start, for as long as it was recorded."""
    return run_sampled(
        loop.robot,
        loop.controller,
        loop.sampling,
        start=(loop.position, 0.0),
        duration=loop.duration,
        reference=loop.reference,
    )


def _write(folder: ResultFolder, name: str, judged: JudgedRun, loop: LoopAsRun, robot: str) -> None:
    recording, run = judged.run.recording, predicted_run(loop)
    metadata = {
        "simulated": "true",
        "prediction_of": recording.log,
        "recording_sha256": recording.sha256,
        "robot": robot,
        "r": repr(judged.gain),
        "end": run.end,
    }
    folder.write_by(
        name,
        lambda path: write_mcap(
            path,
            topic=TOPIC,
            time=recording.time[0] + run.time,
            position=np.ascontiguousarray(run.measured),
            velocity=np.ascontiguousarray(run.velocity),
            effort=np.ascontiguousarray(run.torque),
            metadata=metadata,
            epoch=round((recording.begun or 0.0) * _NANOSECONDS),
        ),
    )


def _name(log: str, taken: Sequence[str]) -> str:
    """A file name for the prediction of a log, whose own name is data from outside."""
    stem = re.sub(r"[^\w.-]+", "_", PurePosixPath(log).stem).lstrip(".")[:100] or "run"
    name, number = f"{FOLDER}/{stem}.mcap", 1
    while name in taken:
        number += 1
        name = f"{FOLDER}/{stem}_{number}.mcap"
    return name

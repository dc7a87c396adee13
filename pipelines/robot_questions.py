"""The questions that take a robot file: what `design`, `simulate` and `predict` share on the command line."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from compensation.controller import Controller
from compensation.sampled_loop import Sampling
from data.recording import Axis
from ident.model.numbers import LARGEST
from pipelines.executors.threads import opened_threads
from pipelines.exit_status import Status, UsageError
from pipelines.predict import Sweep, predict, write_prediction
from pipelines.progress import Progress
from pipelines.results.folder import ResultFolder
from pipelines.results.manifest import Command, write_manifest
from pipelines.results.robot_file import RobotFile
from pipelines.settings.gains import GainOptions, chosen_gains
from pipelines.settings.loop import LawChoice, resolution_of


def axis_of(source: RobotFile) -> Axis:
    """The axis of a robot file."""
    return "linear" if source.identified is not None and source.identified.axis == "linear" else "rotary"


def counted_resolution(source: RobotFile, encoder_counts: float | None) -> float | None:
    """One count of --encoder-counts [rad]; None where it was not said; raises `UsageError`."""
    if encoder_counts is None:
        return None
    if not 0 < encoder_counts < float("inf"):
        raise UsageError(f"--encoder-counts is {encoder_counts:g}: give counts a revolution, > 0")
    resolution = resolution_of(encoder_counts, axis_of(source))
    if resolution > LARGEST:
        raise UsageError(
            f"--encoder-counts is {encoder_counts:g}: one count would be {resolution:.4g} rad (m on a linear "
            "axis); give counts a revolution (a metre)"
        )
    return resolution


def predict_robot(
    source: RobotFile,
    options: GainOptions,
    sweep: Sweep,
    folder: ResultFolder,
    *,
    law: LawChoice,
    compensator: LawChoice | None,
    sampling: Sampling | None,
    jobs: int | None,
    progress: Progress,
) -> None:
    """The diagram of a robot file over a sweep; the swept gain needs no value of its own."""
    swept = "compensation" if sweep.parameter == "r" else "observer"
    given = replace(options, **{swept: float(sweep.values[0])})
    gains = chosen_gains(source.loop, given, source=source.name)
    controller = Controller(gains, source.compensating(compensator))
    with opened_threads(jobs) as spread:
        result = predict(
            source.moving(law),
            controller,
            sweep,
            sampling=sampling,
            axis=axis_of(source),
            map=spread,
            progress=progress,
        )
    write_prediction(
        result, folder, title=source.owner.campaign, axis=axis_of(source), simulated=source.simulated
    )


def conclude(
    folder: ResultFolder,
    source: RobotFile,
    name: str,
    options: Mapping[str, object],
    *,
    seed: int | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Enter the command in the folder's manifest."""
    inputs = {} if source.path is None else {source.name: _sha256(source.path)}
    status = Status.WITHHELD if missing else Status.DONE
    write_manifest(folder, Command(name, options, seed, int(status), inputs, source.simulated))


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()

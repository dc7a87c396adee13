"""The chain behind `run` and `demo`: identify, design, predict, compare, report, manifest.

Part of the command line, which alone knows all questions: it hands result files and values from one to the
next. All logs are read before anything is written. Where a parameter is withheld, or the campaign lacks what
a question needs, that question says why and the others go on; the run then ends with status 3.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from compensation.controller import Gains
from data.findings import Severity
from data.recording import Recording
from ident.estimate import IdentifiedRobot
from ident.fit.assumptions import DEFAULT, Assumptions
from pipelines.compare import Comparison, compare, write_comparison, write_figure10
from pipelines.design import design, write_design
from pipelines.executors.processes import opened_map
from pipelines.executors.threads import opened_threads
from pipelines.exit_status import Status, UsageError
from pipelines.identify import identify, left_out, write_identification
from pipelines.motion_figures import write_motion_figures
from pipelines.predict import Sweep, one_sweep
from pipelines.predicted_logs import write_predicted_logs
from pipelines.progress import Progress
from pipelines.recordings import IDENTIFYING, ReadLogs, SetPointLogs, SetPointRun, read_logs, set_point_logs
from pipelines.report.page import report_page
from pipelines.results.folder import ResultFolder
from pipelines.results.manifest import Command, versions, write_manifest
from pipelines.results.robot_file import RobotFile, read_robot, withheld_parameters
from pipelines.robot_questions import axis_of, predict_robot
from pipelines.settings.campaign import Campaign
from pipelines.settings.gains import (
    GainOptions,
    MissingGainsError,
    chosen_gains,
    chosen_sampling,
    with_exact,
)
from pipelines.settings.loop import LawChoice
from pipelines.viewer_layout import write_layout

PICTURES = ("figure2", "validation", "figure4", "figure6", "figure7", "figure8", "figure9", "figure10")
SWEEP_POINTS = 101


@dataclass(frozen=True)
class RunOptions:
    """What the command line said of a run."""

    assumptions: Assumptions = DEFAULT
    advised: bool = False  # on what to record next
    salvage: bool = False
    law: LawChoice = "per-direction"
    compensator: LawChoice | None = None
    gains: GainOptions = field(default_factory=GainOptions)
    over: tuple[str, ...] = ()
    seed: int = 0
    jobs: int | None = None
    predicted_logs: bool = False

    def shown(self) -> dict[str, object]:
        """As the manifest remembers them; they hold no path."""
        said = {f"{name}_gain": getattr(self.gains, name) for name in ("compensation", "observer")}
        said |= {name: getattr(self.gains, name) for name in ("proportional", "derivative", "sample_period")}
        return {
            "shape": self.assumptions.shape,
            "laws": self.assumptions.laws,
            "salvage": self.salvage,
            "law": self.law,
            "compensator": self.compensator,
            "over": list(self.over),
            "predicted_logs": self.predicted_logs,
            **{name: value for name, value in said.items() if value is not None},
        }


def identify_campaign(
    campaign: Campaign, folder: ResultFolder, options: RunOptions, *, progress: Progress
) -> list[str]:
    """`identify` alone; returns what was withheld or left out, in sentences."""
    with opened_map(options.jobs or 1) as spread:
        logs = read_logs(campaign, IDENTIFYING, salvage=options.salvage, map=spread, progress=progress)
    missing, robot = _identified(campaign, logs, folder, options, progress)
    _conclude(folder, campaign, options, "identify", missing, inputs_of(logs), simulated=robot.simulated)
    return missing


def compare_campaign(
    campaign: Campaign, source: RobotFile, folder: ResultFolder, options: RunOptions, *, progress: Progress
) -> list[str]:
    """`compare` alone; returns what was withheld or left out, in sentences."""
    with opened_map(options.jobs or 1) as spread:
        logs = set_point_logs(campaign, salvage=options.salvage, map=spread, progress=progress)
    if not logs.runs:
        raise UsageError(f"{campaign.path}: no set-point runs to compare: add a [[experiment]] with them")
    missing = _answer_for_runs(campaign, source, logs, folder, options, progress)
    simulated = any(run.recording.simulated for run in logs.runs)
    _conclude(folder, campaign, options, "compare", missing, inputs_of(logs), simulated=simulated)
    return missing


def run_campaign(
    campaign: Campaign, folder: ResultFolder, options: RunOptions, *, command: str, progress: Progress
) -> list[str]:
    """All of `run`, from robot.json to manifest.json; returns what was withheld or left out, in sentences.

    Raises `UsageError` before a log is read where the options make no sense.
    """
    _check_usage(campaign, options)
    with opened_map(options.jobs or 1) as spread:
        logs = read_logs(campaign, IDENTIFYING, salvage=options.salvage, map=spread, progress=progress)
        set_point = set_point_logs(campaign, salvage=options.salvage, map=spread, progress=progress)
    missing, robot = _identified(campaign, logs, folder, options, progress)
    source = read_robot(folder.path / "robot.json")
    left_out: dict[str, str] = {}  # what a question lacks, for the report
    loop = with_exact(source.loop, options.gains)
    try:
        gains = chosen_gains(loop, options.gains, source=source.name)
    except MissingGainsError as failure:
        left_out["predict"] = str(failure)
        missing.append(f"predict, and what of design needs gains, are left out: {failure}")
        _design_without_gains(source, folder, options, str(failure))
    else:
        if source.fitted is None:
            left_out["predict"] = "; ".join(source.missing())
        missing += _answer_for_robot(source, gains, folder, options, set_point.runs, progress)
    if not set_point.runs:
        left_out["compare"] = f"{campaign.path.name} has no set-point runs"
    missing += _answer_for_runs(campaign, source, set_point, folder, options, progress)
    write_report(folder, campaign, truth=read_truth(campaign), simulated=robot.simulated, left_out=left_out)
    inputs = {**inputs_of(logs), **inputs_of(set_point)}
    _conclude(folder, campaign, options, command, missing, inputs, simulated=robot.simulated)
    return missing


def _check_usage(campaign: Campaign, options: RunOptions) -> None:
    """Raise `UsageError` for a sweep or a gain that makes no sense, while nothing has been written."""
    if options.over:
        one_sweep(options.over)
    loop = with_exact(campaign.loop_defaults(), options.gains)
    with suppress(MissingGainsError):
        chosen_gains(loop, options.gains, source=campaign.path.name)
    chosen_sampling(loop, options.gains)


def _design_without_gains(source: RobotFile, folder: ResultFolder, options: RunOptions, why: str) -> None:
    """The part of design that needs no gains of the loop."""
    found = design(
        source,
        None,
        without_gains=why,
        law=options.law,
        compensator=options.compensator,
        seed=options.seed,
    )
    write_design(found, folder)


def _identified(
    campaign: Campaign, logs: ReadLogs, folder: ResultFolder, options: RunOptions, progress: Progress
) -> tuple[list[str], IdentifiedRobot]:
    tick = progress.stage("identifying", 1)
    found = identify(logs, assumptions=options.assumptions, seed=options.seed)
    tick(1)
    write_identification(
        found,
        folder,
        loop=campaign.loop_defaults(),
        axis=campaign.rig.axis,
        advised=options.advised,
        truth=read_truth(campaign),
    )
    missing = withheld_parameters(found.robot)
    missing += left_out(found.robot, frozenset(use.log for use in logs.excluded))
    return missing + salvaged(logs.recordings), found.robot


def _conclude(
    folder: ResultFolder,
    campaign: Campaign,
    options: RunOptions,
    command: str,
    missing: list[str],
    inputs: dict[str, str],
    *,
    simulated: bool,
) -> None:
    """Enter the command in the folder's manifest."""
    status = Status.WITHHELD if missing else Status.DONE
    named = {campaign.path.name: campaign.sha256, **inputs}
    entry = Command(command, options.shown(), options.seed, int(status), named, simulated)
    write_manifest(folder, entry)


def inputs_of(logs: ReadLogs | SetPointLogs) -> dict[str, str]:
    """The SHA-256 of each log, excluded ones included."""
    recordings = logs.recordings if isinstance(logs, ReadLogs) else [run.recording for run in logs.runs]
    used = {recording.log: recording.sha256 for recording in recordings}
    return used | {use.log: use.sha256 for use in logs.excluded}


def _answer_for_robot(
    source: RobotFile,
    gains: Gains,
    folder: ResultFolder,
    options: RunOptions,
    runs: tuple[SetPointRun, ...],
    progress: Progress,
) -> list[str]:
    """design and predict; what they lack, in sentences."""
    tick = progress.stage("designing", 1)
    write_design(
        design(source, gains, law=options.law, compensator=options.compensator, seed=options.seed), folder
    )
    tick(1)
    if source.fitted is None:
        return ["predict is left out: a parameter is withheld"]
    predict_robot(
        source,
        options.gains,
        swept(options, runs),
        folder,
        law=options.law,
        compensator=options.compensator,
        sampling=chosen_sampling(source.loop, options.gains),
        jobs=options.jobs,
        progress=progress,
    )
    farthest = max((abs(float(run.recording.position[0])) for run in runs), default=1.0) or 1.0
    why = write_motion_figures(
        folder, source.fitted, gains, start=farthest, axis=axis_of(source), simulated=source.simulated
    )
    return [] if why is None else [why]


def _answer_for_runs(
    campaign: Campaign,
    source: RobotFile,
    logs: SetPointLogs,
    folder: ResultFolder,
    options: RunOptions,
    progress: Progress,
) -> list[str]:
    """compare; what it lacks, in sentences."""
    if not logs.runs:
        return [f"compare is left out: {campaign.path.name} has no set-point runs"]
    with opened_threads(options.jobs) as spread:
        found = compare(
            logs.runs,
            source,
            map=spread,
            law=options.law,
            compensator=options.compensator,
            excluded=logs.excluded,
            seed=options.seed,
            progress=progress,
        )
    write_comparison(folder, found)
    write_figure10(folder, found, axis=campaign.rig.axis)
    if options.predicted_logs:
        _write_logs(campaign, folder, found)
    return [*found.withheld, *salvaged(run.recording for run in logs.runs)]


def _write_logs(campaign: Campaign, folder: ResultFolder, found: Comparison) -> None:
    """The predicted runs as logs, and the layout that lays them over the recordings."""
    if write_predicted_logs(folder, [run.judged for run in found.runs], robot=found.robot):
        named = [
            signals
            for experiment in campaign.experiments
            if experiment.protocol == "set_point"
            for signals in (experiment.signals.mcap, experiment.signals.bag)
            if signals is not None
        ]
        write_layout(folder, named, rig=campaign.rig)


def swept(options: RunOptions, runs: tuple[SetPointRun, ...]) -> Sweep:
    """The sweep that was asked for, else r over that of the recorded runs, else the usual one."""
    recorded = [run.set_point.compensation_gain for run in runs]
    if options.over or len(set(recorded)) < 2:
        return one_sweep(options.over)
    return Sweep("r", np.linspace(min(recorded), max(recorded), SWEEP_POINTS))


def salvaged(recordings: Iterable[Recording]) -> list[str]:
    """What screening or salvage took out of the recordings, in sentences."""
    return [
        f"{recording.log}: {finding.code}: {finding.text}"
        for recording in recordings
        for finding in recording.findings
        if finding.severity is not Severity.WARN
    ]


def read_truth(campaign: Campaign) -> dict[str, object] | None:
    """truth.json of a virtual rig, beside its campaign."""
    path = campaign.folder / "truth.json"
    if campaign.virtual_rig is None or not path.is_file():
        return None
    truth = json.loads(path.read_text(encoding="utf-8"))
    return truth if isinstance(truth, dict) else None


def write_report(
    folder: ResultFolder,
    campaign: Campaign,
    *,
    truth: dict[str, object] | None,
    simulated: bool,
    left_out: Mapping[str, str],
) -> None:
    """report.html from the files that this run has written."""

    def document(name: str) -> dict[str, Any] | None:
        if name not in folder.written:
            return None
        return dict(json.loads((folder.path / name).read_text(encoding="utf-8")))

    pictures = {
        name: (folder.path / f"{name}.svg").read_text(encoding="utf-8")
        for name in PICTURES
        if f"{name}.svg" in folder.written
    }
    page = report_page(
        name=campaign.name,
        rig=campaign.rig.name,
        robot=document("robot.json"),
        design=document("design.json"),
        diagram=document("diagram.json"),
        comparison=document("comparison.json"),
        manifest={"versions": versions(), "files": folder.written},
        truth=truth,
        left_out=left_out,
        fit_report=(folder.path / "fit_report.txt").read_text(encoding="utf-8"),
        figures=pictures,
        axis=campaign.rig.axis,
        simulated=simulated,
    )
    folder.write_text("report.html", page)

"""identify: logs into the fitted robot, with everything that shows how it came about.

Writes `robot.json` (`pipelines.results.robot_file`), `friction_map.csv` (a row a point or a run left out,
columns as the fields of `ident.evidence.friction_map.MapPoint`), `fit_report.txt`, Table 1 as `.csv`, `.md`
and `.tex`, `figure2.svg`, and `validation.svg` where runs could be held out; with --advise also `advice.json`
(`pipelines.results.advice_file`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import astuple, fields, replace

import numpy as np

from data.recording import Axis
from ident.advice import advise, advise_without_map
from ident.estimate import IdentifiedRobot
from ident.evidence.friction_map import MapPoint
from ident.fit.assumptions import DEFAULT, Assumptions
from ident.fit.parameters import UNITS
from ident.identification import identify as fit
from ident.identified import Identification
from pipelines.recordings import ReadLogs
from pipelines.results.advice_file import write_advice
from pipelines.results.folder import ResultFolder
from pipelines.results.robot_file import write_robot
from pipelines.settings.loop import LoopDefaults


def identify(logs: ReadLogs, *, assumptions: Assumptions = DEFAULT, seed: int = 0) -> Identification:
    """The robot behind the recordings; runs that the campaign excludes are listed with their reason.

    `seed` is that of the report's bootstrap.

    Raises `LogError` where the recordings can give no robot at all.
    """
    found = fit(logs.recordings, assumptions=assumptions, generator=np.random.default_rng(seed))
    runs = tuple(sorted((*found.robot.runs, *logs.excluded), key=lambda use: use.log))
    return replace(found, robot=replace(found.robot, runs=runs))


def write_identification(
    found: Identification,
    folder: ResultFolder,
    *,
    loop: LoopDefaults,
    axis: Axis,
    advised: bool = False,
    truth: Mapping[str, object] | None = None,
) -> None:
    """All files of `identify`, `advised` those of --advise too; `truth` is what a virtual rig's truth.json
    holds.
    """
    from pipelines.report.fit_summary import fit_report  # noqa: PLC0415
    from pipelines.report.friction_figures import figure2  # noqa: PLC0415  (matplotlib)
    from pipelines.report.style import svg_text  # noqa: PLC0415
    from pipelines.report.tables import table1_csv, table1_markdown, table1_tex  # noqa: PLC0415
    from pipelines.report.validation_figure import validation_figure  # noqa: PLC0415

    robot = found.robot
    path = write_robot(folder, robot, loop, breakaways=found.breakaways, validation=found.validation)
    document = json.loads(path.read_text(encoding="utf-8"))
    folder.write_csv(
        "friction_map.csv",
        [field.name for field in fields(MapPoint)],
        [astuple(point) for point in found.friction_map],
    )
    folder.write_text("fit_report.txt", fit_report(document, found.fit_report))
    folder.write_text("table1.csv", table1_csv(document, truth=truth))
    folder.write_text("table1.md", table1_markdown(document, truth=truth))
    folder.write_text("table1.tex", table1_tex(document, truth=truth))
    if advised:
        units = {**UNITS[axis], "critical_observer_gain": "1/s"}
        weighted = found.weighted
        advice = advise_without_map() if weighted is None else advise(found.evidence, weighted)
        write_advice(folder, advice, units)
    figure = figure2(found.friction_map, robot.curves(), axis=axis, simulated=robot.simulated)
    folder.write_text("figure2.svg", svg_text(figure))
    if found.validation is not None and found.validation.held_out.points:
        held_out = document["validation"]["held_out"]
        figure = validation_figure(held_out, axis=axis, simulated=robot.simulated)
        folder.write_text("validation.svg", svg_text(figure))


def left_out(robot: IdentifiedRobot, excluded: frozenset[str]) -> list[str]:
    """The logs that the identification left out, with the reason; not those that the campaign excludes."""
    return [f"{use.log}: {use.why}" for use in robot.runs if not use.used and use.log not in excluded]

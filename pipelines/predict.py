"""predict: the bifurcation diagram over the compensation gain r or the observer gain L.

Writes `diagram.json`, `diagram.csv` (see `diagram_file`) and `figure9.svg`.

Without a sample period it is the diagram of inclusion (8) itself. With one, the limit cycles are those of the
loop as a rig runs it, found by simulation from far starts on both sides; the equilibrium branches stay those
of the inclusion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from compensation.bifurcation import Diagram, diagram
from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller
from compensation.sampled_bifurcation import sampled_cycles
from compensation.sampled_loop import Map, Sampling
from data.recording import Axis, FloatArray
from ident.model.numbers import LARGEST
from ident.model.robot import OneLinkRobot
from pipelines.exit_status import UsageError
from pipelines.progress import Progress, Silent
from pipelines.results.diagram_file import write_diagram
from pipelines.results.folder import ResultFolder

MOST_POINTS: Final = 100_000
_SWEEP_PARTS: Final = 3


@dataclass(frozen=True)
class Sweep:
    """The values of one gain that a diagram runs over."""

    parameter: Literal["r", "L"]
    values: FloatArray  # (n,) rising; r [-] or L [1/s]


@dataclass(frozen=True)
class Prediction:
    """A diagram and what it holds for."""

    diagram: Diagram
    loop: str  # in words
    notes: tuple[str, ...]


def parse_sweep(text: str) -> Sweep:
    """`r=0.8:1.2:200` or `L=20:120:101`: start, stop and points, both ends included; raises `UsageError`."""
    rule = f"--over {text!r}: give r=START:STOP:POINTS or L=START:STOP:POINTS, as in r=0.8:1.2:200"
    name, equals, span = text.partition("=")
    parts = span.split(":")
    name = name.strip()
    if not equals or name not in {"r", "L"} or len(parts) != _SWEEP_PARTS:
        raise UsageError(rule)
    try:
        start, stop, points = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise UsageError(rule) from None
    if not 0.0 <= start < stop <= LARGEST:
        raise UsageError(f"{rule}; START must be >= 0 and below STOP, both finite, up to {LARGEST:g}")
    if not 2 <= points <= MOST_POINTS:
        raise UsageError(f"{rule}; POINTS must be from 2 to {MOST_POINTS}")
    return Sweep("r" if name == "r" else "L", np.linspace(start, stop, points))


def one_sweep(texts: Sequence[str]) -> Sweep:
    """The sweep of the command line; raises `UsageError` for none or for a map over two gains."""
    if len(texts) > 1:
        raise UsageError("--over was given more than once: maps over two gains are not drawn yet, give one")
    return parse_sweep(texts[0] if texts else "r=0.8:1.2:200")


def predict(
    robot: OneLinkRobot,
    controller: Controller,
    sweep: Sweep,
    *,
    sampling: Sampling | None = None,
    axis: Axis = "rotary",
    map: Map = map,
    progress: Progress | None = None,
) -> Prediction:
    """The diagram of a robot under a controller; the swept gain of `controller` is not used."""
    ideal = diagram(ClosedLoop(robot, controller), sweep.parameter, sweep.values)
    if sampling is None:
        return Prediction(ideal, "continuous: inclusion (8)", ())
    tick = (progress or Silent()).stage("predict", sweep.values.size)
    cycles = sampled_cycles(
        robot,
        controller,
        sampling,
        parameter=sweep.parameter,
        values=[float(value) for value in sweep.values],
        map=map,
        tick=tick,
    )
    rests = tuple(branch for branch in ideal.branches if branch.kind != "limit_cycle")
    unit = "rad" if axis == "rotary" else "m"
    counts = (
        f"encoder counts of {sampling.resolution:.6g} {unit}" if sampling.resolution else "exact positions"
    )
    notes = [
        f"limit cycles: runs of {cycles.duration:.4g} s from x1 = {cycles.starts[0]:.4g} and "
        f"{cycles.starts[1]:.4g}, the larger cycle counts; rests: those of the continuous loop"
    ]
    if cycles.undecided:
        shown = ", ".join(f"{value:.6g}" for value in cycles.undecided[:5])
        notes.append(f"{len(cycles.undecided)} values undecided, no cycle drawn there: {shown}")
    return Prediction(
        diagram=replace(ideal, branches=rests + cycles.branches, bifurcations=cycles.onsets, notes=()),
        loop=f"sampled every {sampling.period:g} s, {counts}, torque held, delay {sampling.delay} samples",
        notes=tuple(notes),
    )


def write_prediction(
    result: Prediction,
    folder: ResultFolder,
    *,
    title: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> None:
    """diagram.json, diagram.csv and figure9.svg; `title` says whose diagram it is."""
    write_diagram(folder, result.diagram, loop=result.loop, notes=result.notes)
    from pipelines.report.bifurcation_figures import figure9  # noqa: PLC0415  (matplotlib)
    from pipelines.report.style import svg_text  # noqa: PLC0415

    subtitle = f"{title}: {result.loop}" if title else result.loop
    picture = figure9(result.diagram, subtitle=subtitle, axis=axis, simulated=simulated)
    folder.write_text("figure9.svg", svg_text(picture))

"""`foxglove_layout.json`: recorded and predicted position in one plot.

Open a recording (MCAP or a ROS bag) and its `predicted/RUN.mcap` together in Foxglove, then import the
layout. What a recording calls its position and in which unit is the campaign's; the viewer turns it into SI.
The file is Foxglove's own format, so it carries no schema tag of ours.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from data.findings import LogError
from data.mcap.field_path import Step, parse_path
from data.mcap.joint_state import SIGNALS
from data.signals import Signal, Signals
from pipelines.predicted_logs import TOPIC as PREDICTED
from pipelines.results.folder import ResultFolder
from pipelines.settings.campaign import Rig

LAYOUT: Final = "foxglove_layout.json"


def write_layout(folder: ResultFolder, signals: Sequence[Signals], *, rig: Rig) -> None:
    """Write the layout: the predicted position, and the recorded one of each way that messages name it."""
    found = (_recorded(names, rig) for names in signals)
    recorded = list(dict.fromkeys(series for series in found if series is not None))
    series = [*recorded, (f"{PREDICTED}.position[0]", "headerStamp")]
    paths = [
        {"value": path, "timestampMethod": clock, "label": label, "enabled": True}
        for (path, clock), label in zip(series, [*("recorded" for _ in recorded), "predicted"], strict=True)
    ]
    plot = {
        "title": f"Position [{'rad' if rig.axis == 'rotary' else 'm'}]",
        "paths": paths,
        "xAxisVal": "timestamp",
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
    }
    layout = {
        "configById": {"Plot!position": plot},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": "Plot!position",
    }
    folder.write_text(LAYOUT, json.dumps(layout, indent=2, allow_nan=False) + "\n")


def _recorded(signals: Signals, rig: Rig) -> tuple[str, str] | None:
    """A recorded position in SI as a viewer addresses it, and its clock; None: no viewer can."""
    position = signals.position
    if position is None:
        return None
    try:
        path = parse_path(str(position.source))
        scaled = _scaling(position, rig)
    except LogError:
        return None
    fields = ".".join(map(_addressed, path.steps))
    clock = "receiveTime" if signals.clock in {"log", "publish"} else "headerStamp"
    return f"{path.topic}.{fields}{scaled}", clock


def _addressed(step: Step) -> str:
    """A step of a field path; an element by its joint's name, or the only one, as all that there are."""
    if step.index is not None:
        return f"{step.name}[{step.index}]"
    return f"{step.name}[:]" if step.joint is not None or step.name in SIGNALS else step.name


def _scaling(position: Signal, rig: Rig) -> str:
    """What turns a logged position into SI, as a viewer's path says it."""
    (factor,) = (
        replace(position, offset=0.0)
        .to_si(np.ones(1), quantity="position", axis=rig.axis, encoder_counts=rig.encoder_counts)
        .tolist()
    )
    times = "" if factor == 1.0 else f".@mul({factor!r})"
    return times + ("" if position.offset == 0.0 else f".@add({position.offset!r})")

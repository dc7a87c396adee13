"""What heads fit_report.txt: the outcome in words and numbers, for somebody at the rig.

Values with their intervals, what is withheld and why, what the values rest on, how well they predict runs
that the fit had not seen, and what was noticed. lmfit's own report follows whole. All is read off robot.json.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from data.names import shown
from pipelines.report.axis_units import AxisUnits, units_of
from pipelines.report.numerals import shown_number
from pipelines.report.tables import WORDS, Entry, reasons_withheld, table1_entries

_WIDTH: Final = 100
_LONGEST: Final = 1500
_TITLES: Final = {"": "", "positive": "positive direction", "negative": "negative direction", "mean": "mean"}
_GRAVEST_FIRST: Final = ("refuse", "withhold", "warn")


def fit_report(robot: Mapping[str, Any], own: str) -> str:
    """The whole file: a summary, then `own`, the report of the fit itself."""
    units = units_of(robot.get("axis", "rotary"))
    simulated = " (SIMULATED logs of a virtual rig)" if robot.get("simulated") else ""
    entries = table1_entries(robot)
    parts = [
        _headed(f"Friction identification{simulated}", _values(entries)),
        _headed("Withheld, and what would identify it", _withheld(entries)),
        _headed("What the values rest on", _basis(robot, units)),
        _headed("Prediction of runs that the fit had not seen", _validation(robot, units)),
        _headed("Findings, the gravest first", _findings(robot.get("notes") or ())),
        _headed("The fit's own report (lmfit)", own.rstrip().splitlines()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _headed(title: str, lines: Sequence[str]) -> str:
    return "\n".join([title, "=" * len(title), *lines]) if lines else ""


def _values(entries: Iterable[Entry]) -> list[str]:
    lines, last = ["Values with 95 % intervals; torques are magnitudes in the direction of motion."], "?"
    for entry in sorted(entries, key=lambda entry: list(_TITLES).index(entry.direction)):
        if entry.direction != last:
            lines += ["", _TITLES[entry.direction]] if entry.direction else [""]
            last = entry.direction
        value = entry.shown_value if entry.value is not None else "withheld"
        interval = entry.shown_interval if entry.fixed or entry.interval95 else ""
        label = f"{entry.symbol:4} {WORDS[entry.parameter]}"
        lines.append(f"  {label:24} {value:>11} {interval:26} {entry.unit}".rstrip())
    return lines


def _withheld(entries: Sequence[Entry]) -> list[str]:
    own = [entry for entry in entries if entry.direction != "mean"]
    lines = []
    for why, lacking in reasons_withheld(own).items():
        names = (f"{one.symbol} ({one.direction})" if one.direction else one.symbol for one in lacking)
        lines += _item(f"{', '.join(names)}: {shown(why, _LONGEST)}")
    return lines


def _basis(robot: Mapping[str, Any], units: AxisUnits) -> list[str]:
    runs: Sequence[Mapping[str, Any]] = [
        run for run in robot.get("runs") or () if run.get("protocol") != "set_point"
    ]
    lines = []
    for protocol in dict.fromkeys(str(run["protocol"]) for run in runs):
        own = [run for run in runs if run["protocol"] == protocol]
        used = sum(bool(run["used"]) for run in own)
        lines += _item(f"{protocol.replace('_', ' ')}: {used} of {len(own)} logs used")
    for own in robot.get("breakaways") or ():
        lines += _item(_breakaways(own, units))
    for run in runs:
        if not run["used"]:
            lines += _item(f"left out: {shown(str(run['log']), 200)}: {shown(str(run['why']), _LONGEST)}")
    return lines


def _breakaways(own: Mapping[str, Any], units: AxisUnits) -> str:
    text = f"F_s, {own['direction']} direction: {own['used']} breakaways"
    if own["used"]:
        slow, fast = (shown_number(rate) for rate in own["ramp_rates"])
        near, far = (shown_number(place) for place in own["places"])
        low, high = (shown_number(torque) for torque in own["torque"])
        text += f" under ramps of {slow} to {fast} {units.torque}/s, at places from {near} to {far} "
        text += f"{units.position}: {low} to {high} {units.torque}"
        if own["spread"] is not None:
            text += f", a spread of {shown_number(own['spread'])}"
    if own["censored"]:
        text += f"; {own['censored']} ramps ended at the torque limit and only bound it"
    return text


def _validation(robot: Mapping[str, Any], units: AxisUnits) -> list[str]:
    validation: Mapping[str, Any] = robot.get("validation") or {}
    held_out: Mapping[str, Any] = validation.get("held_out") or {}
    if not held_out.get("predicted"):
        return _item("too few runs to leave any out") if validation else []
    lines = _item(
        f"{held_out['predicted']} runs and breakaways, left out in {held_out['folds']} folds and predicted "
        f"from the rest: {held_out['inside95']} lie in their 95 % prediction intervals; the error is "
        f"{shown_number(held_out['torque_rms'])} {units.torque} rms, "
        f"{shown_number(held_out['standardised_rms'])} of what was expected"
    )
    for test in held_out["tests"]:
        lines += _item(
            f"{test['name']}: {shown_number(test['statistic'])}, {shown_number(test['expected'])} expected; "
            f"chance alone gives as much with p = {test['chance']:.2g}"
        )
    return lines + _motions(validation.get("ramps") or (), units)


def _motions(ramps: Sequence[Mapping[str, Any]], units: AxisUnits) -> list[str]:
    """A table of the motions after breakaway."""
    if not ramps:
        return []
    lines = _item(
        "motion after breakaway, simulated by a law that had not seen its log; onset: predicted less "
        "recorded; position: rms over the travel, from the ramp's own F_s"
    )
    where = units.position
    head = ("at [s]", "onset [s]", f"travel [{where}]", f"position [{where}]", "in counts")
    rows = [
        (
            shown_number(motion["onset_time"]),
            f"{motion['onset_error']:+.4f}".replace("-", "−"),
            shown_number(motion["direction"] * motion["travel"]),
            f"{motion['position_rms']:.2g}",
            f"{motion['counts_rms']:.0f}",
        )
        for motion in ramps
    ]
    names = ("log", *(shown(str(motion["log"]), 200) for motion in ramps))
    cells = ("".join(f"{cell:>15}" for cell in row) for row in (head, *rows))
    return lines + [f"{row}  {name}" for row, name in zip(cells, names, strict=True)]


def _findings(notes: Iterable[Mapping[str, Any]]) -> list[str]:
    order = {severity: rank for rank, severity in enumerate(_GRAVEST_FIRST)}
    ranked = sorted(notes, key=lambda note: order.get(str(note["severity"]), len(order)))
    return [
        line
        for note in ranked
        for line in _item(f"{note['code']} ({note['severity']}): {shown(_with_log(note), _LONGEST)}")
    ]


def _with_log(note: Mapping[str, Any]) -> str:
    """A finding with the log it was seen in, where its text does not name it."""
    text, log = str(note["text"]), note.get("log")
    return text if not log or str(log) in text else f"{log}: {text}"


def _item(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False)

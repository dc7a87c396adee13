"""The first screen of the report: four questions of a rig engineer, each answered in a line or two.

What is the friction law? How sure is it? Which gains? Does the prediction match the recorded runs? The
answers are read off the results; nothing is estimated here. The friction law itself is a small table and
stands in the template.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from data.names import shown
from pipelines.report.axis_units import AxisUnits
from pipelines.report.numerals import half_width, shown_interval, shown_number, shown_percent
from pipelines.report.tables import DIRECTIONS, WORDS, Entry

Tone = Literal["good", "caution", "bad", "none"]


@dataclass(frozen=True)
class Answer:
    """One card: what is asked, the answer in a line, and what stands behind it."""

    question: str
    headline: str
    tone: Tone
    lines: tuple[str, ...] = ()


def how_sure(robot: Mapping[str, Any], entries: Sequence[Entry]) -> Answer:
    """What is identified and how narrowly, what is withheld, and how many runs stand behind it."""
    own = [entry for entry in entries if entry.direction != "mean"]
    withheld = [entry for entry in own if entry.value is None]
    free = [entry for entry in own if entry.value is not None and not entry.fixed]
    lines = [f"Withheld: {_name(entry)}. {shown(entry.withheld or '', 300)}" for entry in withheld]
    lines += _widest(free)
    lines += _truth_inside(free)
    runs: Sequence[Mapping[str, Any]] = robot.get("runs") or ()
    fitted = [run for run in runs if run.get("protocol") != "set_point"]
    if fitted:
        used = sum(bool(run.get("used")) for run in fitted)
        lines.append(f"Logs used for the law: {used} of {len(fitted)}.")
    notes = Counter(str(note.get("severity")) for note in robot.get("notes") or ())
    if notes:
        lines.append("Findings: " + ", ".join(_counted(notes)) + ".")
    if withheld:
        return Answer(
            "How sure is it?", f"{len(withheld)} of {len(own)} values withheld", "caution", tuple(lines)
        )
    tone: Tone = "caution" if notes.get("refuse") or notes.get("withhold") else "good"
    return Answer("How sure is it?", f"All {len(free)} free values identified", tone, tuple(lines))


def which_gains(design: Mapping[str, Any] | None, units: AxisUnits) -> Answer:
    """The recommended gains, why, and the critical gain that they respect."""
    question = "Which gains?"
    if not design:
        return Answer(
            question, "No design", "none", ("This run made no design, so no gains are recommended.",)
        )
    recommended: Mapping[str, Any] = design.get("recommended") or {}
    parts = [
        f"{symbol} = {shown_number(recommended[key])}{unit}"
        for key, symbol, unit in (("observer_gain", "L", " 1/s"), ("compensation_gain", "r", ""))
        if isinstance(recommended.get(key), int | float)
    ]
    lines = []
    compensator = recommended.get("compensator")
    if isinstance(compensator, str):
        lines.append(f"Compensator: {shown(compensator, 200)}.")
    if recommended.get("why"):
        lines.append(shown(str(recommended["why"]), 600))
    rest = recommended.get("largest_rest_error")
    if rest is not None:
        lines.append(f"Largest rest error that they leave: {shown_number(rest)} {units.position}.")
    worst = (design.get("critical_observer_gain") or {}).get("worst") or {}
    if worst.get("value") is not None:
        interval = worst.get("interval95")
        value = shown_number(worst["value"], like=half_width(interval))
        bracket = f" {shown_interval(interval)}" if interval else ""
        lines.append(f"Critical observer gain, worse direction: {value}{bracket} 1/s.")
    elif worst:
        why = shown(str(worst.get("withheld") or "the law is infinitely steep at rest"), 300)
        lines.append(f"No finite critical observer gain: {why}.")
    lines += [shown(str(why), 600) for why in design.get("withheld") or () if not design.get("gains")]
    return Answer(
        question, ", ".join(parts) or "None recommended", "good" if parts else "caution", tuple(lines)
    )


def does_it_match(
    comparison: Mapping[str, Any] | None, units: AxisUnits, left_out: str | None = None
) -> Answer:
    """How many recorded runs do what was predicted from their own start, and where cycling sets in.

    `left_out` says why there is no comparison, where there is none.
    """
    question = "Does the prediction match the recorded runs?"
    if not comparison or not comparison.get("runs"):
        return Answer(
            question, "No comparison", "none", (shown(left_out or "There are no compared runs.", 600),)
        )
    runs: Sequence[Mapping[str, Any]] = comparison["runs"]
    decided = [
        run
        for run in runs
        if run.get("verdict") != "undecided" and (run.get("predicted") or {}).get("verdict")
    ]
    same = [run for run in decided if run["verdict"] == run["predicted"]["verdict"]]
    lines = [_onset_line(onset, units) for onset in comparison.get("onset") or ()]
    agreement: Mapping[str, Any] = comparison.get("agreement") or {}
    if isinstance(agreement.get("amplitude_rms"), int | float):
        lines.append(f"Amplitudes differ by {shown_number(agreement['amplitude_rms'])} {units.position} rms.")
    undecided = len(runs) - len(decided)
    if undecided:
        lines.append(f"{undecided} of {len(runs)} runs are undecided or without a prediction.")
    if not decided:
        return Answer(question, "Cannot be told", "caution", tuple(lines))
    share = len(same) / len(decided)
    tone: Tone = "good" if share == 1 else "caution" if share >= 0.9 else "bad"
    return Answer(question, f"{len(same)} of {len(decided)} runs end as predicted", tone, tuple(lines))


def _onset_line(onset: Mapping[str, Any], units: AxisUnits) -> str:
    below, above = onset.get("recorded") or (None, None)
    recorded = f"between r = {shown_number(below)} and {shown_number(above)}"
    if below is None or above is None:
        recorded = (
            f"below r = {shown_number(above)}" if above is not None else f"above r = {shown_number(below)}"
        )
    if below is None and above is None:
        recorded = "not recorded"
    return (
        f"Cycling from {start_name(onset.get('start'))} {units.position} begins {recorded}; "
        f"predicted {shown_number(onset.get('predicted'))}, "
        f"symmetric robot {shown_number(onset.get('symmetric'))}."
    )


def start_name(start: object) -> str:
    """The position [rad] that a run was released from, as text."""
    first = start[0] if isinstance(start, list | tuple) and start else start
    return f"{first:+.3g}".replace("-", "−") if isinstance(first, int | float) else shown(str(first), 60)


def _counted(notes: Counter[str]) -> list[str]:
    words = {"refuse": "refused", "withhold": "withheld", "warn": "to note"}
    return [f"{notes[severity]} {word}" for severity, word in words.items() if notes[severity]]


def _widest(entries: Iterable[Entry]) -> list[str]:
    widths = [
        (half / abs(entry.value), entry)
        for entry in entries
        if (half := half_width(entry.interval95)) is not None and entry.value
    ]
    if not widths:
        return []
    width, entry = max(widths, key=lambda pair: pair[0])
    return [f"Widest 95 % interval: {_name(entry)}, ±\N{NO-BREAK SPACE}{shown_percent(width)}."]


def _truth_inside(entries: Iterable[Entry]) -> list[str]:
    told = [entry for entry in entries if entry.truth is not None and entry.interval95 is not None]
    inside = [entry for entry in told if _holds(entry)]
    return [f"The truth lies inside {len(inside)} of {len(told)} intervals (simulated logs)."] if told else []


def _holds(entry: Entry) -> bool:
    low, high = entry.interval95 or (None, None)
    truth = entry.truth
    return truth is not None and (low is None or low <= truth) and (high is None or truth <= high)


def _name(entry: Entry) -> str:
    direction = DIRECTIONS.get(entry.direction, "")
    return WORDS[entry.parameter] + (f" ({direction})" if direction else "")

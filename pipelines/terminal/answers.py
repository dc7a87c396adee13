"""What a command prints: a few lines read off the result files, for people. Programs ask for --json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

ONSET_ROW: Final = "  {:>7}  {:<18} {:<26} {:<9} {}"
ONSET_COLUMNS: Final = ("recorded", "predicted [95 %]", "ideal", "symmetric")
SHOWN: Final = 12  # withheld things that are listed; the rest is counted


def design(document: Mapping[str, Any]) -> list[str]:
    """Critical gains, the rests that coexist with the cycle, and the recommendation."""
    lines = ["critical observer gain L_c [1/s]"]
    for name, entry in document["critical_observer_gain"].items():
        lines.append(f"  {name:<9} {_number(entry['value'], 'withheld')}{_interval(entry.get('interval95'))}")
        if entry["value"] is None:
            lines[-1] += f" ({entry['withheld']})"
    largest = document["rests_beside_the_cycle"]["r_max"]
    if largest["value"] is not None:
        lines.append(
            "rests off the set point, beside any limit cycle, up to "
            f"r = {largest['value']:.5g}{_interval(largest['interval95'])} "
            f"at L = {document['gains']['observer']:.4g} 1/s"
        )
    advice = document["recommended"]
    if advice["observer_gain"] is not None:
        lines.append(
            f"recommended: L = {advice['observer_gain']:.4g} 1/s, r = {advice['compensation_gain']:.4g}, "
            f"compensator {advice['compensator']}"
        )
    return [*lines, str(advice["why"])]


def diagram(document: Mapping[str, Any]) -> list[str]:
    """The branches and bifurcations."""
    parameter = document["parameter"]
    lines = [document["loop"]]
    for branch in document["branches"]:
        values = [point[parameter] for point in branch["points"]]
        stable = "stable" if branch["stable"] else "unstable"
        if values:
            lines.append(f"{parameter} {min(values):.6g} to {max(values):.6g}: {branch['kind']}, {stable}")
    lines += [f"{parameter} = {found[parameter]:.6g}: {found['kind']}" for found in document["bifurcations"]]
    return [*lines, *document["notes"]]


def advice(document: Mapping[str, Any]) -> list[str]:
    """What to record next, a few lines a quantity."""
    lines = ["what to record next: half-width of the 95 % interval, as expected"]
    units = {one["quantity"]: one["unit"] for one in document["advice"]}
    for one in document["advice"]:
        what = f"{one['direction']} {one['quantity'].replace('_', ' ')} [{one['unit']}]"
        if one["why_none"] is not None:
            lines.append(f"  {what}: {one['why_none']}")
            continue
        now, then = _number(one["half_width_now"], "unbounded"), _number(one["half_width_then"])
        reduced = "" if one["reduction"] is None else f" (-{100 * one['reduction']:.0f} %)"
        lines.append(f"  {what}: {now} now, {then} with all of these{reduced}")
        lines += [f"    {_next_run(run, units)}" for run in one["runs"]]
    return lines


def _next_run(run: Mapping[str, Any], units: Mapping[str, str]) -> str:
    after = f"then {_number(run['half_width'])}"
    if run["protocol"] == "breakaway":
        rate = f"at {_number(run['ramp_rate'])} {units['static_torque']}/s"
        return f"{run['times']} x breakaway, {run['direction']}, {rate}; {after}"
    speed = f"{_number(run['speed'])} {units['stribeck_velocity']} for {_number(run['duration'])} s"
    return f"{run['times']} x constant velocity, {run['direction']}, {speed}; {after}"


def comparison(document: Mapping[str, Any]) -> list[str]:
    """The onsets and how far prediction and record agree."""
    lines = ["onset of limit cycling, r", ONSET_ROW.format("start", *ONSET_COLUMNS)]
    for onset in document["onset"]:
        low, high = onset["recorded"]
        cells = (
            f"{_number(low)} to {_number(high)}",
            _number(onset["predicted"]) + _interval(onset["predicted_interval95"]),
            _number(onset["ideal"]),
            _number(onset["symmetric"]),
        )
        lines.append(ONSET_ROW.format(f"{onset['start']:+.3f}", *cells))
    agreement = document["agreement"]
    same, compared = agreement["verdicts_same"], agreement["verdicts_compared"]
    lines.append(
        f"verdicts: {same} of {compared} decided runs as predicted; "
        f"amplitude off by {_number(agreement['amplitude_rms'])} (rms)"
    )
    return lines


def withheld(missing: Sequence[str]) -> list[str]:
    """What was withheld, salvaged or left out."""
    lines = [f"withheld or left out: {sentence}" for sentence in missing[:SHOWN]]
    return lines + ([f"and {len(missing) - SHOWN} more"] if len(missing) > SHOWN else [])


def _number(value: float | None, absent: str = "-") -> str:
    return absent if value is None else f"{value:.4g}"


def _interval(ends: Sequence[float | None] | None) -> str:
    return "" if ends is None else f" [{_number(ends[0], 'open')}, {_number(ends[1], 'open')}]"

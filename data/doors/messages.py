"""The door for logs of messages, MCAP and ROS bags: fields brought onto the clock of the position's topic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from data.alignment import align
from data.bag.columns import read_columns as read_bag_columns
from data.began import began
from data.clocks import drift
from data.doors.door import Door, FloatArray, Logged, after_first, interval, require_sane_clock, unset
from data.elapsed import since_first, unset_lead
from data.findings import Finding, LogError, Severity
from data.integrity import Integrity
from data.mcap.columns import McapColumns, Topic, read_columns, survey
from data.mcap.field_path import FieldPath, parse_path
from data.mcap.records import ByteArray
from data.names import shown
from data.signals import Clock, Signal
from data.units import Quantity


class _Columns(Protocol):
    """Reads wanted fields of a log; one of them may be the clock."""

    def __call__(self, wanted: Sequence[FieldPath], *, clock: FieldPath | None) -> McapColumns:
        """Their columns; raises LogError."""


def read_mcap_log(door: Door, content: ByteArray) -> Logged:
    """The wanted fields of an MCAP file in SI; raises LogError."""
    return _read(door, partial(read_columns, content), partial(survey, content))


def read_bag_log(door: Door, content: ByteArray) -> Logged:
    """The wanted fields of a ROS bag in SI; raises LogError."""
    if door.signals.clock == "publish":
        raise LogError(f'{door.log}: a ROS bag keeps no publish times; set clock = "log" or "header"')
    return _read(door, partial(read_bag_columns, door.path), lambda: Integrity("absent"))


def _read(door: Door, columns: _Columns, surveyed: Callable[[], Integrity]) -> Logged:
    wanted = door.wanted()
    paths: dict[Quantity, FieldPath] = {}
    named: dict[Quantity, Signal] = dict(wanted)
    if door.signals.time is not None:
        named["time"] = door.signals.time
    try:
        for quantity, signal in named.items():
            paths[quantity] = parse_path(str(signal.source))
    except LogError as error:
        raise LogError(f"{door.log}: {error}") from error
    try:
        read = columns(list(dict.fromkeys(paths.values())), clock=paths.get("time"))
    except LogError as error:  # damage goes first: what is missing may be what is lost
        damage = surveyed().require(door.log, salvage=door.salvage)
        raise LogError("; ".join((f"{door.log}: {error}", *(finding.text for finding in damage)))) from error
    damage = read.integrity.require(door.log, salvage=door.salvage)
    topic = read.topics[paths["position"].topic]
    clock, name, noted = _clock(door, topic)
    lead = unset_lead(clock / 1e9)
    signals: dict[Quantity, FloatArray] = {}
    findings = [*damage, *noted]
    for quantity, signal in wanted.items():
        values, held = _on_clock(read, paths[quantity], paths["position"], clock=clock, name=name)
        if held is not None:
            findings.append(Finding("E-CLOCK", Severity.WARN, f"{quantity} {held}", door.log))
        signals[quantity] = door.convert(quantity, signal, values)
    seconds = (clock[lead:] - clock[lead]) / 1e9
    if "time" in named:
        path = paths["time"]
        if path.topic != paths["position"].topic:
            raise LogError(f"{door.log}: time must be a field of the position's topic, not of {path.topic!r}")
        time, name = interval(named["time"]), f"field {path.text}"
        stamps = door.convert("time", time, topic.values[path.text])
        require_sane_clock(door, stamps)
        lead = unset_lead(stamps)
        seconds = door.convert("time", time, since_first(topic.ticks[lead:]))
    findings += unset(door, lead, name)
    signals = {quantity: values[lead:] for quantity, values in signals.items()}
    begun = began(float(clock[lead]) / 1e9, read.metadata)
    lost = tuple(place - lead for place in read.integrity.breaks(topic.log_time) if place > lead)
    logged = Logged(seconds, signals, name, read.metadata, tuple(findings), begun, breaks=lost)
    return after_first(logged)


def _clock(door: Door, topic: Topic) -> tuple[NDArray[np.int64], str, tuple[Finding, ...]]:
    """The position topic's clock [ns]: the one asked for, else the header's stamps where they run."""
    asked: Clock | None = door.signals.clock
    if asked == "log":
        return topic.log_time, "log times", ()
    if asked == "publish":
        return topic.publish_time, "publish times", ()
    header = topic.header_time
    if header is not None and (asked == "header" or np.any(header != header[0]) or header.size < 2):
        return header, "header stamps", _drifting(door, header, topic.log_time)
    if asked == "header":
        raise LogError(f'{door.log}: the messages carry no header stamp; set clock = "log" in [signals]')
    if header is None:
        return topic.log_time, "log times", ()
    text = (
        f"all header stamps are {header[0] * 1e-9:g} s, so the log times are the clock; they carry the "
        'recorder\'s jitter. Set clock = "log" in [signals] to say so'
    )
    return topic.log_time, "log times", (Finding("E-CLOCK", Severity.WARN, text, door.log),)


def _drifting(door: Door, header: NDArray[np.int64], log: NDArray[np.int64]) -> tuple[Finding, ...]:
    """What is said of header stamps [ns] that run faster or slower than the log's times [ns]."""
    lead = max(unset_lead(header / 1e9), unset_lead(log / 1e9))
    if header.size <= lead:
        return ()
    found = drift((header[lead:] - header[lead]) / 1e9, (log[lead:] - log[lead]) / 1e9)
    if found is None:
        return ()
    text = (
        f"the log times drift from the header stamps, which are the clock, by {found.total:.4g} s over the "
        f"run, {100 * found.rate:.3g} %: one of the two clocks runs wrong, and every speed, b and the "
        "inertia by as much if it is the header's. "
        'Set `clock = "log"` in [signals] if the recorder\'s is better'
    )
    return (Finding("E-CLOCK", Severity.WARN, text, door.log),)


def _on_clock(
    read: McapColumns, path: FieldPath, master: FieldPath, *, clock: NDArray[np.int64], name: str
) -> tuple[FloatArray, str | None]:
    """A signal at the position's stamps, and a sentence when it had to be held for long."""
    topic = read.topics[path.topic]
    values = topic.values[path.text]
    if path.topic == master.topic:
        return values, None
    stamp = {"log times": topic.log_time, "publish times": topic.publish_time}.get(name, topic.header_time)
    stamp = topic.log_time if stamp is None else stamp
    begin = clock[unset_lead(clock / 1e9)]
    latched = np.arange(stamp.size) < unset_lead(stamp / 1e9)  # it holds from before the run began
    aligned = align(clock, np.where(latched, begin, stamp), values)
    period = float(np.median(np.diff(clock))) * 1e-9 if clock.size > 1 else 0.0
    if aligned.together or aligned.longest_hold <= 3.0 * period:
        return aligned.values, None
    return aligned.values, (
        f"({shown(path.topic)}) comes on its own clock and was held for up to {aligned.longest_hold:.4g} s "
        f"between its messages, {aligned.longest_hold / period:.0f} position samples"
        if period > 0.0
        else "is on another clock"
    )

"""From a log file to a `Recording`: the file door.

A log is opened by its format, the columns that the campaign names are read, units become SI, the clock is
chosen and said, the run is cut to its window, screened, and handed on with everything that was noticed. What
comes out can be trusted or says why not; what cannot be used is one `LogError`.
"""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.alignment import align
from data.began import began
from data.clocks import drift
from data.csv.description import TIME_NAMES
from data.csv.dialect import bare, sniff
from data.csv.log import elapsed, find_column, read_csv, table_integrity
from data.elapsed import since_first, unset_lead
from data.findings import Finding, LogError, Severity
from data.mcap.columns import McapColumns, Topic, read_columns, survey
from data.mcap.field_path import FieldPath, parse_path
from data.mcap.records import ByteArray
from data.names import shown
from data.protocols import ProtocolName
from data.recording import Axis, Recording
from data.resolution import lattice_spacing
from data.screening.run import Run
from data.screening.scale import require_count
from data.screening.screen import require_samples, screen
from data.signals import Clock, RigSignals, Signal, Signals, log_format
from data.units import Quantity, known_unit, same_unit, si_word

FloatArray = NDArray[np.float64]

_TURN: Final = 2.0 * np.pi


@dataclass(frozen=True)
class _Logged:
    """One file's wanted signals in SI; arrays are (n,)."""

    time: FloatArray  # [s] from the first sample
    signals: Mapping[Quantity, FloatArray]
    clock: str
    metadata: Mapping[str, str]
    findings: tuple[Finding, ...]
    begun: float | None  # from 1970 [s]


@dataclass(frozen=True)
class _Door:
    """What is needed to read and convert one file."""

    path: Path
    log: str
    signals: Signals
    axis: Axis
    encoder_counts: float | None  # [1/revolution], linear [1/m]
    salvage: bool

    def wanted(self) -> dict[Quantity, Signal]:
        """The signals to read, by quantity; position and torque must be named."""
        named: dict[Quantity, Signal | None] = {
            "position": self.signals.position,
            "torque": self.signals.torque,
            "velocity": self.signals.velocity,
            "reference": self.signals.reference,
        }
        for quantity in ("position", "torque"):
            if named[quantity] is None:
                file_format = log_format(self.path)
                raise LogError(
                    f"{self.log}: [signals] names no {quantity} for {file_format} logs; "
                    f'add {file_format} = "..." to {quantity}. `stribeck inspect` lists what the log holds'
                )
        return {quantity: signal for quantity, signal in named.items() if signal is not None}

    def convert(self, quantity: Quantity, signal: Signal, values: FloatArray) -> FloatArray:
        try:
            return signal.to_si(values, quantity=quantity, axis=self.axis, encoder_counts=self.encoder_counts)
        except LogError as error:
            raise LogError(f"{self.log}: {quantity}: {error}") from error


def read_recording(
    path: Path,
    *,
    log: str,
    protocol: ProtocolName,
    signals: RigSignals,
    axis: Axis = "rotary",
    encoder_counts: float | None = None,
    torque_limit: float | None = None,
    window: tuple[float, float] | None = None,
    salvage: bool = False,
) -> Recording:
    """Read one run.

    Parameters
    ----------
    path, log
        The file, and what the campaign calls it.
    protocol
        What was asked of the rig.
    signals
        How the rig's logs name things.
    axis, encoder_counts, torque_limit
        Of the rig: counts in a revolution (linear: in a metre), limit [N m].
    window
        Begin and end [s] from the start of the log; None: all of it.
    salvage
        Go on with what a damaged log still holds.

    Raises
    ------
    LogError
        When the file is missing, damaged, lacks a signal, contradicts a unit, or is refused by the screening.
    """
    door = _Door(path, log, signals.of(log_format(path)), axis, encoder_counts, salvage)
    content = read_bytes(path, log=log)
    logged = _read_mcap(door, content) if log_format(path) == "mcap" else _read_csv(door, content)
    run = Run(
        log=log,
        protocol=protocol,
        time=logged.time,
        position=logged.signals["position"],
        torque=logged.signals["torque"],
        velocity=logged.signals.get("velocity"),
        reference=logged.signals.get("reference"),
    )
    if window is not None:
        run = _cut(run, window)
    recording = screened_recording(
        run, clock=logged.clock, axis=axis, encoder_counts=encoder_counts, torque_limit=torque_limit
    )
    return replace(
        recording,
        begun=logged.begun,
        simulated=logged.metadata.get("simulated", "").strip().lower() == "true",
        sha256=hashlib.sha256(content.data).hexdigest(),
        metadata=logged.metadata,
        findings=(*logged.findings, *recording.findings),
    )


def screened_recording(
    run: Run,
    *,
    clock: str,
    axis: Axis = "rotary",
    encoder_counts: float | None = None,
    torque_limit: float | None = None,
) -> Recording:
    """A run in SI as a recording, screened; `clock` says what its time is. Parameters as `read_recording`.

    Raises
    ------
    LogError
        When the screening refuses the run.
    """
    require_samples(run)
    resolution = _resolution(run, axis=axis, encoder_counts=encoder_counts)
    screened = screen(run, clock=clock, resolution=resolution, torque_limit=torque_limit)
    kept = screened.signals
    return Recording(
        log=run.log,
        protocol=run.protocol,
        time=kept.time,
        position=kept.position,
        torque=kept.torque,
        velocity=kept.velocity,
        reference=kept.reference,
        resolution=resolution,
        torque_limit=screened.torque_limit,
        axis=axis,
        findings=screened.findings,
        breaks=kept.breaks,
    )


def read_bytes(path: Path, *, log: str) -> ByteArray:
    """A file's bytes, mapped rather than read.

    Raises
    ------
    LogError
        When there is no such file, it is a folder, empty, or may not be read.
    """
    try:
        if path.is_dir():
            raise LogError(f"{log} is a folder, not a log file")
        with path.open("rb") as stream:
            if not path.is_file():
                raise LogError(f"{log} is no regular file")
            if path.stat().st_size == 0:
                raise LogError(
                    f"{log} is empty (0 bytes): nothing was recorded. Record it again or exclude it"
                )
            mapped = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError as error:
        raise LogError(f"{log}: there is no such file") from error
    except (OSError, ValueError) as error:
        raise LogError(f"{log} cannot be read: {error}") from error
    return np.frombuffer(mapped, np.uint8)


def _resolution(run: Run, *, axis: Axis, encoder_counts: float | None) -> float | None:
    """One encoder count [rad], declared or found; raises LogError where the positions belie the declared."""
    found = lattice_spacing(run.position[np.isfinite(run.position)])
    if encoder_counts is None:
        return found
    declared = (_TURN if axis == "rotary" else 1.0) / encoder_counts
    if found is not None:
        require_count(run, found=found, declared=declared)
    return declared


def _cut(run: Run, window: tuple[float, float]) -> Run:
    begin, end = window
    inside = (run.time >= begin) & (run.time <= end)
    if not inside.any():
        raise LogError(
            f"{run.log}: nothing lies in its window of {begin:g} to {end:g} s; the log lasts "
            f"{run.time[-1] - run.time[0]:g} s from its start"
        )
    return run.keep(inside)


def _read_csv(door: _Door, content: ByteArray) -> _Logged:
    raw = content.tobytes()
    try:
        layout = sniff(raw, door.signals.dialect)
        wanted = door.wanted()
        time = door.signals.time or _plain_time(layout.headers, layout.units)
        columns = {quantity: find_column(layout, signal.source) for quantity, signal in wanted.items()}
        columns["time"] = find_column(layout, time.source)
        for quantity, signal in {**wanted, "time": time}.items():
            _require_unit(quantity, signal, layout.units[columns[quantity]], axis=door.axis)
        table = read_csv(raw, layout, columns.values())
    except LogError as error:
        text = str(error)
        raise LogError(text if text.startswith(door.log) else f"{door.log}: {text}") from error
    values = {quantity: table.values[column] for quantity, column in columns.items()}
    integrity = table_integrity(table, rows=values["time"].size)
    findings = integrity.require(door.log, salvage=door.salvage)
    name = layout.headers[columns["time"]] if layout.headers else str(columns["time"])
    clock = f"column {shown(name)!r}"
    stamps = door.convert("time", _interval(time), values.pop("time"))
    lead = unset_lead(stamps)
    return _Logged(
        time=door.convert("time", _interval(time), elapsed(table, columns["time"], begin=lead)),
        signals={
            quantity: door.convert(quantity, wanted[quantity], values[quantity][lead:]) for quantity in wanted
        },
        clock=clock,
        metadata=layout.metadata,
        findings=(*findings, *_unset(door, lead, clock)),
        begun=began(float(stamps[lead]) if stamps.size > lead else 0.0, layout.metadata),
    )


def _interval(time: Signal) -> Signal:
    """How differences of a time convert: an offset of the clock is none of theirs."""
    return replace(time, offset=0.0)


def _unset(door: _Door, lead: int, clock: str) -> tuple[Finding, ...]:
    """What is said of samples at the start whose stamp is 0."""
    if not lead:
        return ()
    text = (
        f"{lead} sample(s) at the start carry time 0 on the clock ({clock}), the others a date: latched "
        "before it ran, so that their instant is not known; they are left out"
    )
    return (Finding("E-CLOCK", Severity.WARN, text, door.log),)


def _plain_time(headers: tuple[str, ...], units: tuple[str | None, ...]) -> Signal:
    """The column that is plainly the time, with the unit that its header declares."""
    for k, header in enumerate(headers):
        if bare(header).lower() in TIME_NAMES:
            return Signal(k, unit=units[k] if units[k] else None)
    raise LogError(
        "[signals] names no time for csv logs, and no column is plainly the time "
        f'(one of {", ".join(TIME_NAMES)}); add time = {{ csv = "..." }}'
    )


def _require_unit(quantity: Quantity, signal: Signal, declared: str | None, *, axis: Axis) -> None:
    """Refuse a file that declares another unit than the campaign does."""
    if declared is None or known_unit(declared) is None:
        return
    stated = signal.unit or si_word(quantity, axis)
    if same_unit(stated, declared):
        return
    source = "the campaign says" if signal.unit else "the campaign names no unit, which means"
    raise LogError(
        f"E-UNIT refuse: the log declares {quantity} in {declared!r}, but {source} {stated!r}; every "
        f"parameter drawn from it would be wrong by their ratio. If the log is right, set "
        f'unit = "{declared}" on {quantity}'
    )


def _read_mcap(door: _Door, content: ByteArray) -> _Logged:
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
        read = read_columns(content, list(dict.fromkeys(paths.values())), clock=paths.get("time"))
    except LogError as error:  # damage goes first: what is missing may be what is lost
        damage = survey(content).require(door.log, salvage=door.salvage)
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
        time, name = _interval(named["time"]), f"field {path.text}"
        lead = unset_lead(door.convert("time", time, topic.values[path.text]))
        seconds = door.convert("time", time, since_first(topic.ticks[lead:]))
    findings += _unset(door, lead, name)
    signals = {quantity: values[lead:] for quantity, values in signals.items()}
    begun = began(float(clock[lead]) / 1e9, read.metadata)
    logged = _Logged(seconds, signals, name, read.metadata, tuple(findings), begun)
    return _after_first(logged)


def _clock(door: _Door, topic: Topic) -> tuple[NDArray[np.int64], str, tuple[Finding, ...]]:
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


def _drifting(door: _Door, header: NDArray[np.int64], log: NDArray[np.int64]) -> tuple[Finding, ...]:
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


def _after_first(logged: _Logged) -> _Logged:
    """The run from where every signal has had its first message.

    A reference that has not been sent yet stands at its first value: nothing else is known of it.
    """
    signals = dict(logged.signals)
    if "reference" in signals:
        reference = signals["reference"]
        known = np.flatnonzero(~np.isnan(reference))
        if known.size:
            signals["reference"] = np.where(
                np.arange(reference.size) < known[0], reference[known[0]], reference
            )
    held = [signals[quantity] for quantity in ("torque", "velocity") if quantity in signals]
    late = max((int(np.argmax(~np.isnan(array))) for array in held if np.isnan(array[0])), default=0)
    if late == 0:
        return replace(logged, signals=signals)
    return replace(
        logged,
        time=logged.time[late:],
        signals={quantity: array[late:] for quantity, array in signals.items()},
    )

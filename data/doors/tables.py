"""The door for logs that are typed columns: Parquet and MATLAB files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from data.began import began
from data.doors.door import (
    Door,
    FloatArray,
    Logged,
    interval,
    plain_clock,
    require_sane_clock,
    require_unit,
    unset,
)
from data.elapsed import unset_lead
from data.findings import LogError
from data.mat.log import MatLog
from data.mcap.records import ByteArray
from data.names import shown
from data.parquet.log import ParquetLog
from data.signals import Signal, log_format
from data.tables.table import TIME_NAMES, Column, TableFile, Values, require_numbers
from data.units import Quantity


def read_parquet_log(door: Door, content: ByteArray) -> Logged:
    """The wanted columns of a Parquet file in SI; raises LogError."""
    return _read(door, content, ParquetLog)


def read_mat_log(door: Door, content: ByteArray) -> Logged:
    """The wanted arrays of a MATLAB file in SI; raises LogError."""
    return _read(door, content, MatLog)


def _read(door: Door, content: ByteArray, opened: Callable[[ByteArray], TableFile]) -> Logged:
    try:
        return _converted(door, opened(content))
    except LogError as error:
        text = str(error)
        raise LogError(text if text.startswith(door.log) else f"{door.log}: {text}") from error


def _converted(door: Door, table: TableFile) -> Logged:
    wanted = door.wanted()
    try:
        time, places = _places(door, table, wanted)
    except LogError as error:  # damage goes first: what is missing may be what is lost
        damage = table.read([]).integrity.require(door.log, salvage=door.salvage)
        raise LogError("; ".join((str(error), *(finding.text for finding in damage)))) from error
    for quantity, signal in {**wanted, "time": time}.items():
        column = table.columns[places[quantity]]
        require_numbers(column)
        require_unit(quantity, signal, column.unit, axis=door.axis)
    clocks = {} if door.signals.time is not None else _clocks(table, wanted)
    read = table.read(sorted({*places.values(), *clocks.values()}))
    findings = read.integrity.require(door.log, salvage=door.salvage)
    columns = {quantity: table.columns[place] for quantity, place in places.items()}
    values = {quantity: read.values[place] for quantity, place in places.items()}
    _require_alike(columns, values)
    _require_one_clock(table, clocks, read.values)
    clock = f"column {shown(columns['time'].name)!r}"
    stamps = door.convert("time", interval(time), _floats(columns["time"], values["time"], stamp=True))
    require_sane_clock(door, stamps)
    lead = unset_lead(stamps)
    return Logged(
        time=door.convert("time", interval(time), values["time"].since_first(lead)),
        signals={
            quantity: door.convert(quantity, signal, _floats(columns[quantity], values[quantity])[lead:])
            for quantity, signal in wanted.items()
        },
        clock=clock,
        metadata=table.metadata,
        findings=(*findings, *unset(door, lead, clock)),
        begun=began(float(stamps[lead]) if stamps.size > lead else 0.0, table.metadata),
    )


def _places(
    door: Door, table: TableFile, wanted: Mapping[Quantity, Signal]
) -> tuple[Signal, dict[Quantity, int]]:
    """The signal that is the time, and where each quantity stands among the file's columns."""
    places = {quantity: table.find(signal.source) for quantity, signal in wanted.items()}
    if door.signals.time is not None:
        return door.signals.time, places | {"time": table.find(door.signals.time.source)}
    place = table.plain_time(wanted["position"].source)
    if place is None:
        kind = log_format(door.path)
        raise LogError(
            f"[signals] names no time for {kind} logs, and no column is plainly the time "
            f'(one of {", ".join(TIME_NAMES)}); add time = {{ {kind} = "..." }}'
        )
    return plain_clock(place, table.columns[place].unit), places | {"time": place}


def _clocks(table: TableFile, wanted: Mapping[Quantity, Signal]) -> dict[Quantity, int]:
    """Where the time stands that is plainly each quantity's own."""
    found = {quantity: table.plain_time(signal.source) for quantity, signal in wanted.items()}
    return {quantity: place for quantity, place in found.items() if place is not None}


def _require_one_clock(
    table: TableFile, clocks: Mapping[Quantity, int], values: Mapping[int, Values]
) -> None:
    """Refuse a signal that was sampled at other times than the position."""
    own = clocks.get("position")
    for quantity, place in clocks.items():
        if own is None or place == own:
            continue
        if not np.array_equal(values[place].stored, values[own].stored, equal_nan=True):
            names = [shown(table.columns[k].name) for k in (place, own)]
            raise LogError(
                f"{quantity} stands beside a time of its own, {names[0]}, which differs from the position's, "
                f"{names[1]}: paired row by row, every torque would belong to another instant. Save them on "
                "one clock, or name the `time` in [signals] if that one is right for both"
            )


def _floats(column: Column, values: Values, *, stamp: bool = False) -> FloatArray:
    """A column as floats; as a `stamp` it may be rounded, its differences are not taken from it."""
    try:
        return (replace(values, stored=values.stored.astype("f8")) if stamp else values).floats()
    except LogError as error:
        raise LogError(f"column {shown(column.name)!r} {error}") from error


def _require_alike(columns: Mapping[Quantity, Column], values: Mapping[Quantity, Values]) -> None:
    """Refuse signals of different lengths: which of their values belong together is not known."""
    own = values["time"].stored.size
    for quantity, column in columns.items():
        if values[quantity].stored.size != own:
            raise LogError(
                f"{quantity} ({shown(column.name)}) has {values[quantity].stored.size} values, the time "
                f"({shown(columns['time'].name)}) {own}: which belong together is not known. Name the time "
                "that they were sampled with"
            )

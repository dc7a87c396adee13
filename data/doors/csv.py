"""The door for CSV logs."""

from __future__ import annotations

import numpy as np

from data.began import began, since_1970
from data.csv.clocks import clocks_of, on_clock, time_column
from data.csv.dialect import sniff
from data.csv.log import CsvTable, elapsed, find_column, read_csv, table_integrity
from data.doors.door import (
    Door,
    Logged,
    after_first,
    interval,
    plain_clock,
    require_sane_clock,
    require_unit,
    unset,
)
from data.elapsed import unset_lead
from data.findings import Finding, LogError, Severity
from data.mcap.records import ByteArray
from data.names import shown
from data.recording import Axis
from data.signals import Signal
from data.units import same_unit


def read_csv_log(door: Door, content: ByteArray) -> Logged:
    """The wanted columns of a CSV file in SI, on the clock of the position's column; raises LogError."""
    try:
        layout = sniff(content, door.signals.dialect)
        wanted = door.wanted()
        columns: dict[str, int] = {
            quantity: find_column(layout, signal.source) for quantity, signal in wanted.items()
        }
        asked = door.signals.time
        column = time_column(layout, asked.source if asked else None, columns["position"])
        time = asked or plain_clock(column, layout.units[column])
        clocks = clocks_of(layout, columns, column)
        for quantity, signal in wanted.items():
            require_unit(quantity, signal, layout.units[columns[quantity]], axis=door.axis)
        stamped = {column, *clocks.values()}
        table = read_csv(content, layout, {*columns.values(), *stamped}, clocks=stamped)
        for clock in sorted(stamped):
            _require_time_unit(time, clock, table, axis=door.axis)
        findings = table_integrity(table).require(door.log, salvage=door.salvage)
        one = float(door.convert("time", interval(time), np.ones(1))[0])
        read = on_clock(table, columns, clocks, seconds=one)
    except LogError as error:
        said = str(error)
        raise LogError(said if said.startswith(door.log) else f"{door.log}: {said}") from error
    name = f"column {shown(layout.headers[column] if layout.headers else str(column))!r}"
    stamps = door.convert("time", interval(time), table.values[column][read.places])
    require_sane_clock(door, stamps)
    lead = unset_lead(stamps)
    held = tuple(
        Finding("E-CLOCK", Severity.WARN, f"{quantity} {text}", door.log)
        for quantity, text in read.held.items()
    )
    begin = since_1970(float(stamps[lead]), time.unit) if stamps.size > lead else 0.0
    places = read.places[lead:]
    first = int(places[0]) if places.size else 0
    logged = Logged(
        time=door.convert("time", interval(time), elapsed(table, column, begin=first)[places - first]),
        signals={
            quantity: door.convert(quantity, signal, read.values[quantity][lead:])
            for quantity, signal in wanted.items()
        },
        clock=name,
        metadata=layout.metadata,
        findings=(*findings, *held, *unset(door, lead, name)),
        begun=began(begin, layout.metadata),
        breaks=tuple(k for k in np.searchsorted(places, table.rows.breaks).tolist() if 0 < k < places.size),
    )
    return after_first(logged) if held else logged


def _require_time_unit(time: Signal, column: int, table: CsvTable, *, axis: Axis) -> None:
    """Refuse a column of times in another unit; dates are seconds, whatever their form is called."""
    declared = table.layout.units[column]
    if column not in table.dated:
        require_unit("time", time, declared, axis=axis)
    elif time.scale is not None or not same_unit(time.unit or "s", "s"):
        raise LogError(
            f"column {column} holds dates or times of day, which are read as seconds; take the unit and the "
            "scale of the time out of [signals], and out of the column's header"
        )

"""The door for CSV logs."""

from __future__ import annotations

from data.began import began
from data.csv.description import TIME_NAMES
from data.csv.dialect import bare, sniff
from data.csv.log import elapsed, find_column, read_csv, table_integrity
from data.doors.door import Door, Logged, interval, require_unit, unset
from data.elapsed import unset_lead
from data.findings import LogError
from data.mcap.records import ByteArray
from data.names import shown
from data.signals import Signal


def read_csv_log(door: Door, content: ByteArray) -> Logged:
    """The wanted columns of a CSV file in SI; raises LogError."""
    raw = content.tobytes()
    try:
        layout = sniff(raw, door.signals.dialect)
        wanted = door.wanted()
        time = door.signals.time or _plain_time(layout.headers, layout.units)
        columns = {quantity: find_column(layout, signal.source) for quantity, signal in wanted.items()}
        columns["time"] = find_column(layout, time.source)
        for quantity, signal in {**wanted, "time": time}.items():
            require_unit(quantity, signal, layout.units[columns[quantity]], axis=door.axis)
        table = read_csv(raw, layout, columns.values())
    except LogError as error:
        text = str(error)
        raise LogError(text if text.startswith(door.log) else f"{door.log}: {text}") from error
    values = {quantity: table.values[column] for quantity, column in columns.items()}
    integrity = table_integrity(table, rows=values["time"].size)
    findings = integrity.require(door.log, salvage=door.salvage)
    name = layout.headers[columns["time"]] if layout.headers else str(columns["time"])
    clock = f"column {shown(name)!r}"
    stamps = door.convert("time", interval(time), values.pop("time"))
    lead = unset_lead(stamps)
    return Logged(
        time=door.convert("time", interval(time), elapsed(table, columns["time"], begin=lead)),
        signals={
            quantity: door.convert(quantity, wanted[quantity], values[quantity][lead:]) for quantity in wanted
        },
        clock=clock,
        metadata=layout.metadata,
        findings=(*findings, *unset(door, lead, clock)),
        begun=began(float(stamps[lead]) if stamps.size > lead else 0.0, layout.metadata),
    )


def _plain_time(headers: tuple[str, ...], units: tuple[str | None, ...]) -> Signal:
    """The column that is plainly the time, with the unit that its header declares."""
    for k, header in enumerate(headers):
        if bare(header).lower() in TIME_NAMES:
            return Signal(k, unit=units[k] if units[k] else None)
    raise LogError(
        "[signals] names no time for csv logs, and no column is plainly the time "
        f'(one of {", ".join(TIME_NAMES)}); add time = {{ csv = "..." }}'
    )

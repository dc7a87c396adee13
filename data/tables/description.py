"""What a file of typed columns holds, with no settings: columns, units, ranges, clock, integrity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from data.clocks import ClockReport, clock_report
from data.columns import value_range
from data.findings import LogError
from data.integrity import Integrity
from data.tables.table import Column, TableFile, Values
from data.units import known_unit


@dataclass(frozen=True)
class DescribedColumn:
    """One column."""

    number: int
    header: str
    unit: str | None
    low: float | None  # [as logged]; None: no number in it
    high: float | None  # [as logged]
    missing: int  # cells that are empty or not finite
    rows: int
    text: str | None = None  # why it is no column of numbers


@dataclass(frozen=True)
class TableDescription:
    """One file."""

    rows: int  # of the longest column
    columns: tuple[DescribedColumn, ...]
    clock: ClockReport | None
    clock_column: str | None
    metadata: Mapping[str, str]
    integrity: Integrity


def describe(table: TableFile) -> TableDescription:
    """Describe an opened file; what is lost of it is no error: see its `integrity`."""
    numeric = [k for k, column in enumerate(table.columns) if column.refused is None]
    read = table.read(numeric)
    columns = tuple(_column(k, column, read.values.get(k)) for k, column in enumerate(table.columns))
    clock, clock_column = _clock(table, read.values)
    return TableDescription(
        rows=max((values.stored.size for values in read.values.values()), default=0),
        columns=columns,
        clock=clock,
        clock_column=clock_column,
        metadata=table.metadata,
        integrity=read.integrity,
    )


def _column(k: int, column: Column, values: Values | None) -> DescribedColumn:
    if values is None:
        return DescribedColumn(k, column.name, column.unit, None, None, 0, column.rows, column.refused)
    try:
        found = values.floats()
    except LogError as error:
        return DescribedColumn(k, column.name, column.unit, None, None, 0, column.rows, str(error))
    return DescribedColumn(k, column.name, column.unit, *value_range(found), found.size)


def _clock(table: TableFile, values: Mapping[int, Values]) -> tuple[ClockReport | None, str | None]:
    """The column that is plainly the time of the first column that has one."""
    times = (table.plain_time(table.columns[k].name) for k in values)
    place = next((k for k in times if k is not None and k in values), None)
    if place is None:
        return None, None
    column, stored = table.columns[place], values[place]
    unit = known_unit(column.unit or "s")
    factor = unit.factor if unit and unit.kind == "time" else 1.0
    seconds = stored.since_first(0) * factor
    known = np.isfinite(seconds)
    first = float(stored.stored[known][0]) / stored.ticks * factor if known.any() else 0.0
    return clock_report(seconds[known], start=first), column.name

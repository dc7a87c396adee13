"""What a CSV file holds, with no settings: its dialect, columns, units, ranges and clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.clocks import ClockReport, clock_report
from data.csv.dialect import CsvLayout, bare, sniff
from data.csv.log import CsvTable, elapsed, read_csv, table_integrity
from data.findings import LogError
from data.integrity import Integrity, Loss
from data.units import known_unit

TIME_NAMES = ("t", "time", "__time", "timestamp")  # columns that are plainly the time


@dataclass(frozen=True)
class Column:
    """One column."""

    number: int
    header: str  # empty where there is none
    unit: str | None
    low: float | None  # [as logged]; None: no number in it
    high: float | None  # [as logged]
    missing: int  # cells that are empty or NaN
    text: str | None = None  # why it is no column of numbers


@dataclass(frozen=True)
class CsvDescription:
    """One file."""

    layout: CsvLayout
    rows: int
    columns: tuple[Column, ...]
    clock: ClockReport | None
    clock_column: str | None
    metadata: Mapping[str, str]
    integrity: Integrity


def describe(content: bytes) -> CsvDescription:
    """Describe a file's bytes.

    Raises
    ------
    LogError
        When it is no text, or holds no numbers. Rows that do not fit the others are a loss, not an error.
    """
    layout = sniff(content)
    tables, reasons = _tables(content, layout)
    values = {k: table.values[k] for k, table in tables.items()}
    rows = max((array.size for array in values.values()), default=0)
    columns = tuple(_column(k, layout, values.get(k), reasons.get(k)) for k in range(layout.columns))
    clock, clock_column = _clock(layout, tables)
    return CsvDescription(
        layout=layout,
        rows=rows,
        columns=columns,
        clock=clock,
        clock_column=clock_column,
        metadata=layout.metadata,
        integrity=_integrity(content, tables, reasons, rows=rows),
    )


def _integrity(
    content: bytes, tables: Mapping[int, CsvTable], reasons: Mapping[int, str], *, rows: int
) -> Integrity:
    """What is lost of the file; all of it when no column can be read."""
    for table in tables.values():
        return table_integrity(table, rows=rows)
    why = next(iter(reasons.values()), "no column of numbers")
    return Integrity("absent", losses=(Loss(0, len(content), why),), counted="rows")


def _tables(content: bytes, layout: CsvLayout) -> tuple[dict[int, CsvTable], dict[int, str]]:
    """The tables that hold the columns of numbers, and why the other columns are none."""
    everything = range(layout.columns)
    try:
        table = read_csv(content, layout, everything)
    except LogError:
        tables: dict[int, CsvTable] = {}
        reasons: dict[int, str] = {}
    else:
        return dict.fromkeys(everything, table), {}
    for k in everything:
        try:
            tables[k] = read_csv(content, layout, [k])
        except LogError as error:
            reasons[k] = str(error)
    return tables, reasons


def _column(k: int, layout: CsvLayout, values: NDArray[np.float64] | None, why: str | None) -> Column:
    header = layout.headers[k] if layout.headers else ""
    if values is None:
        return Column(k, header, layout.units[k], None, None, 0, why)
    finite = values[np.isfinite(values)]
    return Column(
        number=k,
        header=header,
        unit=layout.units[k],
        low=float(finite.min()) if finite.size else None,
        high=float(finite.max()) if finite.size else None,
        missing=int(values.size - finite.size),
    )


def _clock(layout: CsvLayout, tables: Mapping[int, CsvTable]) -> tuple[ClockReport | None, str | None]:
    for k, header in enumerate(layout.headers):
        if bare(header).lower() in TIME_NAMES and k in tables:
            unit = known_unit(layout.units[k] or "s")
            factor = unit.factor if unit and unit.kind == "time" else 1.0
            stamps = tables[k].values[k] * factor
            seconds = elapsed(tables[k], k) * factor
            known = np.isfinite(stamps)
            first = float(stamps[known][0]) if known.any() else 0.0
            return clock_report(seconds[known], start=first), header
    return None, None

"""What a CSV file holds, with no settings: its dialect, columns, units, ranges and clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.began import since_1970
from data.clocks import ClockReport, clock_report
from data.columns import value_range
from data.csv.clocks import time_columns
from data.csv.dialect import sniff
from data.csv.layout import CsvLayout
from data.csv.log import CsvTable, elapsed, read_csv, table_integrity
from data.csv.text import ByteArray
from data.integrity import Integrity, Loss
from data.units import known_unit

_NO_TIME = 1e100  # of any unit


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


def describe(content: bytes | ByteArray) -> CsvDescription:
    """Describe a file's bytes.

    Raises
    ------
    LogError
        When it is no text, or holds no numbers. Rows that do not fit the others are a loss, not an error.
    """
    layout = sniff(content)
    times = time_columns(layout)
    table = read_csv(content, layout, range(layout.columns), clocks=times, strict=False)
    columns = tuple(
        _column(k, table, table.values.get(k), table.reasons.get(k)) for k in range(layout.columns)
    )
    clock, clock_column = _clock(table, times)
    integrity = table_integrity(table)
    if not table.values:
        why = next(iter(table.reasons.values()), "no column of numbers")
        integrity = Integrity("absent", losses=(Loss(0, len(content), why),), counted="rows")
    return CsvDescription(
        layout=layout,
        rows=table.rows.kept,
        columns=columns,
        clock=clock,
        clock_column=clock_column,
        metadata=layout.metadata,
        integrity=integrity,
    )


def _column(k: int, table: CsvTable, values: NDArray[np.float64] | None, why: str | None) -> Column:
    header = table.layout.headers[k] if table.layout.headers else ""
    if values is None:
        return Column(k, header, table.layout.units[k], None, None, 0, why)
    return Column(k, header, _unit(table, k), *value_range(values))


def _unit(table: CsvTable, k: int) -> str | None:
    return "s" if k in table.dated else table.layout.units[k]


def _clock(table: CsvTable, times: Sequence[int]) -> tuple[ClockReport | None, str | None]:
    """The first column that is plainly the time, as a clock."""
    for k in times:
        if k not in table.values or not table.values[k].size:
            continue
        if not np.all(np.abs(table.values[k][np.isfinite(table.values[k])]) < _NO_TIME):
            continue
        unit = known_unit(_unit(table, k) or "s")
        factor = unit.factor if unit and unit.kind == "time" else 1.0
        stamps = table.values[k] * factor
        seconds = elapsed(table, k) * factor
        known = np.isfinite(stamps)
        first = since_1970(float(stamps[known][0]), _unit(table, k)) if known.any() else 0.0
        return clock_report(seconds[known], start=first), table.layout.headers[k]
    return None, None

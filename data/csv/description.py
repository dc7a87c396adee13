"""What a CSV file holds, with no settings: its dialect, columns, units, ranges and clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.clocks import ClockReport, clock_report
from data.csv.dialect import CsvLayout, bare, sniff
from data.csv.log import read_csv
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
    values, reasons, loss = _columns(content, layout)
    rows = max((array.size for array in values.values()), default=0)
    columns = tuple(_column(k, layout, values.get(k), reasons.get(k)) for k in range(layout.columns))
    clock, clock_column = _clock(layout, values)
    return CsvDescription(
        layout=layout,
        rows=rows,
        columns=columns,
        clock=clock,
        clock_column=clock_column,
        metadata=layout.metadata,
        integrity=Integrity("absent", losses=(loss,) if loss else (), messages=rows),
    )


def _columns(
    content: bytes, layout: CsvLayout
) -> tuple[dict[int, NDArray[np.float64]], dict[int, str], Loss | None]:
    """The columns of numbers, why the others are none, and what is lost."""
    everything = range(layout.columns)
    try:
        table = read_csv(content, layout, everything)
    except LogError as error:
        problem = str(error)
    else:
        return table.values, {}, table.loss
    values: dict[int, NDArray[np.float64]] = {}
    reasons: dict[int, str] = {}
    loss: Loss | None = None
    for k in everything:
        try:
            part = read_csv(content, layout, [k])
        except LogError as error:
            reasons[k] = str(error)
        else:
            values[k], loss = part.values[k], part.loss
    return values, reasons, loss if values else Loss(0, len(content), problem)


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


def _clock(
    layout: CsvLayout, values: Mapping[int, NDArray[np.float64]]
) -> tuple[ClockReport | None, str | None]:
    for k, header in enumerate(layout.headers):
        if bare(header).lower() in TIME_NAMES and k in values:
            unit = known_unit(layout.units[k] or "s")
            seconds = values[k] * (unit.factor if unit and unit.kind == "time" else 1.0)
            finite = seconds[np.isfinite(seconds)]
            first = float(finite[0]) if finite.size else 0.0
            return clock_report(finite - first, start=first), header
    return None, None

"""Which column is the clock of which: tables whose signals were sampled at times of their own.

Simulink and TwinCAT write a column of times and, to its right, the columns that it governs; then the next
column of times. A row then holds samples of different instants. Each signal is read with the times that
govern it; those of another clock than the position's are brought onto it as a topic of its own would be
(`data.alignment`). Columns of times that are shorter than the table end in empty cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.alignment import align
from data.columns import TIME_NAMES, bare, is_time
from data.csv.layout import CsvLayout
from data.csv.log import CsvTable, elapsed_together, find_column
from data.findings import LogError
from data.names import shown
from data.units import known_unit

FloatArray = NDArray[np.float64]
_PLAIN: Final = (*TIME_NAMES, "datetime", "x_value", "zeit")  # pandas', LabVIEW's, and in German


def time_columns(layout: CsvLayout) -> tuple[int, ...]:
    """The columns that are plainly the time: that before the first signals, and those that are called as it.

    Only tables whose columns have clocks of their own give several the same name. Of several times side by
    side, a date and the seconds since, the last counts.
    """
    plain = [k for k, header in enumerate(layout.headers) if is_time(header, _PLAIN) and _may_be(layout, k)]
    if not plain:
        return ()
    own = next(k for k in plain if k + 1 not in plain)
    name = bare(layout.headers[own]).lower()
    return tuple(k for k in plain if bare(layout.headers[k]).lower() == name)


def _may_be(layout: CsvLayout, column: int) -> bool:
    """Whether a column's unit lets it be a time."""
    unit = known_unit(layout.units[column] or "s")
    return unit is None or unit.kind == "time"


def governing(layout: CsvLayout, column: int) -> int | None:
    """The column of times that governs a column: the next to its left, or the first; None: there is none."""
    times = time_columns(layout)
    left = [k for k in times if k < column]
    return left[-1] if left else next(iter(times), None)


def time_column(layout: CsvLayout, source: str | int | None, position: int) -> int:
    """The column of the position's times: the one that the campaign names, or that governs the position.

    Raises
    ------
    LogError
        When there is none, or the named one governs other columns.
    """
    own = governing(layout, position)
    if source is None:
        if own is None:
            raise LogError(
                "[signals] names no time for csv logs, and no column is plainly the time "
                f'(one of {", ".join(_PLAIN)}); add time = {{ csv = "..." }}'
            )
        return own
    times = time_columns(layout)
    alike = [k for k in times if isinstance(source, str) and _is_called(layout.headers[k], source)]
    if len(alike) > 1 and own in alike:
        return own
    named = find_column(layout, source)
    if own is not None and named in times and named != own and _governs(layout, named):
        raise LogError(
            f"column {named} ({shown(layout.headers[named])!r}) is the time of the columns to its right, and "
            f"the position has its own in column {own}; give that as the time"
        )
    return named


def _is_called(header: str, source: str) -> bool:
    return source.strip() in {header.strip(), bare(header)}


def _governs(layout: CsvLayout, time: int) -> bool:
    """Whether a column of times has columns of its own."""
    times = time_columns(layout)
    return any(k not in times and governing(layout, k) == time for k in range(layout.columns))


def clocks_of(layout: CsvLayout, columns: Mapping[str, int], time: int) -> dict[str, int]:
    """The column of times of each signal, by its name; the position's is `time`."""
    own = governing(layout, columns["position"])
    found = {name: governing(layout, column) for name, column in columns.items()}
    return {name: time if clock in {own, None} else int(clock or 0) for name, clock in found.items()}


@dataclass(frozen=True)
class OnClock:
    """A table's signals at the position's times; arrays (n,)."""

    places: NDArray[np.intp]  # rows of the table that hold a position
    values: dict[str, FloatArray]  # as logged
    held: dict[str, str]  # by name: what is said of a signal that stood in for newer values


def on_clock(
    table: CsvTable, columns: Mapping[str, int], clocks: Mapping[str, int], *, seconds: float
) -> OnClock:
    """Signals by name at the position's times; one unit of the times is `seconds` [s].

    Raises
    ------
    LogError
        When a column of times has holes.
    """
    time = clocks["position"]
    logged = {name: table.values[k] for name, k in columns.items()}
    if set(clocks.values()) == {time}:
        if any(_is_sparse(values) for values in logged.values()):
            return _together(table, logged, time, seconds=seconds)
        return OnClock(np.arange(table.rows.kept), logged, {})
    order = list(dict.fromkeys((time, *clocks.values())))
    stamps = dict(zip(order, elapsed_together(table, order), strict=True))
    sizes = {clock: _size(table, clock) for clock in order}
    ticks = {k: np.rint(stamps[k][: sizes[k]] * seconds * 1e9).astype(np.int64) for k in order}
    values: dict[str, FloatArray] = {}
    held: dict[str, str] = {}
    for name, column in columns.items():
        clock = clocks[name]
        own = table.values[column][: sizes[clock]]
        if clock == time:
            values[name] = own
            continue
        values[name], said = _aligned(ticks[time], ticks[clock], own)
        if said:
            held[name] = (
                f"stands on the clock of column {clock} and was brought onto the position's, column {time}: "
                f"{said}"
            )
    return OnClock(np.arange(sizes[time]), values, held)


def _is_sparse(values: FloatArray) -> bool:
    """Whether a signal stands in few of the rows (n,), every other one or fewer: at instants of its own."""
    known = np.flatnonzero(np.isfinite(values))
    return known.size > 2 and float(np.median(np.diff(known))) >= 2.0


def _together(table: CsvTable, logged: Mapping[str, FloatArray], time: int, *, seconds: float) -> OnClock:
    """Signals of one clock that were sampled at different instants, at those of the position.

    PlotJuggler writes a row for every instant of any topic, with empty cells for the others.
    """
    ticks = np.rint(elapsed_together(table, [time])[0] * seconds * 1e9)
    timed = np.isfinite(ticks)
    places = np.flatnonzero(np.isfinite(logged["position"]) & timed)
    mine = ticks[places].astype(np.int64)
    values: dict[str, FloatArray] = {}
    held: dict[str, str] = {}
    for name, own in logged.items():
        known = np.isfinite(own) & timed
        values[name], said = _aligned(mine, ticks[known].astype(np.int64), own[known])
        if said:
            held[name] = f"stands in other rows than the position and was brought onto its instants: {said}"
    return OnClock(places, values, held)


def _aligned(wanted: NDArray[np.int64], own: NDArray[np.int64], logged: FloatArray) -> tuple[FloatArray, str]:
    """A signal at other instants [ns], and what is to be said of it; empty where nothing is."""
    aligned = align(wanted, own, logged)
    if aligned.together:
        return aligned.values, ""
    period = float(np.median(np.diff(wanted))) * 1e-9 if wanted.size > 1 else 0.0
    samples = f", {aligned.longest_hold / period:.3g} position samples" if period > 0.0 else ""
    return aligned.values, f"its last value was held for up to {aligned.longest_hold:.4g} s{samples}"


def _size(table: CsvTable, clock: int) -> int:
    """How many times a column holds before its empty end."""
    known = np.isfinite(table.values[clock])
    size = int(np.flatnonzero(known)[-1]) + 1 if known.any() else 0
    if not known[:size].all():
        row = int(np.flatnonzero(~known)[0])
        raise LogError(
            f"column {clock}, a clock, has no time in row {row + 1} of the numbers: the instant of the "
            "samples beside it is not known. Cut the row out, or exclude the log"
        )
    return size

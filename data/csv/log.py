"""A rig log as CSV: comment lines with metadata, one header, numbers; read in any dialect, written in one.

    # simulated: true
    t,q_deg,i
    0.0,12.5,0.31

Written with the shortest decimals that read back as the same number, bit for bit.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from numpy.typing import NDArray

from data.columns import called, require_one_length
from data.csv.cells import NO_NUMBER, NotNumbersError, numbers
from data.csv.dates import TimeCells, no_number
from data.csv.layout import CsvLayout
from data.csv.rows import Block, Rows, Tally, whole_rows
from data.csv.text import ByteArray, open_text
from data.elapsed import FINE, since_first_written
from data.files import write_atomically
from data.findings import LogError
from data.integrity import Integrity
from data.names import nearest, shown

FloatArray = NDArray[np.float64]


def write_csv(
    path: Path, *, columns: Mapping[str, FloatArray], metadata: Mapping[str, str] | None = None
) -> None:
    """Write one run, whole or not at all.

    Parameters
    ----------
    path
        The file; folders on the way are made.
    columns
        Arrays (n,) by header, in order. A unit may stand in the header: `q [deg]`.
    metadata
        Text by key, as lines `# KEY: value` before the header.

    Raises
    ------
    LogError
        When the arrays differ in length, or a header or metadata text holds a control character.
    """
    require_one_length(path, columns)
    for text in (*columns, *(metadata or {}).keys(), *(metadata or {}).values()):
        if not text.isprintable():
            raise LogError(f"{path.name}: {text!r} holds a control character and cannot stand in a CSV log")
    out = io.StringIO()
    out.writelines(f"# {key}: {value}\n" for key, value in (metadata or {}).items())
    table = csv.writer(out, lineterminator="\n")
    table.writerow(columns)
    table.writerows(zip(*(array.tolist() for array in columns.values()), strict=True))
    write_atomically(path, out.getvalue())


@dataclass(frozen=True)
class CsvTable:
    """The columns of one file that were asked for."""

    layout: CsvLayout
    values: dict[int, FloatArray]  # by column number; (n,) each
    rows: Rows  # what was kept of the file, and what was taken out
    written: dict[int, pa.ChunkedArray]  # cells (n,) as text, of the columns whose text was asked for
    reasons: dict[int, str]  # by column number: why it is no column of numbers
    dated: frozenset[int] = frozenset()  # columns of dates or times of day, which were made seconds


def read_csv(
    content: bytes | ByteArray,
    layout: CsvLayout,
    wanted: Iterable[int],
    *,
    clocks: Iterable[int] = (),
    strict: bool = True,
) -> CsvTable:
    """Read columns, by number from 0, in one pass. Damaged rows are no error here: see `CsvTable.rows`.

    Parameters
    ----------
    content, layout
        The file, and how it is written.
    wanted
        Columns of numbers.
    clocks
        Of them those whose cells are also kept as they are written, for `elapsed`.
    strict
        Whether a wanted column with a cell that is no number is an error; else it goes to `reasons`.

    Raises
    ------
    LogError
        When the file is no table, or a wanted cell is no number.
    """
    columns, stamps = sorted(set(wanted)), frozenset(clocks)
    parts: dict[int, list[FloatArray]] = {k: [] for k in columns}
    texts: dict[int, list[pa.Array]] = {k: [] for k in columns if k in stamps}
    reasons: dict[int, str] = {}
    dates = {k: TimeCells(layout.decimal) for k in columns if k in stamps}
    found = Tally()
    for block in whole_rows(open_text(content, layout.encoding), layout, found):
        if not block.rows:
            continue
        for k, found_cells in _columns(block, layout, list(parts)).items():
            try:
                cells = dates[k].read(found_cells) if k in texts else found_cells
                parts[k].append(numbers(cells, layout.decimal))
            except NotNumbersError as error:
                reasons[k] = _no_number(layout, k, found.kept - block.rows + error.row, error)
                if strict:
                    raise LogError(reasons[k]) from error
                del parts[k]
                texts.pop(k, None)
            else:
                if k in texts:
                    texts[k].append(cells)
    return CsvTable(
        layout=layout,
        values={k: np.concatenate(pieces) if pieces else np.zeros(0) for k, pieces in parts.items()},
        rows=found.rows,
        written={k: pa.chunked_array(pieces, pa.string()) for k, pieces in texts.items()},
        reasons=reasons,
        dated=frozenset(k for k, own in dates.items() if own.dated and k in parts),
    )


def _columns(block: Block, layout: CsvLayout, columns: Sequence[int]) -> dict[int, pa.Array]:
    """Cells (n,) of columns of a block, as text."""
    if not columns:
        return {}
    if block.cells is not None:
        return {k: pa.array([row[k] for row in block.cells], pa.string()) for k in columns}
    names = {k: str(k) for k in columns}
    try:
        table = arrow_csv.read_csv(
            pa.BufferReader(block.text),
            read_options=arrow_csv.ReadOptions(
                column_names=[str(k) for k in range(layout.columns)],
                use_threads=False,
                block_size=len(block.text) + 1,
            ),
            parse_options=arrow_csv.ParseOptions(
                delimiter=" " if layout.delimiter == "whitespace" else layout.delimiter,
                quote_char=block.quote or False,
            ),
            convert_options=arrow_csv.ConvertOptions(
                include_columns=list(names.values()),
                column_types=dict.fromkeys(names.values(), pa.string()),
                strings_can_be_null=False,
                check_utf8=False,
            ),
        )
    except pa.ArrowInvalid as error:
        raise LogError(f"a row does not have {layout.columns} cells ({shown(str(error))})") from error
    if table.num_rows != block.rows:
        raise LogError(
            f"{block.rows} rows were counted and {table.num_rows} read: the file cannot be trusted"
        )
    return {k: table[name].combine_chunks() for k, name in names.items()}


def _no_number(layout: CsvLayout, column: int, row: int, error: NotNumbersError) -> str:
    name = layout.headers[column] if layout.headers else str(column)
    cell = shown(error.cell, 40)
    why = no_number(error.cell) if error.why == NO_NUMBER else error.why
    return f"column {shown(name)!r} holds {cell!r} in row {row + 1} of the numbers: {why}"


def table_integrity(table: CsvTable) -> Integrity:
    """What can be said of a table; none proves its content."""
    found = table.rows
    return Integrity("absent", losses=found.losses, messages=found.kept, notes=found.notes, counted="rows")


def elapsed(table: CsvTable, column: int, *, begin: int = 0) -> FloatArray:
    """A column (n,) [as logged] from row `begin` on, minus its first number there, exact to the text.

    A stamp since 1970 as a float is good to 0.2 us at best. Where that is too coarse for the steps between
    rows, the difference is taken between the numbers as they are written.
    """
    return elapsed_together(table, (column,), begin=begin)[0]


def elapsed_together(table: CsvTable, columns: Sequence[int], *, begin: int = 0) -> list[FloatArray]:
    """Columns (n,) [as logged] from row `begin` on, minus the first's first number, exact to the text."""
    values = [table.values[column][begin:] for column in columns]
    if not any(np.isfinite(array).any() for array in values):
        return values
    if all(_fine(array) for array in values):
        first = next(float(array[np.isfinite(array)][0]) for array in values if np.isfinite(array).any())
        with np.errstate(over="ignore"):
            return [array - first for array in values]
    cells = [cell for column in columns for cell in table.written[column][begin:].to_pylist()]
    since = since_first_written(cells, table.layout.decimal)
    return np.split(since, len(columns))


def _fine(values: FloatArray) -> bool:
    """Whether numbers as floats are exact to a small part of the steps between them."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return True
    with np.errstate(over="ignore"):
        step = float(np.median(np.abs(np.diff(finite)))) if finite.size > 1 else 0.0
        return bool(np.spacing(np.abs(finite).max()) <= FINE * step)


def find_column(layout: CsvLayout, source: str | int) -> int:
    """A column by its exact header, its header without the unit, or its number from 0.

    Raises
    ------
    LogError
        When there is no such column, or two of that name.
    """
    if isinstance(source, str):
        names = [header.strip() for header in layout.headers]
        matching = called(names, source)
        if len(matching) > 1:
            raise LogError(
                f"{len(matching)} columns are called {shown(source)!r} (numbers {matching}); "
                "address one by its number, or rename them"
            )
        if matching:
            return matching[0]
        if not source.strip().isdecimal():
            has = (
                nearest(source, names)
                if names
                else f"no header, so columns go by number, 0 to {layout.columns - 1}"
            )
            raise LogError(f"no column {shown(source)!r}; the log has {has}")
    number = int(source)
    if not 0 <= number < layout.columns:
        raise LogError(f"no column number {number}; the log has {layout.columns}, counted from 0")
    return number

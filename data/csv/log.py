"""A rig log as CSV: comment lines with metadata, one header, numbers; read in any dialect, written in one.

    # simulated: true
    t,q_deg,i
    0.0,12.5,0.31

Written with the shortest decimals that read back as the same number, bit for bit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from data.csv.dialect import CsvLayout, bare
from data.csv.rows import Rows, whole_rows
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
    lengths = {header: array.shape for header, array in columns.items()}
    if len(set(lengths.values())) > 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise LogError(f"{path.name}: the columns to write differ in shape: {lengths}")
    for text in (*columns, *(metadata or {}).keys(), *(metadata or {}).values()):
        if not text.isprintable():
            raise LogError(f"{path.name}: {text!r} holds a control character and cannot stand in a CSV log")
    head = "".join(f"# {key}: {value}\n" for key, value in (metadata or {}).items())
    table = pd.DataFrame(dict(columns)).to_csv(index=False, lineterminator="\n")
    write_atomically(path, head + table)


# From pandas 3.1 on the default float parser is exact and the option is gone.
_EXACT: Final[dict[str, str]] = (
    {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) >= (3, 1)
    else {"float_precision": "round_trip"}
)


@dataclass(frozen=True)
class CsvTable:
    """The columns of one file that were asked for."""

    layout: CsvLayout
    values: dict[int, FloatArray]  # by column number; (n,) each
    rows: Rows  # that they were read from, and what was taken out


def read_csv(content: bytes, layout: CsvLayout, wanted: Collection[int]) -> CsvTable:
    """Read columns, by number from 0. Damaged rows are no error here: see `CsvTable.rows`.

    Raises
    ------
    LogError
        When the file is no table, or a wanted cell is no number.
    """
    rows = whole_rows(content, layout)
    columns = sorted(set(wanted))
    options = _options(rows, layout, columns)
    try:
        table = pd.read_csv(BytesIO(rows.text), dtype=np.float64, **options)
    except pd.errors.ParserError as error:
        raise LogError(f"a row does not have {layout.columns} cells ({shown(str(error).strip())})") from error
    except (ValueError, OverflowError) as error:
        raise LogError(_not_a_number(rows.text, layout, columns, options) or shown(str(error))) from error
    return CsvTable(
        layout=layout,
        values={k: np.ascontiguousarray(table[k].to_numpy(np.float64)) for k in columns},
        rows=rows,
    )


def table_integrity(table: CsvTable, *, rows: int) -> Integrity:
    """What can be said of a table of so many rows; no table proves its content."""
    found = table.rows
    return Integrity("absent", losses=found.losses, messages=rows, notes=found.notes, counted="rows")


def elapsed(table: CsvTable, column: int, *, begin: int = 0) -> FloatArray:
    """A column (n,) [as logged] from row `begin` on, minus its first number there, exact to the text.

    A stamp since 1970 as a float is good to 0.2 us at best. Where that is too coarse for the steps between
    rows, the difference is taken between the numbers as they are written.
    """
    values: FloatArray = table.values[column][begin:]
    finite = values[np.isfinite(values)]
    if not finite.size:
        return values
    step = float(np.median(np.abs(np.diff(finite)))) if finite.size > 1 else 0.0
    if np.spacing(np.abs(finite).max()) <= FINE * step:
        fine: FloatArray = values - finite[0]
        return fine
    options = _options(table.rows, table.layout, [column])
    text = BytesIO(table.rows.text)
    cells = pd.read_csv(text, dtype=str, keep_default_na=False, **options)[column]
    return since_first_written(cells.tolist()[begin:], table.layout.decimal)


def _options(rows: Rows, layout: CsvLayout, columns: list[int]) -> dict[str, Any]:
    """How pandas is to read some columns of the rows."""
    return {
        "sep": r"\s+" if layout.delimiter == "whitespace" else layout.delimiter,
        "decimal": layout.decimal,
        "encoding": rows.encoding,
        "comment": layout.comment,
        "header": None,
        "names": list(range(layout.columns)),
        "index_col": False,
        "usecols": columns,
        "skiprows": layout.first_row,
        "skipinitialspace": True,
        "engine": "c",
        **_EXACT,
    }


def find_column(layout: CsvLayout, source: str | int) -> int:
    """A column by its exact header, its header without the unit, or its number from 0.

    Raises
    ------
    LogError
        When there is no such column, or two of that name.
    """
    if isinstance(source, str):
        names = [header.strip() for header in layout.headers]
        exact = [k for k, name in enumerate(names) if name == source.strip()]
        matching = exact or [k for k, name in enumerate(names) if bare(name) == source.strip()]
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


def _not_a_number(text: bytes, layout: CsvLayout, columns: list[int], options: dict[str, Any]) -> str:
    """Where the first wanted cell stands that is no number; empty when all are."""
    cells = pd.read_csv(BytesIO(text), dtype=str, keep_default_na=False, **options)
    for k in columns:
        column = cells[k].str.strip().str.replace(layout.decimal, ".")
        bad = pd.to_numeric(
            column.where(column != "", "nan"), errors="coerce"
        ).isna() & ~column.str.lower().isin(["", "nan", "+nan", "-nan", "na", "n/a", "null", "none"])
        if bad.any():
            row = int(np.argmax(bad.to_numpy()))
            name = layout.headers[k] if layout.headers else str(k)
            cell = shown(str(cells[k].iloc[row]), 40)
            return f"column {shown(name)!r} holds {cell!r} in row {row + 1} of the numbers: no number"
    return ""

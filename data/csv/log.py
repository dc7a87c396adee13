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

from data.csv.dialect import CsvLayout, bare, split
from data.files import write_atomically
from data.findings import LogError
from data.integrity import Loss
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
    loss: Loss | None  # a last line that was cut off


def read_csv(content: bytes, layout: CsvLayout, wanted: Collection[int]) -> CsvTable:
    """Read columns, by number from 0.

    Raises
    ------
    LogError
        When a row has too many cells, or a wanted cell is no number.
    """
    text, loss = _without_cut_line(content, layout)
    _require_even(text, layout)
    columns = sorted(set(wanted))
    options: dict[str, Any] = {
        "sep": r"\s+" if layout.delimiter == "whitespace" else layout.delimiter,
        "decimal": layout.decimal,
        "encoding": layout.encoding,
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
    try:
        table = pd.read_csv(BytesIO(text), dtype=np.float64, **options)
    except pd.errors.ParserError as error:
        raise LogError(f"a row does not have {layout.columns} cells ({shown(str(error).strip())})") from error
    except (ValueError, OverflowError) as error:
        raise LogError(_not_a_number(text, layout, columns, options) or shown(str(error))) from error
    return CsvTable(
        layout=layout,
        values={k: np.ascontiguousarray(table[k].to_numpy(np.float64)) for k in columns},
        loss=loss,
    )


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


def _without_cut_line(content: bytes, layout: CsvLayout) -> tuple[bytes, Loss | None]:
    """The file without a last line that stops short of its cells, as a rig that lost power leaves it."""
    if layout.encoding.startswith("utf-16") or content.endswith((b"\n", b"\r")):
        return content, None
    begin = max(content.rfind(b"\n"), content.rfind(b"\r")) + 1
    last = content[begin:].decode(layout.encoding, errors="replace")
    if not last.strip() or len(split(last, layout.delimiter)) >= layout.columns:
        return content, None
    return content[:begin], Loss(begin, len(content), "the last line is cut off")


def _require_even(text: bytes, layout: CsvLayout) -> None:
    """Refuse rows with too few or too many cells: a lost cell would shift every number behind it."""
    if layout.delimiter == "whitespace":
        return
    sign = layout.delimiter.encode(layout.encoding.replace("utf-16", "utf-16-le").replace("-le-le", "-le"))
    body = text.split(b"\n", layout.first_row)[-1] if layout.first_row else text
    rows = body.count(b"\n") + (not body.endswith(b"\n") and bool(body))
    if body.count(sign) == rows * (layout.columns - 1):
        return
    for number, line in enumerate(text.decode(layout.encoding, errors="replace").splitlines()):
        if number < layout.first_row or not line.strip() or line.lstrip().startswith(layout.comment or "\0"):
            continue
        cells = len(split(line, layout.delimiter))
        if cells != layout.columns:
            raise LogError(
                f"line {number + 1} has {cells} cells, the others {layout.columns}; a lost cell would shift "
                "the numbers behind it into other columns. Mend or delete the line"
            )


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

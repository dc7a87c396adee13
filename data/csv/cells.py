"""Cells of a row, and the numbers that they are.

A cell is a number in the file's decimal sign, a word for a number that is missing, or text. Nothing else
passes for a number: no `True`, no thousands separator, no hexadecimal, no date (see `dates`). A number beyond
the largest double is refused too, or it would be read as infinite.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from data.findings import LogError

FloatArray = NDArray[np.float64]
Decimal = Literal[".", ","]
NO_NUMBER: Final = "no number"
BLANKS: Final = " \t\x0b\x0c"
_NUMBER: Final = {
    ".": r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity|1\.#inf0*)",
    ",": r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity|1[.,]#inf0*)",
}
_IS_NUMBER: Final = {sign: re.compile(rule, re.ASCII) for sign, rule in _NUMBER.items()}
_IS_MISSING: Final = re.compile(
    r"(|[+-]?nan|#?na|#?n/a|<na>|#n/a n/a|null|none|[+-]?1[.,]#(ind|s?q?nan)0*)", re.IGNORECASE
)
_THOUSANDS: Final = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)


class NotNumbersError(Exception):
    """A column holds a cell that is no number: which row, and the cell."""

    def __init__(self, row: int, cell: str, why: str = NO_NUMBER) -> None:
        super().__init__(row, cell, why)
        self.row = row
        self.cell = cell
        self.why = why


def split(line: str, delimiter: str, quote: str = '"') -> list[str]:
    """The cells of a row, quotes and outer blanks removed.

    Raises
    ------
    LogError
        When a quoted cell is longer than any.
    """
    if quote and quote in line:
        if delimiter == "whitespace":
            line, delimiter = re.sub(r"[ \t\x0b\x0c]+", " ", line).strip(), " "
        try:
            rows = list(csv.reader([line], delimiter=delimiter, quotechar=quote, skipinitialspace=True))
        except csv.Error as error:
            raise LogError(f"a row with a quotation mark cannot be taken apart ({error})") from error
        return [cell.strip() for cell in rows[0]] if rows else []
    if delimiter == "whitespace":
        return [cell for cell in re.split(r"[ \t\x0b\x0c]+", line) if cell]
    return [cell.strip() for cell in line.split(delimiter)] if line else []


def is_number(cell: str, decimal: Decimal) -> bool:
    """Whether a cell is a number."""
    return _IS_NUMBER[decimal].fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    return _IS_MISSING.fullmatch(cell) is not None


def numeric_share(row: Sequence[str], decimal: Decimal) -> float:
    """The share of a row's filled cells that are numbers; 0 for a row without any."""
    filled = [cell for cell in row if cell]
    if not filled:
        return 0.0
    return sum(is_number(cell, decimal) for cell in filled) / len(filled)


def numbers(cells: pa.Array, decimal: Decimal) -> FloatArray:
    """Cells (n,) as numbers (n,), bit for bit what they say; NaN where one is missing.

    Raises
    ------
    NotNumbersError
        When one is neither.
    """
    plain = cells
    if decimal == ",":
        plain = None if _any(cells, ".") else pc.replace_substring(cells, ",", ".")
    if plain is not None:
        try:
            values: FloatArray = pc.cast(plain, pa.float64()).to_numpy(zero_copy_only=False)
        except pa.ArrowInvalid:
            pass
        else:
            _require_no_thousands(cells, decimal)
            return _finite_as_written(cells, values)
    return _one_by_one(cells, decimal)


def _require_no_thousands(cells: pa.Array, decimal: Decimal) -> None:
    """Refuse cells (n,) of which those with a decimal sign are whole thousands: `998`, `999`, `1,000`.

    A sign that parts thousands divides them by a thousand; three places behind it in all cells that have one,
    and none in any below a thousand, is no way to write decimals.
    """
    signed = pc.match_substring(cells, decimal)
    with_sign = int(pc.sum(signed).as_py() or 0)
    if not 0 < with_sign < len(cells):
        return
    first = pc.index(signed, True).as_py()
    if not _THOUSANDS.fullmatch(str(cells[first].as_py())):
        return
    thousands = pc.match_substring_regex(cells, f"^{_THOUSANDS.pattern}$")
    whole = pc.match_substring_regex(cells, r"^[+-]?\d{1,3}$")
    if int(pc.sum(thousands).as_py()) == with_sign and pc.all(pc.or_(thousands, whole)).as_py():
        raise NotNumbersError(
            first,
            str(cells[first].as_py()),
            f"its sign {decimal!r} may part thousands: all cells with it have three digits behind it, and "
            "others stand without. Write the numbers without such signs",
        )


def _any(cells: pa.Array, part: str) -> bool:
    return bool(pc.any(pc.match_substring(cells, part)).as_py())


def _one_by_one(cells: pa.Array, decimal: Decimal) -> FloatArray:
    """The same where some have blanks around them, or are missing; a different path to the same numbers."""
    trimmed = pc.utf8_trim_whitespace(cells)
    numeric = pc.match_substring_regex(trimmed, f"^(?:{_NUMBER[decimal]})$")
    others = pc.unique(pc.filter(trimmed, pc.invert(numeric)))
    for cell in others.to_pylist():
        if not is_missing(cell):
            row = pc.index(trimmed, cell).as_py()
            raise NotNumbersError(row, cell)
    plain = pc.replace_substring(trimmed, ",", ".") if decimal == "," else trimmed
    plain = pc.replace_substring_regex(plain, r"(?i)1\.#inf0*", "inf")
    plain = pc.if_else(numeric, plain, pa.scalar("nan"))
    values: FloatArray = pc.cast(plain, pa.float64()).to_numpy(zero_copy_only=False)
    return _finite_as_written(trimmed, values)


def _finite_as_written(cells: pa.Array, values: FloatArray) -> FloatArray:
    """The values, unless one became infinite that is not written so."""
    for row in np.flatnonzero(np.isinf(values)).tolist():
        cell = str(cells[row].as_py()).strip()
        if "inf" not in cell.lower():
            raise NotNumbersError(row, cell, "a number beyond the largest that can be held")
    return values

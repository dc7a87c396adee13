"""Dates and times of day in a column of times: rewritten as seconds, digit for digit.

`2024-05-01 12:00:00.001` becomes `1714564800.001000000`, seconds since 1970 in UTC (an offset that stands
behind it is taken off; where none does, the clock on the wall is taken for UTC, which no difference of times
sees); `12:00:00.001` becomes seconds since midnight. What is read from there on is a column of numbers.

A date whose day and month could be taken for each other, 5/1/2024, is no date here.
"""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc

from data.csv.cells import NO_NUMBER, Decimal, NotNumbersError, is_missing

_DAY: Final = r"(\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?\.\d\d?\.\d{4})"
_TIME: Final = r"\d\d?:\d\d(:\d\d([.,]\d{1,9})?)?"
_ZONE: Final = r" ?(Z|[+-]\d\d(:?\d\d)?)"
_DATE: Final = rf"^({_DAY}([T ]{_TIME}({_ZONE})?)?|{_TIME})$"
_IS_DATE: Final = re.compile(_DATE, re.ASCII)
_UNCLEAR: Final = re.compile(r"^\d\d?[-/]\d\d?[-/]\d{2,4}\b", re.ASCII)
_DIGITS: Final = 19  # of nanoseconds since 1970, until 2286
_WHOLE: Final = _DIGITS - 9
_REWRITTEN: Final = (  # in order; \1 is what stands in the first brackets
    (",", "."),
    (r"^(\d+)\.(\d+)\.(\d{4})", r"\3-\2-\1"),
    (r"^(\d{4})[/.](\d+)[/.](\d+)", r"\1-\2-\3"),
    (r"^(\d{4})-(\d)-", r"\1-0\2-"),
    (r"^(\d{4}-\d\d)-(\d)([T ]|$)", r"\1-0\2\3"),
    (r"^(\d+:)", r"1970-01-01T\1"),
    (r"([T ])(\d):", r"\10\2:"),
    (r" (Z|[+-]\d\d[:\d]*)$", r"\1"),
)


def is_date(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    return _IS_DATE.match(cell.strip()) is not None


def no_number(cell: str) -> str:
    """Why a cell is no number."""
    if is_date(cell):
        return (
            "a date or a time of day, as only times may be; if the column is the clock, name it as the time"
        )
    if _UNCLEAR.match(cell.strip()):
        return "a date whose day and month may be taken for each other; write it as 2024-05-31"
    return NO_NUMBER


def are_dates(cells: pa.Array) -> bool:
    """Whether the first cell (n,) that says anything is one."""
    filled = (str(cell.as_py()) for cell in cells)
    return is_date(next((cell for cell in filled if not is_missing(cell.strip())), ""))


def seconds_written(cells: pa.Array, decimal: Decimal) -> pa.Array:
    """Dates or times of day (n,) as seconds (n,), as text; what is missing stays as it is.

    Raises
    ------
    NotNumbersError
        When a cell is neither, or there is no such day.
    """
    trimmed = pc.utf8_trim_whitespace(cells)
    dated = pc.match_substring_regex(trimmed, _DATE)
    for cell in pc.unique(pc.filter(trimmed, pc.invert(dated))).to_pylist():
        if not is_missing(cell):
            raise NotNumbersError(pc.index(trimmed, cell).as_py(), cell, "no date, as the others are")
    text = _as_iso(pc.if_else(dated, trimmed, None))
    ticks = _ticks(text)
    if ticks is None:
        row = next(k for k in range(len(text)) if _ticks(text.take([0, k])) is None)
        raise NotNumbersError(row, str(trimmed[row].as_py()), "no such date, or not as the others")
    early = pc.index(pc.less(ticks, 0), True).as_py()
    if early >= 0:
        raise NotNumbersError(early, str(trimmed[early].as_py()), "a date before 1970")
    digits = pc.utf8_lpad(pc.cast(ticks, pa.string()), _DIGITS, "0")
    whole, part = (pc.utf8_slice_codeunits(digits, *ends) for ends in ((0, _WHOLE), (_WHOLE, _DIGITS)))
    return pc.if_else(dated, pc.binary_join_element_wise(whole, part, decimal), trimmed)


def _as_iso(cells: pa.Array) -> pa.Array:
    """In the one order and with the signs of ISO 8601."""
    for found, instead in _REWRITTEN:
        cells = pc.replace_substring_regex(cells, found, instead)
    return cells


def _ticks(cells: pa.Array) -> pa.Array | None:
    """Nanoseconds since 1970 (n,); None where one is none, or some have a zone and others have not."""
    for zone in (None, "UTC"):
        with suppress(pa.ArrowInvalid):
            return pc.cast(pc.cast(cells, pa.timestamp("ns", zone)), pa.int64())
    return None

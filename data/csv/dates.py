"""Dates and times of day in a column of times: rewritten as seconds, digit for digit.

`2024-05-01 12:00:00.001` becomes `1714564800.001000000`, seconds since 1970 in UTC (an offset that stands
behind it is taken off; where none does, the clock on the wall is taken for UTC, which no difference of times
sees); `12:00:00.001` becomes seconds since the first midnight, and `0 days 00:00:01.5` seconds. What is read
from there on is a column of numbers.

A date whose day and month could be taken for each other, 5/1/2024, is no date here, nor is a time of day
without seconds, which could be minutes and seconds.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from data.csv.cells import NO_NUMBER, Decimal, NotNumbersError, is_missing

Kind = Literal["date", "zoned", "day", "span", "number"]
_DAY: Final = r"(?:\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?\.\d\d?\.\d{4}|\d\d?-[A-Z][a-z]{2}-\d{4})"
_SECONDS: Final = r"\d\d?:\d\d:\d\d(?:[.,]\d{1,9})?"
_TIME: Final = rf"(?:{_SECONDS}|\d\d?:\d\d)"
_ZONE: Final = r" ?(?:Z|UTC|[+-]\d\d(?::?\d\d)?)"
_FORMS: Final[dict[Kind, str]] = {
    "date": rf"^{_DAY}(?:[T ]{_TIME})?$",
    "zoned": rf"^{_DAY}[T ]{_TIME}{_ZONE}$",
    "day": rf"^{_SECONDS}$",
    "span": rf"^\d{{1,5}} days {_SECONDS}$",
}
_FORM: Final = {kind: re.compile(form, re.ASCII) for kind, form in _FORMS.items()}
_UNCLEAR: Final = re.compile(r"^\d\d?[-/]\d\d?[-/]\d{2,4}\b", re.ASCII)
_LIKE: Final = re.compile(r"^\d{1,4}[-/.:]\d\d?[-/.:]\d|^\d\d?:\d\d|^\d{4}-\d\d|^\d{8}T", re.ASCII)
_DIGITS: Final = 19  # of nanoseconds since 1970, until 2286
_WHOLE: Final = _DIGITS - 9
_MONTHS: Final = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_REWRITTEN: Final = (  # in order; \1 is what stands in the first brackets
    (",", "."),
    (r"^(\d+)\.(\d+)\.(\d{4})", r"\3-\2-\1"),
    (r"^(\d{4})[/.](\d+)[/.](\d+)", r"\1-\2-\3"),
    (r"^(\d{4})-(\d)-", r"\1-0\2-"),
    (r"^(\d{4}-\d\d)-(\d)([T ]|$)", r"\1-0\2\3"),
    (r"^(\d+:)", r"1970-01-01T\1"),
    (r"^\d+ days (\d+:)", r"1970-01-01T\1"),
    (r"([T ])(\d):", r"\10\2:"),
    (r" ?UTC$", "Z"),
    (r" (Z|[+-]\d\d[:\d]*)$", r"\1"),
)
_NIGHT: Final = 86_400_000_000_000  # [ns] from midnight to midnight


def no_number(cell: str) -> str:
    """Why a cell is no number."""
    text = cell.strip()
    if kind_of(text) != "number":
        return "a date or a time of day; if the column is the clock, name it as the time"
    if _UNCLEAR.match(text):
        return "a date whose day and month may be taken for each other; write it as 2024-05-31"
    if _LIKE.match(text):
        return "a date or a time in a form that is not read; write it as 2024-05-31 12:00:00.001"
    return NO_NUMBER


def kind_of(cell: str) -> Kind:
    """What a cell without outer blanks is."""
    return next((kind for kind, form in _FORM.items() if form.match(cell)), "number")


@dataclass
class TimeCells:
    """Reads one column of times, block by block: all of it is dates of one kind, or none is."""

    decimal: Decimal
    kind: Kind | None = None  # as the first cell has it that says anything
    _last: int | None = None  # [ns] of the last time of day
    _nights: int = 0  # since the first

    @property
    def dated(self) -> bool:
        """Whether its cells are made seconds."""
        return self.kind not in {None, "number"}

    def read(self, cells: pa.Array) -> pa.Array:
        """Cells (n,) as numbers (n,), as text; what is missing stays as it is.

        Raises
        ------
        NotNumbersError
            When a cell is not of the column's kind, or there is no such day.
        """
        if self.kind is None:
            filled = (str(cell.as_py()).strip() for cell in cells)
            first = next((cell for cell in filled if not is_missing(cell)), None)
            self.kind = None if first is None else kind_of(first)
        if self.kind is None or not self.dated:
            return cells
        trimmed = pc.utf8_trim_whitespace(cells)
        own = pc.match_substring_regex(trimmed, _FORMS[self.kind])
        for cell in pc.unique(pc.filter(trimmed, pc.invert(own))).to_pylist():
            if not is_missing(cell):
                row = pc.index(trimmed, cell).as_py()
                raise NotNumbersError(row, cell, "no date, as the others are, or of another form")
        ticks = self._ticks(pc.if_else(own, trimmed, None), trimmed)
        digits = pc.utf8_lpad(pc.cast(ticks, pa.string()), _DIGITS, "0")
        whole, part = (pc.utf8_slice_codeunits(digits, *ends) for ends in ((0, _WHOLE), (_WHOLE, _DIGITS)))
        return pc.if_else(own, pc.binary_join_element_wise(whole, part, self.decimal), trimmed)

    def _ticks(self, dates: pa.Array, written: pa.Array) -> pa.Array:
        """Nanoseconds (n,) that are not negative; null where there is no date."""
        zone = "UTC" if self.kind == "zoned" else None
        text = _as_iso(dates)
        found = _cast(text, zone)
        if found is None:
            row = next(k for k in range(len(text)) if _cast(text[k : k + 1], zone) is None)
            raise NotNumbersError(row, str(written[row].as_py()), "no such date or time")
        if self.kind == "span":
            days = pc.cast(pc.replace_substring_regex(dates, " .*", ""), pa.int64())
            found = pc.add(found, pc.multiply(days, _NIGHT))
        early = pc.index(pc.less(found, 0), True).as_py()
        if early >= 0:
            raise NotNumbersError(early, str(written[early].as_py()), "a date before 1970")
        return pc.add(found, self._midnights(found)) if self.kind == "day" else found

    def _midnights(self, ticks: pa.Array) -> pa.Array:
        """What times of day (n,) lack [ns], since midnight passed between them."""
        known = np.asarray(pc.is_valid(ticks))
        times: NDArray[np.int64] = pc.drop_null(ticks).to_numpy()
        if not times.size:
            return pa.array(np.zeros(len(ticks), np.int64))
        before = times[0] if self._last is None else self._last
        nights = self._nights + np.cumsum(np.diff(times, prepend=before) < -_NIGHT // 2)
        self._last, self._nights = int(times[-1]), int(nights[-1])
        passed = np.zeros(len(ticks), np.int64)
        passed[known] = nights * _NIGHT
        return pa.array(passed)


def _as_iso(cells: pa.Array) -> pa.Array:
    """In the one order and with the signs of ISO 8601."""
    if pc.any(pc.match_substring_regex(cells, "[A-Z][a-z]")).as_py():
        cells = pc.replace_substring_regex(cells, r"^(\d+)-([A-Z][a-z]{2})-(\d{4})", r"\3-\2-\1")
        for number, month in enumerate(_MONTHS, start=1):
            cells = pc.replace_substring(cells, f"-{month}-", f"-{number:02d}-")
    for found, instead in _REWRITTEN:
        cells = pc.replace_substring_regex(cells, found, instead)
    return cells


def _cast(cells: pa.Array, zone: str | None) -> pa.Array | None:
    """Nanoseconds since 1970 (n,); None where one is none."""
    with suppress(pa.ArrowInvalid):
        return pc.cast(pc.cast(cells, pa.timestamp("ns", zone)), pa.int64())
    return None

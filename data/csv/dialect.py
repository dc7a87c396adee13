"""How a CSV file is written, found out by looking at its first lines.

There is no one CSV. Rigs write commas, semicolons, tabs or blanks between numbers; decimal points or decimal
commas; a byte order mark, UTF-16, latin-1; comment lines, settings as `# KEY: value`, rows of units and
types; or no header at all. The dialect here is the one under which most of the sampled lines split into the
same number of cells and most cells are numbers. What is found is a value that can be shown, and every part
of it can be frozen by the campaign instead.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Final

from data.columns import declared_unit
from data.csv.cells import Decimal, is_missing, is_number, numeric_share, split
from data.csv.headers import LABVIEW_END, is_units_row, names_pairs, read_above
from data.csv.layout import CsvLayout
from data.csv.records import Record, records
from data.csv.text import ByteArray, Text, lines, open_text, utf8
from data.findings import LogError
from data.names import shown
from data.signals import CsvDialect

_HEADS: Final = (1 << 17, 1 << 22)  # bytes that are looked at; more where no number stands in the first
_SAMPLE: Final = 200  # lines of them
_CELLS: Final = 40_000  # cells of them
_TYPED: Final = 50  # rows by which a column is one of numbers or of words
_COMMENTS: Final = ("#", "%", "//")
_DELIMITERS: Final = (",", ";", "\t", "whitespace")
_FILETIME: Final = 17  # digits of a time that Windows counts from 1601; in ms they would be a million years
_LEAST: Final = (0.5, 0.3)  # of a row's cells that are numbers; the rest are words, and dates
_LIKE_A_NUMBER: Final = re.compile(r"[+-]?[.,]?\d")
_SEPARATOR: Final = re.compile(r'"?sep=([\t ,;|:!$&*/<>?@\\^_~])"?', re.IGNORECASE)
_NO_NUMBERS: Final = "no line of its first part looks like a row of numbers; is it a log?"


def sniff(content: bytes | ByteArray, frozen: CsvDialect | None = None) -> CsvLayout:
    """Find out how a CSV file is written.

    Parameters
    ----------
    content
        The file.
    frozen
        What the campaign has fixed; only the rest is found out.

    Raises
    ------
    LogError
        When it is no text, no line of it looks like numbers, or its names do not fit its numbers.
    """
    frozen = frozen or CsvDialect()
    text = open_text(content, frozen.encoding)
    for size in _HEADS:
        head, whole = _head(text, size)
        if not any(line.strip() for line in head):
            raise LogError("it is empty")
        for least in _LEAST:
            layout = _layout(head, frozen, text.encoding, least=least)
            if layout is not None:
                return layout
        if whole:
            break
    raise LogError(_NO_NUMBERS)


def _head(text: Text, size: int) -> tuple[list[str], bool]:
    """The first whole lines without their ends, and whether they are all."""
    block, end = text.block(text.begin, size)
    decoded = [
        line.decode(errors="replace").rstrip("\r\n") for line in lines(utf8(block, text.codec_of_block))
    ]
    return decoded, end >= text.end


def _layout(head: Sequence[str], frozen: CsvDialect, encoding: str, *, least: float) -> CsvLayout | None:
    """The dialect of a file's first lines; None where in none of them that share of the cells is numbers."""
    marks = _COMMENTS if frozen.comment is None else tuple(filter(None, (frozen.comment,)))
    quote = '"' if frozen.quote is None else frozen.quote
    top = records(head, quote=quote, marks=marks)
    declared = _SEPARATOR.fullmatch(head[0].strip("\ufeff")) if head else None
    delimiter = frozen.delimiter or (declared[1] if declared else None)
    comment = frozen.comment if frozen.comment is not None else _comment(head)
    floor = frozen.lines_before_numbers or _behind_labview_headers(head)
    sample = [_before(line, comment) for line in _sample(top, floor, marks)]
    shape = _shape(sample, delimiter, frozen.decimal, quote, least=least)
    if shape is None:
        return None
    delimiter, decimal, columns = shape
    rows = [_cells(record.text, comment, delimiter, quote, columns=columns) for record in top]
    first = _first_row(
        top, rows, columns=columns, decimal=decimal, frozen=frozen, marks=marks, floor=floor, least=least
    )
    if first is None:
        return None
    if frozen.lines_before_numbers is None:
        first = _with_damaged(top, rows, first, marks)
    _require_no_hidden_row(top[:first], rows[:first], columns=columns, decimal=decimal, marks=marks)
    passed = [k for k in range(first) if _is_row(top[k], rows[k], columns, decimal, marks)]
    if passed and frozen.lines_before_numbers is not None:
        raise LogError(
            f"line {top[passed[0]].first + 1} is a row of numbers, but the campaign says that "
            f"{frozen.lines_before_numbers} lines stand before the first (`lines_before_numbers`): samples "
            "would be passed over. Correct it, or leave it out"
        )
    _require_one_table(top[:first], rows[:first], columns=columns, decimal=decimal, marks=marks)
    found = partial(
        read_above,
        columns=columns,
        marks=marks,
        header=frozen.header,
        units_row=frozen.units_row,
        open_end=all(not row[-1] for row in rows[first:] if len(row) == columns),
    )
    above = found(top[:first], rows[:first])
    if frozen.header and not above.names and frozen.lines_before_numbers is None and first + 1 < len(top):
        first += 1  # names that are numbers
        above = found(top[:first], rows[:first])
    if frozen.header and not above.names:
        raise LogError(
            f"no row of {columns} names stands above its numbers, and the campaign says `header = true`"
        )
    units = above.units or [None] * columns
    if above.paired and len(rows[first][0].partition(decimal)[0]) >= _FILETIME:
        units[0::2] = ["100 ns"] * len(units[0::2])
    return CsvLayout(
        delimiter=delimiter,
        decimal=decimal,
        encoding=encoding,
        headers=above.names,
        units=tuple(
            units[k] or (declared_unit(above.names[k]) if above.names else None) for k in range(columns)
        ),
        columns=columns,
        first_row=top[first].first,
        comment=comment or None,
        metadata=above.metadata,
        quote=quote,
        units_row=above.units_row,
    )


def _comment(head: Sequence[str]) -> str:
    """What lines of comment begin with; empty where there are none."""
    return next((mark for mark in _COMMENTS for line in head if line.startswith(mark)), "")


def _before(line: str, comment: str) -> str:
    """A line without the comment behind its cells."""
    return line.partition(comment)[0] if comment and not line.lstrip().startswith(comment) else line


def _cells(line: str, comment: str, delimiter: str, quote: str, *, columns: int) -> list[str]:
    """The cells of a line, with or without a comment behind them."""
    cells = split(_before(line, comment), delimiter, quote)
    return cells if len(cells) == columns else split(line, delimiter, quote)


def _behind_labview_headers(head: Sequence[str]) -> int:
    """Lines to the end of LabVIEW's second header, which closes with the same words as the first."""
    ends = [k for k, line in enumerate(head) if line.startswith(LABVIEW_END)]
    if len(ends) > 2:
        raise LogError(
            f"a LabVIEW file of several segments: another header ends in line {ends[2] + 1}, and its rows "
            "may have other columns. Save each segment as a file"
        )
    return ends[min(1, len(ends) - 1)] + 1 if ends else 0


def _sample(top: Sequence[Record], floor: int, marks: tuple[str, ...]) -> list[str]:
    """Lines by which the dialect is told: the last of the first part, which are rows if any are."""
    plain = [
        record.text
        for record in top
        if record.first >= floor
        and record.text.strip()
        and "\0" not in record.text
        and not record.commented(marks)
    ]
    sample = plain[-_SAMPLE:]
    cells = max((len(line) for line in sample), default=0) // 4 + 1
    return sample[-max(10, _CELLS // cells) :]


def _shape(
    sample: Sequence[str], frozen: str | None, sign: Decimal | None, quote: str, *, least: float
) -> tuple[str, Decimal, int] | None:
    """Delimiter, decimal sign and number of columns under which the lines look most like numbers."""
    best: tuple[float, int, float] = (0.0, 0, 0.0)
    chosen: tuple[str, Decimal, int] | None = None
    quoted = bool(quote) and any(quote in line for line in sample)  # tells a decimal comma from one between
    decimals: tuple[Decimal, ...] = (sign,) if sign else (".", ",")
    for delimiter in (frozen,) if frozen else _DELIMITERS:
        split_rows = [split(line, delimiter, quote) for line in sample]
        for decimal in decimals:
            if decimal == delimiter and not quoted:
                continue
            shares = [numeric_share(row, decimal) for row in split_rows]
            numeric = [k for k, share in enumerate(shares) if share >= least]
            if not numeric:
                continue
            columns, alike = Counter(len(split_rows[k]) for k in numeric).most_common(1)[0]
            cells = sum(shares[k] for k in numeric) / len(numeric)
            score = round(alike / len(sample) * cells, 2) if columns > 1 else 0.01
            key = (score, columns, float(decimal == "."))
            if chosen is None or key > best:
                best, chosen = key, (delimiter, decimal, columns)
    return chosen


def _first_row(
    top: Sequence[Record],
    rows: Sequence[list[str]],
    *,
    columns: int,
    decimal: Decimal,
    frozen: CsvDialect,
    marks: tuple[str, ...],
    floor: int,
    least: float,
) -> int | None:
    """Which record is the first row of numbers.

    Raises
    ------
    LogError
        When the first that looks like one holds words where all below it hold numbers.
    """
    if frozen.lines_before_numbers is not None:
        return next((k for k, record in enumerate(top) if record.first >= frozen.lines_before_numbers), None)
    paired = any(names_pairs(row, columns) for row in rows)
    alike = [
        k
        for k, row in enumerate(rows)
        if len(row) == columns
        and top[k].first >= floor
        and not top[k].commented(marks)
        and numeric_share(row, decimal) >= least
        and not (paired and row[0] and not is_number(row[0], decimal))
    ]
    unlike = {
        k: words
        for place, k in enumerate(alike[:_SAMPLE])
        if (words := _words(rows[k], [rows[other] for other in alike[place + 1 :][-_TYPED:]], decimal))
    }
    first = next((k for k in alike if k not in unlike), None)
    above = [k for k in unlike if first is None or k < first]
    if not above or first is None:
        return first
    named = [k for k in range(first) if len(rows[k]) == columns and _share(rows[k], decimal) == 0.0]
    settings = bool(named) and named[-1] > above[-1]
    names = frozen.header is True and not named
    if settings or names or all(is_units_row(rows[k], columns) for k in above):
        return first
    raise LogError(
        f"line {top[above[0]].first + 1} holds {shown(unlike[above[0]][0], 40)!r} where the rows below "
        "it hold numbers, and numbers beside it: it may be a row of names, of units, or a damaged one. Say "
        "`header = true` or `lines_before_numbers` under `dialect` in campaign.toml"
    )


def _share(row: Sequence[str], decimal: Decimal) -> float:
    """The share of numbers in a row; 1 where it is empty."""
    return numeric_share(row, decimal) if any(row) else 1.0


def _with_damaged(
    top: Sequence[Record], rows: Sequence[list[str]], first: int, marks: tuple[str, ...]
) -> int:
    """The first row, or the damaged rows right above it, which begin with a number but are no rows."""
    start = first
    for k in range(first - 1, -1, -1):
        if not top[k].text.strip():
            continue
        filled = [cell for cell in rows[k] if cell]
        numeric = len(filled) == 1 or any(is_number(cell, ".") or is_number(cell, ",") for cell in filled)
        damaged = "\0" in top[k].text or (
            bool(filled) and _LIKE_A_NUMBER.match(filled[0]) is not None and numeric
        )
        if top[k].commented(marks) or not damaged:
            break
        start = k
    return start


def _require_no_hidden_row(
    above: Sequence[Record],
    rows: Sequence[list[str]],
    *,
    columns: int,
    decimal: Decimal,
    marks: tuple[str, ...],
) -> None:
    """Refuse a first row that passes for a comment since its first cell begins like one."""
    for record, row in zip(reversed(above), reversed(rows), strict=True):
        if not record.commented(marks):
            return
        first = row[0].lstrip("".join(marks)).strip() if row else ""
        if len(row) == columns > 1 and numeric_share(row[1:], decimal) == 1.0 and is_missing(first) and first:
            raise LogError(
                f"line {record.first + 1} begins with {shown(row[0], 30)!r}, which reads like a comment, but "
                "a row of numbers follows: a sample would be lost unseen"
            )


def _require_one_table(
    above: Sequence[Record],
    rows: Sequence[list[str]],
    *,
    columns: int,
    decimal: Decimal,
    marks: tuple[str, ...],
) -> None:
    """Refuse rows of numbers above the names: they would pass for settings."""
    before = 0
    for record, row in zip(above, rows, strict=True):
        plain = len(row) > 1 and all(row) and not record.commented(marks)
        numeric = plain and numeric_share(row, decimal) == 1.0
        if numeric and before == len(row):
            raise LogError(
                f"line {record.first} and that below it are rows of {len(row)} numbers, and further down it "
                f"has rows of {columns}: two tables in one file, the first of which would be lost. Split it"
            )
        before = len(row) if numeric else 0


def _is_row(
    record: Record, row: Sequence[str], columns: int, decimal: Decimal, marks: tuple[str, ...]
) -> bool:
    """Whether a record can be nothing but a row of numbers."""
    return len(row) == columns and not record.commented(marks) and numeric_share(row, decimal) == 1.0


def _words(row: Sequence[str], below: Sequence[Sequence[str]], decimal: Decimal) -> list[str]:
    """Cells of a row that are words in columns of numbers."""
    if len(below) < 2:
        return []
    return [
        cell
        for k, cell in enumerate(row)
        if not is_number(cell, decimal)
        and not is_missing(cell)
        and sum(is_number(other[k], decimal) or is_missing(other[k]) for other in below) > 0.9 * len(below)
    ]

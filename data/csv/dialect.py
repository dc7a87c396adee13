"""How a CSV file is written, found out by looking at its first lines.

There is no one CSV. Rigs write commas, semicolons, tabs or blanks between numbers; decimal points or decimal
commas; a byte order mark, UTF-16, latin-1; comment lines, settings as `# KEY: value`, rows of units and
types; or no header at all. The dialect here is the one under which most of the sampled lines split into the
same number of cells and most cells are numbers. What is found is a value that can be shown, and every part
of it can be frozen by the campaign instead.

Parsing itself is left to pandas' C engine, which is exact for all of these.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from data.findings import LogError
from data.names import shown
from data.signals import CsvDialect
from data.units import known_unit

Decimal = Literal[".", ","]
_HEAD: Final = 1 << 17  # bytes that are looked at
_SAMPLE: Final = 200  # lines of them
_COMMENTS: Final = ("#", "%", "//")
_DELIMITERS: Final = (",", ";", "\t", "whitespace")
_NUMBER: Final = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE),
}
_BRACKETED: Final = re.compile(r"^(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))$")
_SUFFIXED: Final = re.compile(r"^.+_(deg|rad|mrad|rpm)$")  # the only endings that cannot mean anything else
_SETTING: Final = re.compile(r"((?:[\w.\-/ ]{1,60}(?=:))|(?:[\w.\-]{1,60}(?= ?=))) ?[:=] *(.*)")
_UNITS_ROW: Final = re.compile(r"units?:?$|einheit:?$", re.IGNORECASE)


@dataclass(frozen=True)
class CsvLayout:
    """What was found of one file."""

    delimiter: str  # one character, or "whitespace"
    decimal: Decimal
    encoding: str
    headers: tuple[str, ...]  # as they stand, empty where there is no header
    units: tuple[str | None, ...]  # what header, units row or name declare; None: nothing
    columns: int
    first_row: int  # lines before the first row of numbers
    comment: str | None
    metadata: dict[str, str]

    @property
    def described(self) -> str:
        """One clause for a person."""
        names = {",": "comma", ";": "semicolon", "\t": "tab", "whitespace": "blanks"}
        parts = [
            f"{names.get(self.delimiter, self.delimiter)} between cells",
            f"decimal {'comma' if self.decimal == ',' else 'point'}",
            self.encoding,
            "a header" if self.headers else "no header",
        ]
        return ", ".join(parts)


def sniff(content: bytes, frozen: CsvDialect | None = None) -> CsvLayout:
    """Find out how a CSV file is written.

    Parameters
    ----------
    content
        The file, or its first part.
    frozen
        What the campaign has fixed; only the rest is found out.

    Raises
    ------
    LogError
        When it is no text, or no line of it looks like numbers.
    """
    frozen = frozen or CsvDialect()
    encoding = frozen.encoding or _encoding(content)
    lines = _head(content, encoding)
    comment = next((mark for mark in _COMMENTS for line in lines if line.startswith(mark)), None)
    delimiter, decimal, columns = _shape(lines, frozen)
    rows = [split(line, delimiter) for line in lines]
    first = next(
        (
            k
            for k, row in enumerate(rows)
            if len(row) == columns and not _is_comment(lines[k]) and numeric_share(row, decimal) >= 0.5
        ),
        None,
    )
    if first is None:
        raise LogError("no line of its first part looks like a row of numbers; is it a log?")
    above = [k for k in range(first) if lines[k].strip()]
    headers, units_row = _headers(lines, rows, above, columns=columns)
    if frozen.header is False:
        headers = ()
    declared = tuple(
        (units_row[k] if units_row else None) or (declared_unit(headers[k]) if headers else None)
        for k in range(columns)
    )
    return CsvLayout(
        delimiter=delimiter,
        decimal=decimal,
        encoding=encoding,
        headers=headers,
        units=declared,
        columns=columns,
        first_row=first,
        comment=comment[0] if comment and len(comment) == 1 else None,
        metadata=_metadata(lines[:first]),
    )


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, quotes and outer blanks removed."""
    if delimiter == "whitespace":
        return line.split()
    cells = next(csv.reader([line], delimiter=delimiter), [])
    return [cell.strip() for cell in cells]


def bare(header: str) -> str:
    """A header without its unit: `q` for `q [deg]`."""
    found = _BRACKETED.match(header.strip())
    return (found[1] if found else header).strip()


def declared_unit(header: str) -> str | None:
    """The unit that a header declares, in brackets or by an ending that can mean nothing else; None: none."""
    found = _BRACKETED.match(header.strip())
    word = (found[2] or found[3] or "") if found else ""
    if not word:
        ending = _SUFFIXED.match(header.strip())
        word = ending[1] if ending else ""
    return word.strip() if word and known_unit(word) else None


def _encoding(content: bytes) -> str:
    head = content[:_HEAD]
    for mark, name in ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if head.startswith(mark):
            return name
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        if max(even, odd) > 0.4 * len(head) / 2 and min(even, odd) == 0:
            return "utf-16-le" if odd else "utf-16-be"
        raise LogError("it holds NUL bytes: it is no text file, or a damaged one")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _head(content: bytes, encoding: str) -> list[str]:
    """The first lines as text, without a last one that may be cut."""
    try:
        text = content[:_HEAD].decode(encoding, errors="ignore" if len(content) > _HEAD else "strict")
    except (UnicodeDecodeError, LookupError) as error:
        raise LogError(f"it cannot be read as {shown(encoding, 30)} ({error})") from error
    lines = text.splitlines()
    if len(content) > _HEAD and len(lines) > 1:
        lines = lines[:-1]
    if not any(line.strip() for line in lines):
        raise LogError("it is empty")
    return lines


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENTS)


def _shape(lines: Sequence[str], frozen: CsvDialect) -> tuple[str, Decimal, int]:
    """Delimiter, decimal sign and number of columns under which the lines look most like numbers."""
    plain = [line for line in lines if line.strip() and not _is_comment(line)]
    sample = plain[-_SAMPLE:] if len(plain) > _SAMPLE else plain
    best: tuple[float, float, int] = (0.0, 0.0, 0)
    chosen: tuple[str, Decimal, int] | None = None
    quoted = any('"' in line for line in sample)  # which tells a decimal comma from one between cells
    decimals: tuple[Decimal, ...] = (frozen.decimal,) if frozen.decimal else (".", ",")
    for delimiter in (frozen.delimiter,) if frozen.delimiter else _DELIMITERS:
        for decimal in decimals:
            if decimal == delimiter and not quoted:
                continue
            rows = [split(line, delimiter) for line in sample]
            numeric = [row for row in rows if numeric_share(row, decimal) >= 0.5]
            if not numeric:
                continue
            columns, alike = Counter(len(row) for row in numeric).most_common(1)[0]
            cells = sum(numeric_share(row, decimal) for row in numeric) / len(numeric)
            score = (
                round(alike / len(sample) * cells, 2) if columns > 1 else 0.01,
                float(decimal == "."),
                columns,
            )
            if chosen is None or (score[0], score[2], score[1]) > (best[0], best[2], best[1]):
                best, chosen = score, (delimiter, decimal, columns)
    if chosen is None:
        raise LogError("no line of its first part looks like a row of numbers; is it a log?")
    return chosen


def numeric_share(row: Sequence[str], decimal: Decimal) -> float:
    """The share of a row's filled cells that are numbers; 0 for a row without any."""
    filled = [cell for cell in row if cell]
    if not filled:
        return 0.0
    return sum(_NUMBER[decimal].fullmatch(cell) is not None for cell in filled) / len(filled)


def _headers(
    lines: Sequence[str], rows: Sequence[list[str]], above: Sequence[int], *, columns: int
) -> tuple[tuple[str, ...], list[str | None] | None]:
    """The row of names above the numbers, and a row of units, where there are any."""
    names: tuple[str, ...] = ()
    units: list[str | None] | None = None
    for k in reversed(above):
        if _is_comment(lines[k]):
            if not names and k == above[-1] and (bare_row := _commented_header(lines[k], rows[k], columns)):
                return bare_row, units
            continue
        row = rows[k] + [""] * (columns - len(rows[k]))
        if len(rows[k]) > columns or sum(bool(cell) for cell in row) < min(2, columns):
            continue
        if units is None and _is_units_row(row):
            units = [word.strip("[]()") if known_unit(word.strip("[]()")) else None for word in row]
            continue
        if row[0].endswith(":") and any(k2 < k for k2 in above):
            continue  # a metadata row such as `Type:`
        names = tuple(row)
        break
    return names, units


def _commented_header(line: str, row: Sequence[str], columns: int) -> tuple[str, ...]:
    """A header behind a comment mark, as numpy writes it; empty when the line is something else."""
    if re.match(r"^\W+[^:,;\t]+:", line):
        return ()
    mark = next(mark for mark in _COMMENTS if line.lstrip().startswith(mark))
    cells = [cell for cell in (row[0].lstrip().removeprefix(mark).strip(), *row[1:]) if cell]
    return tuple(cells) if len(cells) == columns else ()


def _is_units_row(row: Sequence[str]) -> bool:
    first, *rest = row
    words = [word.strip("[]()") for word in (rest if _UNITS_ROW.match(first) else row)]
    known = [known_unit(word) is not None for word in words if word not in {"", "-", "1"}]
    if _UNITS_ROW.match(first):
        return True
    # A header of single letters (`t`, `s`, `A`) is rarely all units; brackets or two known words make a row.
    return len(known) >= min(2, len(row)) and all(known)


def _metadata(lines: Sequence[str]) -> dict[str, str]:
    """Settings written as `# KEY: value` (or `=`) before the numbers."""
    found: dict[str, str] = {}
    for line in lines:
        if not _is_comment(line):
            continue
        text = line.lstrip().lstrip("#%/").strip()
        setting = _SETTING.fullmatch(text)
        if setting and len(found) < 1000:
            found.setdefault(setting[1].strip(), setting[2].strip())
    return found

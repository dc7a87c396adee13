"""Which rows of a CSV file can be trusted to hold what the rig wrote.

Three things go wrong with rows while every single number still parses. A cell is lost or won, so that the
numbers behind it stand in other columns. A cell such as `#N/A` opens a row, so that the row passes for a
comment. The recording stops in the middle of a line, so that its last number is cut: `0.4210` is a number,
and so are `0.42` and `0`. Such rows are taken out and named; what remains are whole rows.

A last line without a line end is common and mostly whole. It counts as cut when a cell is missing or its last
cell cannot be one of the column's: too few decimals among numbers that all have the same, or an open end
like `0.` or `1e-`. Where decimals vary, a last number shorter than is usual may be cut or may be right; its
row is left out and that is said, which costs one sample.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median
from typing import Final, Literal

import numpy as np

from data.csv.dialect import CsvLayout, numeric_share, split
from data.findings import LogError
from data.integrity import Loss
from data.names import shown

_MOST_LOSSES: Final = 1000  # rows, after which the file is no table
_NEIGHBOURS: Final = 200  # rows above the last that it is compared with
_DISTINCT: Final = 10  # cells among them that prove a number format
_LONG: Final = 8  # decimals, from which on one or two fewer change nothing
_CELL: Final = re.compile(r"[+-]?(\d*)(?:[.,](\d*))?(?:[eE][+-]?(\d*))?")
_LINE_END: Final = re.compile(rb"\r\n|\n|\r")
_Shape = tuple[int, int, int]  # digits before the decimal sign, behind it, in the exponent; -1: no such part


@dataclass(frozen=True)
class Rows:
    """A file's whole rows, below the lines that stand above the numbers."""

    text: bytes
    encoding: str
    losses: tuple[Loss, ...]  # rows that were taken out because they are damaged
    notes: tuple[str, ...]  # rows that were left out for another reason


@dataclass(frozen=True)
class _Line:
    """One line of the text."""

    number: int  # from 1
    begin: int  # [bytes]
    end: int  # [bytes], past its line end
    text: str


def whole_rows(content: bytes, layout: CsvLayout) -> Rows:
    """The rows that hold as many cells as the numbers have columns, and no cut number.

    Raises
    ------
    LogError
        When so many rows differ that the file is no table.
    """
    text, encoding = content, layout.encoding
    if encoding.startswith("utf-16"):  # bytes can only be searched where a character is one
        text, encoding = content.decode(encoding, errors="replace").encode(), "utf-8"
    top = _top(text, layout.first_row)
    end, losses, notes = _without_cut_line(text, top, encoding=encoding, layout=layout)
    odd, commented = _odd_lines(text[:end], top, encoding=encoding, layout=layout)
    if len(odd) > _MOST_LOSSES:
        raise LogError(f"{odd[0][1]}. So do {len(odd) - 1} more lines: is it a table?")
    if commented:
        notes.append(f"{commented} rows of numbers are commented out and were not read")
    pieces, here = [], 0
    for line, _ in odd:
        pieces.append(text[here : line.begin])
        here = line.end
    found = [*((line.begin, line.end, why) for line, why in odd), *losses]
    return Rows(
        text=b"".join((*pieces, text[here:end])),
        encoding=encoding,
        losses=tuple(_loss(text, layout, begin, stop, why) for begin, stop, why in found),
        notes=tuple(notes),
    )


def _loss(text: bytes, layout: CsvLayout, begin: int, end: int, why: str) -> Loss:
    """A loss by its bytes in the file as it is."""
    if layout.encoding.startswith("utf-16"):
        begin, end = (len(text[:place].decode().encode(layout.encoding)) for place in (begin, end))
    return Loss(begin, end, why)


def _top(text: bytes, lines: int) -> int:
    """Where the first row of numbers begins [bytes]."""
    here = 0
    for _ in range(lines):
        found = _LINE_END.search(text, here)
        here = found.end() if found else len(text)
    return here


def _odd_lines(
    text: bytes, top: int, *, encoding: str, layout: CsvLayout
) -> tuple[list[tuple[_Line, str]], int]:
    """Lines that are no rows with why, and how many rows are commented out."""
    odd: list[tuple[_Line, str]] = []
    commented = 0
    for line in _suspects(text, top, encoding=encoding, layout=layout):
        cells = split(line.text, layout.delimiter)
        if not line.text.strip():
            continue
        if layout.comment and line.text.lstrip().startswith(layout.comment):
            if len(cells) != layout.columns or numeric_share(cells[1:], layout.decimal) < 0.5:
                continue
            if numeric_share([cells[0].lstrip(layout.comment).strip()], layout.decimal) == 1.0:
                commented += 1
                continue
            odd.append(
                (
                    line,
                    f"line {line.number} begins with {shown(cells[0], 30)!r}, which reads like a comment, "
                    "but a row of numbers follows: a sample would be lost unseen",
                )
            )
        elif len(cells) != layout.columns:
            before = line.text.partition(layout.comment)[0] if layout.comment else line.text
            if before != line.text and len(split(before, layout.delimiter)) == layout.columns:
                continue  # a comment behind the numbers
            odd.append(
                (
                    line,
                    f"line {line.number} has {len(cells)} cells, the others {layout.columns}; a lost cell "
                    "would shift the numbers behind it into other columns",
                )
            )
    return odd, commented


def _suspects(text: bytes, top: int, *, encoding: str, layout: CsvLayout) -> Iterator[_Line]:
    """Lines below `top` with an unusual number of delimiters, or that may be comments."""
    body = np.frombuffer(text, np.uint8)[top:]
    if not body.size:
        return
    is_end = body == ord("\n")
    returns = body == ord("\r")
    if returns.any():
        is_end |= returns & ~np.append(body[1:] == ord("\n"), False)
    ends = np.flatnonzero(is_end) + 1
    begins = np.concatenate(([0], ends[ends < body.size]))
    stops = np.append(begins[1:], body.size)
    if layout.delimiter == "whitespace":
        blank = (body == ord(" ")) | (body == ord("\t")) | is_end | returns
        mark = ~blank & np.concatenate(([True], blank[:-1]))
        usual = layout.columns
    else:
        mark = body == ord(layout.delimiter)
        usual = layout.columns - 1
    unusual = np.add.reduceat(mark, begins, dtype=np.int64) != usual
    if layout.comment and layout.comment.encode() in text[top:]:
        unusual |= np.isin(body[begins], [ord(layout.comment), ord(" "), ord("\t")])
    for k in np.flatnonzero(unusual).tolist():
        begin, stop = top + int(begins[k]), top + int(stops[k])
        words = text[begin:stop].decode(encoding, errors="replace").rstrip("\r\n")
        yield _Line(layout.first_row + k + 1, begin, stop, words)


def _without_cut_line(
    text: bytes, top: int, *, encoding: str, layout: CsvLayout
) -> tuple[int, list[tuple[int, int, str]], list[str]]:
    """Where the whole lines end [bytes]; the cut line as a loss, or the doubt about it as a note."""
    size = len(text)
    begin = max(text.rfind(b"\n"), text.rfind(b"\r")) + 1
    last = text[begin:].decode(encoding, errors="replace")
    if begin == size or begin < top or not last.strip():
        return size, [], []
    cells = split(last, layout.delimiter)
    if len(cells) < layout.columns:
        return begin, [(begin, size, "the last line is cut off")], []
    if last.count('"') % 2:
        return begin, [(begin, size, "the last line is cut off inside quotes")], []
    if len(cells) > layout.columns or last.rstrip().endswith('"'):
        return size, [], []
    above = text[max(top, begin - (1 << 16)) : begin].decode(encoding, errors="replace").splitlines()
    rows = [split(line, layout.delimiter) for line in above[-_NEIGHBOURS:]]
    state = _state(cells[-1], [row[-1] for row in rows if len(row) == layout.columns])
    if state == "whole":
        return size, [], []
    seen = f"the last line has no line end and stops at {shown(cells[-1], 30)!r}"
    if state == "cut":
        return begin, [(begin, size, f"{seen}: its last number is cut off")], []
    return begin, [], [f"{seen}, shorter than the numbers above it: it may be cut off and was left out"]


def _state(cell: str, above: list[str]) -> Literal["whole", "doubtful", "cut"]:
    """Whether a last cell without a line end is one of its column, whose cells stand above it."""
    shapes = [shape for other in above if (shape := _shape(other)) is not None]
    if cell in above or not above:
        return "whole"
    if 2 * len(shapes) < len(above):  # words
        return "doubtful" if len(cell) < min(len(other) for other in above) else "whole"
    own = _shape(cell)
    if own is None:
        return "cut"
    return _number_state(own, shapes, distinct=len(set(above)))


def _number_state(own: _Shape, above: list[_Shape], *, distinct: int) -> Literal["whole", "doubtful", "cut"]:
    """The same for a number, of which `distinct` different ones stand above."""
    digits, decimals, exponent = (sorted(column) for column in zip(*above, strict=True))
    open_end = (own[1] == 0 and 0 not in decimals) or own[2] == 0 or own == (0, -1, -1)
    if open_end or own[2] < exponent[0]:  # `0.`, `1e-`, `-`; or each of the others has an exponent
        return "cut"
    if own[2] >= 0:
        return "whole"
    if decimals[-1] < 0:  # integers
        return "doubtful" if own[0] < digits[0] else "whole"
    if decimals[0] == decimals[-1] and distinct >= _DISTINCT:
        return "cut" if own[1] < decimals[0] else "whole"
    usual = median(decimals)
    return "doubtful" if own[1] < usual - 2 * (usual > _LONG) else "whole"


def _shape(cell: str) -> _Shape | None:
    """The shape of a number; None: it is none."""
    found = _CELL.fullmatch(cell)
    if found is None:
        return None
    return (
        len(found[1]),
        -1 if found[2] is None else len(found[2]),
        -1 if found[3] is None else len(found[3]),
    )

"""Whether a file's last line is whole, or the recording stopped in the middle of it.

A number cut short is a number: `0.4210` is one, and so are `0.42` and `0`. A last line without a line end is
common and mostly whole. It counts as cut when a cell is missing or its last cell cannot be one of the
column's: too few decimals among numbers that all have the same, or an open end like `0.` or `1e-`. Where
decimals vary, a last number shorter than is usual may be cut or may be right; its row is left out and that is
said, which costs one sample.
"""

from __future__ import annotations

import re
from statistics import median
from typing import Final, Literal

import numpy as np

from data.csv.cells import split
from data.csv.layout import CsvLayout
from data.csv.text import LONGEST_LINE, Text, lines, utf8
from data.findings import LogError
from data.integrity import Loss
from data.names import shown

_NEIGHBOURS: Final = 200  # rows above the last that it is compared with
_NEAR: Final = 1 << 16  # bytes in which they are looked for
_DISTINCT: Final = 10  # cells among them that prove a number format
_LONG: Final = 8  # decimals, from which on one or two fewer change nothing
_CELL: Final = re.compile(r"[+-]?(\d*)(?:[.,](\d*))?(?:[eE][+-]?(\d*))?")
_Shape = tuple[int, int, int]  # digits before the decimal sign, behind it, in the exponent; -1: no such part


def cut_line(text: Text, layout: CsvLayout, *, top: int) -> tuple[int, list[Loss], list[str]]:
    """Where the whole lines end [bytes]; the cut line as a loss, or the doubt about it as a note.

    The first row of numbers begins at byte `top`.
    """
    begin, last = _last_line(text)
    end = text.end
    if begin == end or begin < top or "\0" in last or not last.strip():
        return end, [], []
    try:
        cells = split(last, layout.delimiter, layout.quote)
    except LogError:
        return begin, [Loss(begin, end, "the last line is cut off inside quotes")], []
    if len(cells) < layout.columns:
        return begin, [Loss(begin, end, "the last line is cut off")], []
    if layout.quote and last.count(layout.quote) % 2:
        return begin, [Loss(begin, end, "the last line is cut off inside quotes")], []
    if len(cells) > layout.columns or (layout.quote and last.rstrip().endswith(layout.quote)):
        return end, [], []
    rows = [split(line, layout.delimiter, "") for line in _above(text, top, begin)]
    state = _state(cells[-1], [row[-1] for row in rows if len(row) == layout.columns])
    if state == "whole":
        return end, [], []
    seen = f"the last line has no line end and stops at {shown(cells[-1], 30)!r}"
    if state == "cut":
        return begin, [Loss(begin, end, f"{seen}: its last number is cut off")], []
    return begin, [], [f"{seen}, shorter than the numbers above it: it may be cut off and was left out"]


def _last_line(text: Text) -> tuple[int, str]:
    """Where the last line begins [bytes], and its text; it is empty where the file ends with a line end."""
    size = _NEAR
    while True:
        start = max(text.begin, text.end - size)
        raw = text.content[start : text.end].tobytes()
        at = _behind_line_end(raw, text)
        if at or start == text.begin or size > LONGEST_LINE:
            return start + at, utf8(raw[at:], text.codec).decode(errors="replace")
        size *= 4


def _behind_line_end(raw: bytes, text: Text) -> int:
    """Behind the last line end of bytes; 0: none."""
    if text.width == 1:
        return max(raw.rfind(b"\n"), raw.rfind(b"\r")) + 1
    units = np.frombuffer(raw[: len(raw) // 2 * 2], "<u2" if text.codec.endswith("le") else ">u2")
    ends = np.flatnonzero((units == ord("\n")) | (units == ord("\r")))
    return int(2 * ends[-1] + 2) if ends.size else 0


def _above(text: Text, top: int, begin: int) -> list[str]:
    """Lines above byte `begin`, from byte `top` on at most."""
    start = max(top, begin - _NEAR)
    near = utf8(text.content[start:begin].tobytes(), text.codec)
    return [line.decode(errors="replace").rstrip("\r\n") for line in lines(near)][-_NEIGHBOURS:]


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

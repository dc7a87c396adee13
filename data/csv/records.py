"""Records of a CSV text: lines, joined where a quoted cell goes on over a line end.

A quotation mark opens a cell only where the cell begins, and closes it only where the cell ends. A mark that
opens and is closed on a later line joins the lines between; one that is never closed is damage of its own
line and joins nothing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

MOST_JOINED: Final = 200  # lines in one quoted cell


@dataclass(frozen=True)
class Record:
    """One row, or a line above the rows."""

    first: int  # its first line, counted from 0
    past: int  # behind its last line
    text: str  # without its line end; a blank for each line end inside a cell

    def commented(self, marks: tuple[str, ...]) -> bool:
        """Whether it begins with one of the marks of a comment."""
        return self.text.lstrip().startswith(marks)


def records(lines: Sequence[str], *, quote: str, marks: tuple[str, ...], first: int = 0) -> list[Record]:
    """The records of lines without their ends, the first of which has the number `first`."""
    found: list[Record] = []
    k = 0
    while k < len(lines):
        past = k + 1
        line = lines[k]
        if quote and line.count(quote) % 2 and not line.lstrip().startswith(marks):
            past = joined(lines, k, quote)
        found.append(Record(first + k, first + past, " ".join(lines[k:past])))
        k = past
    return found


def joined(lines: Sequence[str], k: int, quote: str) -> int:
    """Behind the last line of a quoted cell that opens on line `k`; `k + 1` when it is not closed."""
    mark = re.escape(quote)
    if re.search(rf"(?:^|[^\w{mark}.])\s*{mark}(?:[^{mark}]|{mark}{mark})*$", lines[k]) is None:
        return k + 1
    for past in range(k + 1, min(k + 1 + MOST_JOINED, len(lines))):
        if lines[past].count(quote) % 2:
            closes = re.match(rf"(?:[^{mark}]|{mark}{mark})*{mark}\s*(?:$|[^\w\s{mark}])", lines[past])
            return past + 1 if closes else k + 1
    return k + 1

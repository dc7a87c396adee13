"""Which rows of a CSV file can be trusted to hold what the rig wrote.

Four things go wrong with rows while every single number still parses. A cell is lost or won, so that the
numbers behind it stand in other columns. A cell such as `#N/A` opens a row, so that the row passes for a
comment. A quotation mark opens and is not closed, so that rows hide in a cell. The recording stops in the
middle of a line (see `data.csv.cut_line`). Such rows are taken out and named; what remains are whole rows,
and the place of each that is missing is kept, for nothing may be interpolated across it.

Rows are found block by block: in a block without quotation marks all at once, in one with them line by line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.csv.cells import BLANKS, is_number, numeric_share, split
from data.csv.cut_line import cut_line
from data.csv.layout import CsvLayout
from data.csv.records import MOST_JOINED, joined
from data.csv.text import BLOCK, Text, line_bounds, lines, utf8
from data.findings import LogError
from data.integrity import Loss
from data.names import shown

_MOST_LOSSES: Final = 1000  # rows, after which the file is no table
_MOST_NAMED: Final = 8  # lines
_Verdict = tuple[str, str]  # what to do (keep, blank, comment, hidden, empty, names, lost), and why


@dataclass(frozen=True)
class Rows:
    """What became of a file's rows."""

    kept: int
    losses: tuple[Loss, ...]  # rows that were taken out because they are damaged
    notes: tuple[str, ...]  # rows that were left out for another reason
    breaks: tuple[int, ...]  # kept rows at which another part begins, since rows before them are missing


@dataclass
class Tally:
    """What a walk through the rows has found so far."""

    kept: int = 0
    losses: list[Loss] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    missing_before: list[int] = field(default_factory=list)  # kept rows before which others are missing

    @property
    def rows(self) -> Rows:
        """The same once the walk is over."""
        places = {place for place in self.missing_before if 0 < place < self.kept}
        return Rows(self.kept, tuple(self.losses), tuple(self.notes), tuple(sorted(places)))


@dataclass(frozen=True)
class Block:
    """Whole rows that stand one after the other."""

    text: bytes  # one row a line in UTF-8; empty where `cells` holds the rows
    cells: list[list[str]] | None
    rows: int
    quote: str = ""  # around cells of `text`


@dataclass
class _Place:
    """Where the walk is."""

    byte: int
    line: int  # counted from 0


def whole_rows(text: Text, layout: CsvLayout, found: Tally) -> Iterator[Block]:
    """The rows that hold as many cells as the numbers have columns, and no cut number, block by block.

    What is left out is added to `found`.

    Raises
    ------
    LogError
        When so many rows differ that the file is no table.
    """
    top = _Place(*_top(text, layout))
    end, losses, notes = cut_line(text, layout, top=top.byte)
    walk = _Walk(text, layout, found, top)
    size = BLOCK
    while walk.place.byte < end:
        content, past = text.block(walk.place.byte, size)
        if past > end:  # the cut line is the last, and a block ends with it
            content = content[: len(content) - _size(text, end, past)]
            past = end
        taken = walk.take(content, past=past, last=past >= end)
        if taken is None:
            size *= 2
            continue
        size = BLOCK
        yield taken
    found.losses += losses
    found.notes += notes
    if walk.hidden:
        found.notes.append(f"{walk.hidden} rows of numbers are commented out and were not read")
    if walk.named:
        where = ", ".join(map(str, walk.named[:_MOST_NAMED]))
        more = " and others" if len(walk.named) > _MOST_NAMED else ""
        found.notes.append(
            f"the names stand again in line {where}{more}: recordings were joined there, and the run is "
            "taken apart"
        )
    if walk.empty:
        found.notes.append(f"{walk.empty} rows hold no cell and were left out")
    if text.end < text.content.size and text.content.size - text.end > text.width - 1:
        zeros = text.content.size - text.end
        found.losses.append(
            Loss(
                text.end, text.content.size, f"{zeros} zero bytes at the end were never written: a power loss"
            )
        )


def _size(text: Text, begin: int, end: int) -> int:
    """Bytes of a block that a part of the file takes."""
    raw = text.content[begin:end].tobytes()
    return len(raw) if text.width == 1 else len(utf8(raw, text.codec))


def _top(text: Text, layout: CsvLayout) -> tuple[int, int]:
    """The byte at which the first row of numbers begins, and its line."""
    byte, number = text.begin, 0
    while number < layout.first_row and byte < text.end:
        content, past = text.block(byte)
        for line in lines(content)[: layout.first_row - number]:
            byte += text.size_of(line)
            number += 1
        if number < layout.first_row:
            byte = past
    return byte, number


def _plain(name: str) -> str:
    """A name as the layout has it."""
    return " ".join(name.split())


@dataclass
class _Walk:
    """Takes blocks apart, one after the other."""

    text: Text
    layout: CsvLayout
    found: Tally
    place: _Place
    hidden: int = 0
    empty: int = 0
    named: list[int] = field(default_factory=list)  # lines, counted from 1, that repeat the names

    def take(self, content: bytes, *, past: int, last: bool) -> Block | None:
        """The rows of a block; None when a quoted cell goes on behind it."""
        quote = self.layout.quote
        if not quote or quote.encode() not in content:
            block = self._unquoted(content)
            self.place = _Place(past, self.place.line)
            return block
        return self._regular(content, past=past) or self._quoted(content, past=past, last=last)

    def _regular(self, content: bytes, *, past: int) -> Block | None:
        """A block in which every line is a row, quotes and all; None where one is not, or may not be."""
        layout = self.layout
        signs = [
            "\0",
            layout.comment or "\0",
            f" {layout.quote}",
        ]  # behind a blank, a quote is no first character
        if layout.delimiter != "\t":
            signs.append(f"\t{layout.quote}")
        if layout.delimiter == "whitespace" or any(sign.encode() in content for sign in signs):
            return None
        begins, stops = line_bounds(content)
        body = np.frombuffer(content, np.uint8)
        if self._may_name(body, begins + 1).any():
            return None
        quotes = body == ord(layout.quote)
        outside = np.cumsum(quotes, dtype=np.uint8) & 1 == 0  # wraps at an even number
        mark = (body == ord(layout.delimiter)) & outside
        usual = layout.columns - 1
        rows = np.add.reduceat(mark, begins, dtype=np.int32) == usual
        rows &= (np.add.reduceat(quotes, begins, dtype=np.int32) % 2 == 0) & (stops - begins > usual + 2)
        if not rows.all():
            return None
        self.place = _Place(past, self.place.line + begins.size)
        self.found.kept += begins.size
        return Block(utf8(content, self.text.codec_of_block), None, begins.size, layout.quote)

    def _unquoted(self, content: bytes) -> Block:
        begins, stops = line_bounds(content)
        suspects = np.flatnonzero(self._suspect(content, begins, stops)).tolist()
        pieces, here, dropped = [], 0, 0
        before = self.found.kept
        for k in suspects:
            begin, stop = int(begins[k]), int(stops[k])
            do, why = self.verdict(self._decoded(content[begin:stop]), self.place.line + k)
            if do == "keep" and not why:
                continue
            pieces.append(content[here:begin])
            here = stop
            if do == "keep":  # without the comment behind it
                pieces.append(why.encode(self.text.codec_of_block, errors="replace") + b"\n")
                continue
            self._left_out(do, why, content, begin, stop, before=before + k - dropped)
            dropped += 1
        kept = begins.size - dropped
        self.place.line += begins.size
        self.found.kept += kept
        text = utf8(b"".join((*pieces, content[here:])), self.text.codec_of_block)
        if self.layout.delimiter == "whitespace":
            text = b"\n".join(b" ".join(line.split()) for line in lines(text))
        return Block(text, None, kept)

    def _suspect(
        self, content: bytes, begins: NDArray[np.intp], stops: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Lines (n,) with an unusual number of cells, or none, or that may be comments or damaged."""
        layout = self.layout
        body = np.frombuffer(content, np.uint8)
        if layout.delimiter == "whitespace":
            blank = np.isin(body, [ord(sign) for sign in BLANKS + "\r\n"])
            mark = ~blank
            mark[1:] &= blank[:-1]
            mark[begins] = ~blank[begins]
            usual = layout.columns
        else:
            mark = body == ord(layout.delimiter)
            usual = layout.columns - 1
        odd = np.add.reduceat(mark, begins, dtype=np.int32) != usual
        odd |= stops - begins <= usual + 2  # only delimiters
        odd |= self._may_name(body, begins)
        if layout.columns == 1:
            odd |= np.isin(body[begins], [ord(sign) for sign in BLANKS])
        for sign in (layout.comment, "\0"):
            if sign and sign.encode() in content:
                at = [match.start() for match in re.finditer(re.escape(sign.encode()), content)]
                odd[np.searchsorted(begins, at, side="right") - 1] = True
        return np.asarray(odd, np.bool_)

    def _may_name(self, body: NDArray[np.uint8], begins: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Lines (n,) that begin as the row of names does, if no number can."""
        first = self.layout.headers[0][:1] if self.layout.headers else ""
        if not first.isascii() or not first.isalpha():
            return np.zeros(begins.size, np.bool_)
        return np.asarray(body[np.minimum(begins, body.size - 1)] == ord(first), np.bool_)

    def _quoted(self, content: bytes, *, past: int, last: bool) -> Block | None:
        quote = self.layout.quote
        raw = lines(content)
        texts = [self._decoded(line) for line in raw]
        sizes = np.concatenate(([0], np.cumsum([len(line) for line in raw])))
        cells: list[list[str]] = []
        before, k = self.found.kept, 0
        while k < len(raw):
            stop = k + 1
            line = texts[k]
            if line.count(quote) % 2 and not self._is_comment(line):
                stop = joined(texts, k, quote)
                if stop == k + 1 and not last and len(raw) - k <= MOST_JOINED:
                    if k == 0:
                        return None
                    break  # the cell may be closed in the next block
                if stop > k + 1 and self._hides_rows(texts[k + 1 : stop - 1], " ".join(texts[k:stop])):
                    stop = k + 1
            row, do, why = self._row(" ".join(texts[k:stop]), self.place.line + k)
            if do == "keep":
                cells.append(row)
            else:
                begin, end = int(sizes[k]), int(sizes[stop])
                self._left_out(do, why, content, begin, end, before=before + len(cells))
            k = stop
        size = int(sizes[k])
        self.place = _Place(
            past if k == len(raw) else self.place.byte + self.text.size_of(content[:size]),
            self.place.line + k,
        )
        self.found.kept += len(cells)
        return Block(b"", cells, len(cells))

    def _row(self, line: str, number: int) -> tuple[list[str], str, str]:
        """The cells of a record, what to do with it, and why."""
        try:
            do, why = self.verdict(line, number)
            cells = split(why or line, self.layout.delimiter, self.layout.quote) if do == "keep" else []
        except LogError as error:
            return [], "lost", f"line {number + 1}: {error}"
        return cells, do, why

    def _hides_rows(self, inner: list[str], record: str) -> bool:
        """Whether lines inside a quoted cell are rows themselves, or the cell makes no row."""
        layout = self.layout
        if len(split(record, layout.delimiter, layout.quote)) != layout.columns:
            return True
        rows = [split(line, layout.delimiter, "") for line in inner]
        return layout.columns > 1 and any(
            len(row) == layout.columns and numeric_share(row, layout.decimal) >= 0.5 for row in rows
        )

    def _decoded(self, line: bytes) -> str:
        return line.decode(self.text.codec_of_block, errors="replace").rstrip("\r\n")

    def _is_comment(self, line: str) -> bool:
        return bool(self.layout.comment) and line.lstrip().startswith(self.layout.comment or "")

    def verdict(self, line: str, number: int) -> _Verdict:
        """What to do with a line (its number from 0), and why; a line kept in part comes in place of why."""
        layout = self.layout
        if not line.strip(BLANKS):
            return "blank", ""
        if "\0" in line:
            return "lost", f"line {number + 1} holds zero bytes, which were never written"
        cells = split(line, layout.delimiter, layout.quote)
        if self._is_comment(line):
            return self._comment(cells, number)
        if layout.comment and layout.comment in line:
            part = line.partition(layout.comment)[0]
            whole = part.count(layout.quote or '"') % 2 == 0
            if whole and len(split(part, layout.delimiter, layout.quote)) == layout.columns:
                return "keep", part
        if len(cells) != layout.columns:
            why = "a lost cell would shift the numbers behind it into other columns"
            if layout.quote and line.count(layout.quote) % 2:
                why = "a quotation mark in it is never closed, or stands inside a cell"
            return "lost", f"line {number + 1} has {len(cells)} cells, the others {layout.columns}; {why}"
        if not any(cells):
            return "empty", ""
        repeats = [_plain(cell) for cell in cells] == [_plain(name) for name in layout.headers]
        return ("names", str(number + 1)) if repeats else ("keep", "")

    def _comment(self, cells: list[str], number: int) -> _Verdict:
        """What a comment hides."""
        layout, mark = self.layout, self.layout.comment or ""
        if len(cells) != layout.columns or numeric_share(cells[1:], layout.decimal) < 0.5:
            return "comment", ""
        if is_number(cells[0].lstrip(mark).strip(), layout.decimal):
            return "hidden", ""
        return "lost", (
            f"line {number + 1} begins with {shown(cells[0], 30)!r}, which reads like a comment, "
            "but a row of numbers follows: a sample would be lost unseen"
        )

    def _left_out(self, do: str, why: str, content: bytes, begin: int, end: int, *, before: int) -> None:
        """Note a line that is no row, before which `before` rows were kept."""
        if do in {"hidden", "empty", "lost", "names"}:
            self.found.missing_before.append(before)
        if do == "names":
            self.named.append(int(why))
        self.hidden += do == "hidden"
        self.empty += do == "empty"
        if do != "lost":
            return
        start = self.place.byte + self.text.size_of(content[:begin])
        self.found.losses.append(Loss(start, start + self.text.size_of(content[begin:end]), why))
        if len(self.found.losses) > _MOST_LOSSES:
            raise LogError(
                f"{self.found.losses[0].why}. So do over {_MOST_LOSSES - 1} more lines: is it a table?"
            )

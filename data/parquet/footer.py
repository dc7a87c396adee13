"""What a Parquet file says of itself, at its end: rows, row groups, and where each column's pages lie.

Read here rather than through pyarrow, whose look at a row group ends the whole process where its statistics
contradict themselves; pyarrow only unpacks what has been looked through.

Source: Apache Parquet format 2.10, parquet.thrift.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from data.findings import LogError
from data.parquet.thrift import Reader, Struct, ThriftError, Value

MAGIC: Final = b"PAR1"
_TAIL: Final = 8  # the footer's length and the magic
_LARGEST: Final = 1 << 26  # [bytes]


@dataclass(frozen=True)
class ColumnPages:
    """Where the pages of one column of one row group lie."""

    path: tuple[str, ...]  # of names, from the outside in
    begin: int
    size: int  # [bytes]


@dataclass(frozen=True)
class RowGroup:
    """One row group."""

    rows: int
    columns: tuple[ColumnPages, ...]

    def span(self, size: int) -> tuple[int, int]:
        """Its first byte and the one past its last, as far as they lie in a file of `size` bytes."""
        begins = [min(max(column.begin, 0), size) for column in self.columns]
        ends = [min(max(column.begin + column.size, 0), size) for column in self.columns]
        begin = min(begins, default=0)
        return begin, max(begin, max(ends, default=0))


@dataclass(frozen=True)
class Footer:
    """The whole of it."""

    rows: int
    groups: tuple[RowGroup, ...]
    writer: str


def read_footer(content: memoryview) -> Footer:
    """The footer of a file.

    Raises
    ------
    LogError
        When the file does not begin and end as a Parquet file does, or its footer cannot be right.
    """
    size = len(content)
    if bytes(content[:4]) != MAGIC:
        raise LogError("it does not begin as a Parquet file does: nothing in it can be read")
    if size < len(MAGIC) + _TAIL or bytes(content[-4:]) != MAGIC:
        raise LogError(
            "it stops before its footer, without which a Parquet file cannot be read: the recording was cut "
            "off, and nothing in it can be saved. Record it again or exclude it"
        )
    (length,) = struct.unpack_from("<I", content, size - _TAIL)
    begin = size - _TAIL - length
    if begin < len(MAGIC) or length > _LARGEST:
        raise LogError(
            f"its footer claims {length} bytes of {size}: the file is damaged, nothing can be read"
        )
    try:
        said = Reader(content[begin : size - _TAIL]).struct()
        groups = tuple(_group(_struct(group)) for group in _list(said.get(4)))
        rows = _integer(said.get(3))
    except ThriftError as error:
        raise LogError(f"its footer, from byte {begin} on, cannot be right: {error}") from error
    if rows != sum(group.rows for group in groups) or any(group.rows < 0 for group in groups):
        raise LogError(f"its footer tells {rows} rows, its row groups others: the file is damaged")
    writer = said.get(6)
    return Footer(rows, groups, writer.decode(errors="replace") if isinstance(writer, bytes) else "")


def _group(said: Struct) -> RowGroup:
    columns = tuple(_pages(_struct(_struct(column).get(3))) for column in _list(said.get(1)))
    return RowGroup(_integer(said.get(3)), columns)


def _pages(said: Struct) -> ColumnPages:
    """Of a column's metadata: a dictionary's page, where there is one, stands before the others, if any."""
    begin, dictionary = _integer(said.get(9)), said.get(11)
    if isinstance(dictionary, int) and dictionary > 0 and (begin == 0 or dictionary < begin):
        begin = dictionary
    path = tuple(part.decode(errors="replace") for part in _list(said.get(3)) if isinstance(part, bytes))
    return ColumnPages(path, begin, _integer(said.get(7)))


def _struct(value: Value) -> Struct:
    if not isinstance(value, dict):
        raise ThriftError("a struct is missing")
    return value


def _list(value: Value) -> list[Value]:
    if not isinstance(value, list):
        raise ThriftError("a list is missing")
    return value


def _integer(value: Value) -> int:
    if not isinstance(value, int):
        raise ThriftError("a number is missing")
    return value

"""The pages of a Parquet file, looked through before anything is unpacked.

A column's values of one row group lie in pages one behind the other, each behind a header that tells its
size, its size unpacked, how many values it holds and, where the writer gave one, the CRC-32 of its bytes. All
of that is a claim of a file from outside: it is held against the bytes that there are, the checksums are
computed, and a page that would unpack to far more than a rig could have written is refused before it takes
any memory.

Source: Apache Parquet format 2.10, parquet.thrift.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Final

from data.parquet.thrift import Reader, ThriftError
from data.unpacking import over_limit

_LONGEST_HEADER: Final = 1 << 20  # [bytes]
_UNPACKED, _PACKED, _CRC, _DATA, _DATA_2 = 2, 3, 4, 5, 8  # fields of a page's header
_COUNT: Final = 1  # field of a data page's own header


class PageError(Exception):
    """A page that cannot be right: the byte, and why."""

    def __init__(self, place: int, why: str) -> None:
        super().__init__(why)
        self.place = place


@dataclass(frozen=True)
class Pages:
    """What was found of one column's pages in one row group."""

    values: int
    checked: int  # pages whose checksum was right
    unchecked: int  # pages without one
    unpacked: int  # [bytes] as the headers claim


def look_through(content: memoryview, begin: int, size: int) -> Pages:
    """Walk the pages that fill `size` bytes from `begin`; raises PageError where they cannot be right."""
    here, end = begin, begin + size
    if begin < 0 or size < 0 or end > len(content):
        raise PageError(max(begin, 0), f"a column of {size} bytes reaches past the end of the file")
    values = checked = unchecked = unpacked = 0
    while here < end:
        reader = Reader(content[: min(end, here + _LONGEST_HEADER)], here)
        try:
            header = reader.struct()
        except ThriftError as error:
            raise PageError(here, f"what stands there is no page's header: {error}") from error
        body = reader.here
        packed, full = header.get(_PACKED, -1), header.get(_UNPACKED, -1)
        if not isinstance(packed, int) or not isinstance(full, int) or packed < 0 or full < 0:
            raise PageError(here, "a page's header tells no sizes")
        if packed > end - body:
            raise PageError(here, f"a page of {packed} bytes reaches past the end of its column")
        if over_limit(full, packed):
            raise PageError(here, f"a page of {packed} bytes claims to unpack to {full}: no log does")
        crc = header.get(_CRC)
        if isinstance(crc, int):
            if zlib.crc32(content[body : body + packed]) != crc % 2**32:
                raise PageError(here, "a page's checksum is wrong")
            checked += 1
        else:
            unchecked += 1
        own = header.get(_DATA, header.get(_DATA_2))
        count = own.get(_COUNT, 0) if isinstance(own, dict) else 0
        values += count if isinstance(count, int) else 0
        unpacked += full
        here = body + packed
    return Pages(values, checked, unchecked, unpacked)

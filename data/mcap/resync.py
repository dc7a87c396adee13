"""Finding the way again in a damaged MCAP file.

After a place that cannot be read, the next byte that may be taken for the beginning of a record is sought
(see `credible`). All candidates of a piece are sifted at once by opcode, length, and for messages by channel
and times; those that are left are looked at one by one, and only so many of them in one file, since a file
can be made of nothing else. Messages, schemas and channels are only sought in files that keep them outside
chunks: within a damaged chunk that is not compressed nothing vouches for them.

A recording whose first chunk is lost has lost the declarations of its channels with it; the summary repeats
them, and is believed when its checksum holds.
"""

from __future__ import annotations

import zlib
from contextlib import suppress
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from data.mcap.chunks import extent, read_head
from data.mcap.container import MAGIC
from data.mcap.credible import LEAST, Surroundings, follows
from data.mcap.declarations import Declarations
from data.mcap.fields import Fields, read_channel, read_metadata, read_schema
from data.mcap.limits import MOST_METADATA
from data.mcap.records import HEADER, ByteArray, Damage, tile

_CHUNKED: Final = (
    Opcode.CHUNK,
    Opcode.METADATA,
    Opcode.ATTACHMENT,
    Opcode.DATA_END,
    Opcode.STATISTICS,
    Opcode.FOOTER,
)
_OF_CHUNKS: Final = (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX)
_LOOSE: Final = (*_CHUNKED, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
_PARTS: Final[dict[int, tuple[int, ...]]] = {
    Opcode.HEADER: (0, 0),
    Opcode.CHUNK_INDEX: (8, 8, 8, 8, 0, 8, 0, 8, 8),
    Opcode.ATTACHMENT: (8, 8, 0, 0),
    Opcode.ATTACHMENT_INDEX: (8, 8, 8, 8, 8, 0, 0),
    Opcode.METADATA_INDEX: (8, 8, 0),
    Opcode.SUMMARY_OFFSET: (1, 8, 8),
    Opcode.DATA_END: (4,),
}  # bytes in the fields of records, 0: behind a length of their own
_FOOTER_CONTENT: Final = 20
_FIRST_PIECE: Final = 1 << 14
_LARGEST_PIECE: Final = 1 << 19
_MOST_LOOKS: Final = 50_000  # candidates of one file that are looked at one by one


class Seeker:
    """Seeks records in one file's bytes."""

    def __init__(self, content: ByteArray) -> None:
        self._content = content
        self._looks = 0
        self._chunked: bool | None = None

    def chunked(self) -> bool:
        """Whether there is a chunk anywhere in the file, or an index of one."""
        if self._chunked is None:
            nothing = Surroundings(np.zeros(1 << 16, np.bool_), (0, 0), (0, 0))
            self._chunked = self._next(len(MAGIC), nothing, _OF_CHUNKS) is not None
        return self._chunked

    def next_record(self, after: int, near: Surroundings, *, loose: bool) -> int | None:
        """Where the next credible record begins, messages among them if `loose`; None: there is none."""
        return self._next(after, near, _LOOSE if loose else _CHUNKED)

    def _next(self, after: int, near: Surroundings, opcodes: tuple[int, ...]) -> int | None:
        sought = np.zeros(256, np.bool_)
        sought[list(opcodes)] = True
        last, piece = self._content.size - HEADER.size, _FIRST_PIECE
        here = after
        while here < last:
            stop = min(here + piece, last)
            for place in self._sift(here, stop, near, sought):
                self._looks += 1
                if self._looks > _MOST_LOOKS:
                    return None
                if self._credible(place, near):
                    return place
            here, piece = stop, min(2 * piece, _LARGEST_PIECE)
        return None

    def _sift(self, begin: int, end: int, near: Surroundings, sought: NDArray[np.bool_]) -> list[int]:
        """Places in [begin, end) whose opcode is sought and whose length fits."""
        content = self._content
        piece = content[begin:end]
        places = begin + np.flatnonzero(sought[piece])
        length = self._numbers("<u8", 1)[places]
        left = (content.size - HEADER.size - places).astype(np.uint64)
        places = places[(length <= left) & (length >= _LEAST[content[places]])]
        loose = content[places] == Opcode.MESSAGE
        if not loose.any():
            return places.tolist()
        mine = places[loose]  # their prefix lies within the file, since their length does
        channel = self._numbers("<u2", HEADER.size)[mine]
        log, publish = (self._numbers("<u8", HEADER.size + offset)[mine] for offset in (6, 14))
        fits = near.declared[channel] & _between(log, near.log)
        fits &= _between(publish, near.publish) | (publish == 0)
        kept: list[int] = np.sort(np.concatenate((places[~loose], mine[fits]))).tolist()
        return kept

    def _numbers(self, kind: str, offset: int) -> NDArray[np.uint64]:
        """The number of that kind `offset` bytes behind every byte of the file."""
        shape = (max(self._content.size - offset - np.dtype(kind).itemsize + 1, 0),)
        return np.ndarray(shape, kind, self._content.data, offset, (1,))

    def _credible(self, here: int, near: Surroundings) -> bool:
        """Whether the record at `here`, whose length fits, is one."""
        content = self._content
        opcode, length = HEADER.unpack_from(content.data, here)
        begin = here + HEADER.size
        end = begin + length
        if opcode == Opcode.CHUNK:
            head = extent(content, here)
            return head is not None and head.starts_as_it_says(content)
        if opcode == Opcode.FOOTER:
            return length == _FOOTER_CONTENT and content[end : end + len(MAGIC)].tobytes() == MAGIC
        if not follows(content, end, near):
            return False
        if opcode == Opcode.MESSAGE_INDEX and length == LEAST[opcode]:
            return False  # of nothing
        return opcode == Opcode.MESSAGE or exact(content, opcode, begin, end)


def disguised(content: ByteArray, begin: int, end: int) -> bool:
    """Whether a record's content [begin, end) is a chunk's, whatever its opcode says."""
    try:
        head = read_head(content, begin, end)
    except Damage:
        return False
    return head.end == end and head.credible and head.checksum != 0 and head.starts_as_it_says(content)


def exact(content: ByteArray, opcode: int, begin: int, end: int) -> bool:
    """Whether the lengths within a record's content [begin, end) add up to its own."""
    raw = content[begin:end].data
    if len(raw) < LEAST.get(opcode, len(raw) + 1):
        return False
    if opcode == Opcode.STATISTICS:
        return len(raw) == LEAST[opcode] + int.from_bytes(raw[42:46], "little")
    if opcode == Opcode.MESSAGE_INDEX:
        size = int.from_bytes(raw[2:6], "little")
        return len(raw) == LEAST[opcode] + size and size % 16 == 0  # pairs of a time and an offset
    fields = Fields(raw, where=begin, record="")
    try:
        if opcode == Opcode.SCHEMA:
            return read_schema(raw, where=begin)[1] == len(raw)
        if opcode == Opcode.CHANNEL:
            return read_channel(raw, where=begin)[1] == len(raw)
        if opcode == Opcode.METADATA:
            return read_metadata(raw, where=begin, most=MOST_METADATA)[1] == len(raw)
        if opcode not in _PARTS:
            return False
        for size in _PARTS[opcode]:
            if size:
                fields.number(size)
            else:
                fields.raw(len(raw))
        if opcode == Opcode.ATTACHMENT:
            return fields.number(8) + 4 == fields.left
    except Damage:
        return False
    return not fields.left


def _between(times: NDArray[np.uint64], span: tuple[int, int]) -> NDArray[np.bool_]:
    return (times >= np.uint64(max(span[0], 0))) & (times <= np.uint64(max(span[1], 0)))


def _least() -> NDArray[np.uint64]:
    least = np.zeros(256, np.uint64)
    for opcode, length in LEAST.items():
        least[opcode] = length
    return least


_LEAST: Final = _least()


def summary_declarations(content: ByteArray) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """The schemas and channels that the summary repeats; nothing where its checksum does not hold."""
    declared = Declarations()
    begin = content.size - len(MAGIC) - _FOOTER_CONTENT
    if begin >= HEADER.size:
        start = int.from_bytes(content[begin : begin + 8].tobytes(), "little")
        stored = int.from_bytes(content[begin + 16 : begin + 20].tobytes(), "little")
        if 0 < start < begin and stored and zlib.crc32(content[start : begin + 16].data) == stored:
            summary = content[start : begin - HEADER.size]
            with suppress(Damage):
                declared.take(summary, tile(summary))
    return declared.schemas, declared.channels

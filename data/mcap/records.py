"""MCAP records found in bytes that nobody vouches for.

A record is one byte of opcode, eight of length, then the content. Every length is checked against the bytes
that are there before anything is read or allocated. `tile` finds the records of a block (a chunk's content,
or a stretch of a file without chunks): it steps from record to record.

`parse` hands a record's content to mcap's own parser, bounded to that content: whatever goes wrong inside
becomes a `Damage` with the place. Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass, fields
from io import BytesIO
from typing import Any, Final, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from numpy.typing import NDArray

from data.mcap.limits import CHUNK_RECORDS

ByteArray = NDArray[np.uint8]
Record = TypeVar("Record")
HEADER: Final = struct.Struct("<BQ")
MESSAGE_PREFIX: Final = 22  # channel, sequence, log time, publish time
_PREFIX: Final = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<i8"), ("publish", "<i8")])
_ALIKE: Final = 16  # records of one opcode in a row, after which more are sought at once
_FIRST_LOOK: Final = 64  # records
_LONGEST_LOOK: Final = 1 << 16  # records
_WINDOW: Final = 1 << 16  # [bytes]


class Damage(Exception):  # noqa: N818  # what is found, not what went wrong in the program
    """A place in a file that contradicts the format. Caught within the reader, never shown as it is."""

    def __init__(self, where: int, why: str, *, resume: int | None = None) -> None:
        super().__init__(why)
        self.where = where  # [bytes] from the start of the file or block
        self.why = why
        self.resume = resume  # where reading can surely go on; None: it has to be sought


@dataclass(frozen=True)
class Tiling:
    """The records of a block, in order; all arrays are (n,)."""

    opcode: NDArray[np.uint8]
    begin: NDArray[np.int64]  # where the content starts in the block
    length: NDArray[np.int64]  # of the content
    end: int  # where the last record ends


@dataclass(frozen=True)
class Messages:
    """The messages of a block: their prefix, and where their own bytes are; all arrays are (n,)."""

    channel: NDArray[np.uint16]
    log_time: NDArray[np.int64]  # [ns]
    publish_time: NDArray[np.int64]  # [ns]
    sequence: NDArray[np.uint32]
    begin: NDArray[np.int64]
    length: NDArray[np.int64]

    def of(self, channel: int) -> Messages:
        """Those on one channel."""
        mine = self.channel == channel
        return self if mine.all() else self.where(mine)

    def where(self, kept: NDArray[np.bool_]) -> Messages:
        """Those that are kept (n,)."""
        return Messages(**{part.name: getattr(self, part.name)[kept] for part in fields(self)})


class _Exact(BytesIO):
    """Bytes that refuse to give fewer than were asked for."""

    def read(self, size: int | None = -1, /) -> bytes:
        """`size` bytes, or EOFError."""
        raw = super().read(size)
        if size is not None and size >= 0 and len(raw) < size:
            raise EOFError(f"{size} bytes are promised, {len(raw)} are left")
        return raw


def parse(reader: Callable[[ReadDataStream], Record], content: bytes, *, where: int, name: str) -> Record:
    """A record from its content, by mcap's own parser, which cannot read past it.

    Raises
    ------
    Damage
        When the content contradicts itself.
    """
    try:
        return reader(ReadDataStream(_Exact(content)))
    except (McapError, ValueError, EOFError, struct.error, OverflowError, MemoryError) as error:
        raise Damage(where, f"the {name} record there contradicts itself ({error})") from error


def tile(
    block: ByteArray, *, begin: int = 0, within: frozenset[int] | None = None, compiled: bool = False
) -> Tiling:
    """Find the records of a block, from `begin` on, by `compiled` code or without loading any.

    With `within`, stop at the first record that is damaged or whose opcode is not among these.

    Raises
    ------
    Damage
        Without `within`, when a record does not fit into what is left, has opcode 0, or there are too many.
    """
    among = np.zeros(256, np.bool_)
    among[list(within) if within is not None else range(1, 256)] = True
    tiling = (_scanned if compiled else _stepped)(block, begin, among)
    if within is None and tiling.end < block.size:
        why, _, _ = look(block.data, tiling.end, block.size)
        raise Damage(tiling.end, why or f"more than {CHUNK_RECORDS} records in one chunk")
    return tiling


def _scanned(block: ByteArray, begin: int, among: NDArray[np.bool_]) -> Tiling:
    """As `_stepped`, compiled."""
    from data.mcap.scan import scan  # noqa: PLC0415  # numba takes long to load

    most = min((block.size - begin) // HEADER.size, CHUNK_RECORDS)  # what is never written costs nothing
    opcode, start, length = np.empty(most, np.uint8), np.empty(most, np.int64), np.empty(most, np.int64)
    count, end = scan(block, begin, among, opcode, start, length)
    return Tiling(opcode[:count], start[:count], length[:count], end)


def _stepped(block: ByteArray, begin: int, among: NDArray[np.bool_]) -> Tiling:
    """Step from record to record; after some of one opcode in a row, over many at once."""
    raw, last, allowed, unpack = block.data, block.size - HEADER.size, among.tolist(), HEADER.unpack_from
    opcodes, lengths = bytearray(), array("q")
    here, alike, before, patience = begin, 0, -1, _ALIKE
    while here <= last and len(opcodes) < CHUNK_RECORDS:
        opcode, length = unpack(raw, here)
        if not allowed[opcode] or length > last - here:
            break
        opcodes.append(opcode)
        lengths.append(length)
        here += HEADER.size + length
        alike, before = (alike + 1 if opcode == before else 0), opcode
        if alike >= patience:
            more = _more(block, here, opcode, length, most=CHUNK_RECORDS - len(opcodes))
            opcodes += bytes((opcode,)) * more.size
            lengths.frombytes(more.tobytes())
            here += int(more.sum()) + HEADER.size * more.size
            alike, patience = (alike, _ALIKE) if more.size >= patience else (0, 2 * patience)
    length_of = np.frombuffer(lengths, np.int64)
    ends = begin + np.cumsum(length_of + HEADER.size)
    return Tiling(np.frombuffer(opcodes, np.uint8), ends - length_of, length_of, here)


def _more(block: ByteArray, here: int, opcode: int, length: int, *, most: int) -> NDArray[np.int64]:
    """The lengths of some records of one opcode from `here` on: of one length, or of any."""
    alike = _alike(block, here, opcode, length, most=most)
    return np.full(alike, length, np.int64) if alike else _chained(block, here, opcode)[:most]


def _alike(block: ByteArray, here: int, opcode: int, length: int, *, most: int) -> int:
    """How many records of one opcode and length there are from `here` on, which all fit."""
    stride = HEADER.size + length
    fit, found, step = min((block.size - here) // stride, most), 0, _FIRST_LOOK
    header = np.frombuffer(HEADER.pack(opcode, length), np.uint8)
    while found < fit:
        step = min(step, fit - found)
        rows = np.ndarray((step, HEADER.size), np.uint8, block, here + found * stride, (stride, 1))
        same = (rows == header).all(axis=1)
        if not same.all():
            return found + int(np.argmin(same))
        found, step = found + step, min(2 * step, _LONGEST_LOOK)
    return found


def _chained(block: ByteArray, here: int, opcode: int) -> NDArray[np.int64]:
    """The lengths of records from `here` on, each of which begins where the one before it ends, and fits."""
    window = block[here : min(here + _WINDOW, block.size - HEADER.size + 1)]
    start = here + np.flatnonzero(window == opcode)
    length = np.ndarray((block.size - HEADER.size + 1,), "<u8", block, 1, (1,))[start]
    fits = length <= (block.size - HEADER.size - start).astype(np.uint64)
    start, length = start[fits], length[fits].astype(np.int64)
    if not start.size or start[0] != here:
        return length[:0]
    linked = start[1:] == start[:-1] + HEADER.size + length[:-1]
    return length if linked.all() else length[: int(np.argmin(linked)) + 1]


def look(raw: memoryview, here: int, size: int) -> tuple[str, int, int]:
    """What is wrong with the record at `here` (empty: nothing), its opcode and length."""
    left = size - here - HEADER.size
    if left < 0:
        return f"cut off within a record: {size - here} bytes are left", 0, 0
    opcode, length = HEADER.unpack_from(raw, here)
    if opcode == 0:
        return "a record with opcode 0", 0, 0
    if length > left:
        return f"a record (opcode {opcode}) claims {length} bytes, {left} are left", opcode, length
    return "", opcode, length


def messages(block: ByteArray, tiling: Tiling, *, compiled: bool) -> Messages:
    """The messages among a block's records; by `compiled` code or without.

    Raises
    ------
    Damage
        When a message is shorter than its prefix, or a stamp lies past the year 2262.
    """
    mine = tiling.opcode == Opcode.MESSAGE
    begin, length = (tiling.begin, tiling.length) if mine.all() else (tiling.begin[mine], tiling.length[mine])
    if np.any(length < MESSAGE_PREFIX):
        raise Damage(int(begin[length < MESSAGE_PREFIX][0]), "a message is shorter than its own prefix")
    channel, sequence, log, publish = (_prefixes if compiled else _gathered)(block, begin)
    for name, stamp in (("log", log), ("publish", publish)):
        if np.any(stamp < 0):  # as an unsigned number, above 2^63 ns
            raise Damage(int(begin[stamp < 0][0]), f"a message's {name} time is past 2262")
    return Messages(
        channel=channel,
        log_time=log,
        publish_time=publish,
        sequence=sequence,
        begin=begin + MESSAGE_PREFIX,
        length=length - MESSAGE_PREFIX,
    )


def _prefixes(block: ByteArray, begin: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
    """Channel, sequence, log and publish time (n,) of the messages at `begin` (n,), compiled."""
    from data.mcap.scan import prefixes  # noqa: PLC0415  # numba takes long to load

    found = tuple(np.empty(begin.size, _PREFIX[name]) for name in _PREFIX.fields or ())
    prefixes(block, begin, *found)
    return found


def _gathered(block: ByteArray, begin: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
    """As `_prefixes`, with whole arrays."""
    prefix = gather(block, begin, MESSAGE_PREFIX).view(_PREFIX).reshape(-1)
    return tuple(np.ascontiguousarray(prefix[name]) for name in _PREFIX.fields or ())


def gather(block: ByteArray, begin: NDArray[np.int64], size: int) -> ByteArray:
    """Rows (n, size) of `size` bytes from each of the offsets `begin` (n,); a view where these are even."""
    if not begin.size:
        return np.empty((0, size), np.uint8)
    if begin.size > 1:
        stride = int(begin[1] - begin[0])
        if stride > 0 and np.all(np.diff(begin) == stride):
            return np.ndarray((begin.size, size), np.uint8, block, int(begin[0]), (stride, 1))
    return np.ndarray((block.size - size + 1, size), np.uint8, block, 0, (1, 1))[begin]

"""MCAP records found in bytes that nobody vouches for.

A record is one byte of opcode, eight of length, then the content. Every length is checked against the bytes
that are there before anything is read or allocated. `tile` finds the records of a block (a chunk's content,
or a stretch of a file without chunks): it steps from record to record.

`parse` hands a record's content to mcap's own parser, bounded to that content: whatever goes wrong inside
becomes a `Damage` with the place. Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Final, TypeVar

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
_PREFIX: Final = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")])
_SMALL: Final = 1 << 20  # [bytes] that are stepped through without compiled code
_FEW: Final = 256  # records that compiled code is not worth
_LATEST: Final = np.iinfo(np.int64).max


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
    block: ByteArray, *, begin: int = 0, within: frozenset[int] | None = None, large: bool = False
) -> Tiling:
    """Find the records of a block, from `begin` on; compiled where it, or the file that it is of, is `large`.

    With `within`, stop at the first record that is damaged or whose opcode is not among these.

    Raises
    ------
    Damage
        Without `within`, when a record does not fit into what is left, has opcode 0, or there are too many.
    """
    among = np.zeros(256, np.bool_)
    among[list(within) if within is not None else range(1, 256)] = True
    if large:
        tiling = _scanned(block, begin, among, whole=within is None)
    else:
        few = _FEW if block.size - begin > _SMALL else CHUNK_RECORDS
        tiling = _stepped(block, begin, among, few)
        if tiling.opcode.size == few:
            tiling = _scanned(block, begin, among, whole=within is None)
    if within is None and tiling.end < block.size:
        why, _, _ = look(block.data, tiling.end, block.size)
        raise Damage(tiling.end, why or f"more than {CHUNK_RECORDS} records in one chunk")
    return tiling


def _scanned(block: ByteArray, begin: int, among: NDArray[np.bool_], *, whole: bool) -> Tiling:
    """As `_stepped`; where the `whole` block has to be records and is not, none but the place is told."""
    from data.mcap.scan import scan  # noqa: PLC0415  # numba takes long to load

    def pass_over(count: int) -> tuple[Tiling, int]:
        found = Tiling(np.empty(count, np.uint8), np.empty(count, np.int64), np.empty(count, np.int64), 0)
        seen, end = scan(block, begin, among, CHUNK_RECORDS, found.opcode, found.begin, found.length)
        return replace(found, end=end), seen

    nothing, count = pass_over(0)
    return nothing if whole and nothing.end < block.size else pass_over(count)[0]


def _stepped(block: ByteArray, begin: int, among: NDArray[np.bool_], most: int) -> Tiling:
    raw, size, allowed = block.data, block.size, among.tolist()
    opcodes = bytearray()
    begins: list[int] = []
    lengths: list[int] = []
    here = begin
    while here < size and len(begins) < most:
        why, opcode, length = look(raw, here, size)
        if why or not allowed[opcode]:
            break
        opcodes.append(opcode)
        begins.append(here + HEADER.size)
        lengths.append(length)
        here += HEADER.size + length
    return Tiling(
        np.frombuffer(bytes(opcodes), np.uint8), np.array(begins, np.int64), np.array(lengths, np.int64), here
    )


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


def messages(block: ByteArray, tiling: Tiling) -> Messages:
    """The messages among a block's records.

    Raises
    ------
    Damage
        When a message is shorter than its prefix, or a stamp lies past the year 2262.
    """
    mine = tiling.opcode == Opcode.MESSAGE
    begin, length = tiling.begin[mine], tiling.length[mine]
    if np.any(length < MESSAGE_PREFIX):
        raise Damage(int(begin[length < MESSAGE_PREFIX][0]), "a message is shorter than its own prefix")
    prefix = gather(block, begin, MESSAGE_PREFIX).view(_PREFIX).reshape(-1)
    for stamp in ("log", "publish"):
        if np.any(prefix[stamp] > _LATEST):
            raise Damage(int(begin[prefix[stamp] > _LATEST][0]), f"a message's {stamp} time is past 2262")
    return Messages(
        channel=prefix["channel"],
        log_time=prefix["log"].astype(np.int64),
        publish_time=prefix["publish"].astype(np.int64),
        sequence=prefix["sequence"],
        begin=begin + MESSAGE_PREFIX,
        length=length - MESSAGE_PREFIX,
    )


def gather(block: ByteArray, begin: NDArray[np.int64], size: int) -> ByteArray:
    """Rows (n, size) of `size` bytes from each of the offsets `begin` (n,); a view where these are even."""
    if not begin.size:
        return np.empty((0, size), np.uint8)
    if begin.size > 1:
        stride = int(begin[1] - begin[0])
        if stride > 0 and np.all(np.diff(begin) == stride):
            return np.ndarray((begin.size, size), np.uint8, block, int(begin[0]), (stride, 1))
    return np.ndarray((block.size - size + 1, size), np.uint8, block, 0, (1, 1))[begin]

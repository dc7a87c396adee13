"""MCAP records found in bytes that nobody vouches for.

A record is one byte of opcode, eight of length, then the content. Every length is checked against the bytes
that are there before anything is read or allocated. `tile` finds the records of a block (a chunk's content,
or a stretch of a file without chunks): it steps from record to record, and where they repeat, as the messages
of a steady rig do, proves whole runs at once by comparing every record's header with the one a period
before.

`parse` hands a record's content to mcap's own parser, bounded to that content: whatever goes wrong inside
becomes a `Damage` with the place. Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from typing import Final, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]
Record = TypeVar("Record")
HEADER: Final = struct.Struct("<BQ")
MESSAGE_PREFIX: Final = 22  # channel, sequence, log time, publish time
_PREFIX: Final = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")])
_LONGEST_PERIOD: Final = 4  # topics that take turns
_MOST_RECORDS: Final = 4_000_000  # in one block
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


def tile(block: ByteArray, *, begin: int = 0, within: frozenset[int] | None = None) -> Tiling:
    """Find the records of a block, from `begin` on.

    With `within`, stop at the first record that is damaged or whose opcode is not among these.

    Raises
    ------
    Damage
        Without `within`, when a record does not fit into what is left, has opcode 0, or there are too many.
    """
    raw, size = block.data, block.size
    runs: list[tuple[list[int], list[int], int]] = []  # opcodes and lengths, and how often they are repeated
    opcodes: list[int] = []
    lengths: list[int] = []
    total, here = 0, begin
    while here < size:
        why, opcode, length = look(raw, here, size)
        if within is not None and (why or opcode not in within or total >= _MOST_RECORDS):
            break
        if why or total >= _MOST_RECORDS:
            raise Damage(here, why or f"more than {_MOST_RECORDS} records in one chunk")
        opcodes.append(opcode)
        lengths.append(length)
        total += 1
        here += HEADER.size + length
        period = _period(opcodes, lengths)
        if period:
            cycle = lengths[-period:]
            stride = period * HEADER.size + sum(cycle)
            rounds = _rounds(block, here, stride=stride, lengths=cycle)
            if rounds:
                runs += [(opcodes, lengths, 1), (opcodes[-period:], cycle, rounds)]
                opcodes, lengths = [], []
                total += rounds * period
                here += rounds * stride
    runs.append((opcodes, lengths, 1))
    opcode_array = np.concatenate([np.tile(np.array(run[0], np.uint8), run[2]) for run in runs])
    length_array = np.concatenate([np.tile(np.array(run[1], np.int64), run[2]) for run in runs])
    ends = begin + np.cumsum(length_array + HEADER.size)
    return Tiling(opcode=opcode_array, begin=ends - length_array, length=length_array, end=here)


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


def _period(opcodes: list[int], lengths: list[int]) -> int:
    """How many records ago the last ones began to repeat; 0: they do not."""
    for period in range(1, min(_LONGEST_PERIOD, len(opcodes) // 2) + 1):
        if (
            lengths[-1] == lengths[-1 - period]
            and lengths[-period:] == lengths[-2 * period : -period]
            and opcodes[-period:] == opcodes[-2 * period : -period]
        ):
            return period
    return 0


def _rounds(block: ByteArray, here: int, *, stride: int, lengths: list[int]) -> int:
    """How many more rounds of the last records follow from `here`: every header byte is compared."""
    available = min((block.size - here) // stride, _MOST_RECORDS // len(lengths))
    starts = np.cumsum([0, *(HEADER.size + length for length in lengths[:-1])])
    found, step = 0, 16
    while found < available:
        count = min(step, available - found)
        first = here + found * stride
        rows = block[first : first + count * stride].reshape(count, stride)
        template = block[here - stride : here]
        same = np.ones(count, np.bool_)
        for start in starts:
            head = slice(start, start + HEADER.size)
            same &= (rows[:, head] == template[head]).all(axis=1)
        if not same.all():
            return found + int(np.argmin(same))
        found += count
        step *= 8
    return found


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
    """Rows (n, size) of `size` bytes from each of the offsets `begin` (n,)."""
    if begin.size > 1:
        stride = int(begin[1] - begin[0])
        if (
            stride >= size
            and np.all(np.diff(begin) == stride)
            and begin[0] + stride * begin.size <= block.size
        ):
            rows = block[begin[0] : begin[0] + stride * begin.size].reshape(begin.size, stride)[:, :size]
            return np.ascontiguousarray(rows)
    scattered: ByteArray = block[begin[:, None] + np.arange(size)]
    return scattered

"""A chunk's content, unpacked under a cap and checked.

A few kilobytes of zstd can claim gigabytes, and its own frame header is believed by the plain decompressor,
as is lz4's. So the size that the chunk declares is capped first, in itself and by what the file so far has
already unpacked to; then never more than that many bytes are taken from a streaming decompressor, and they
must be exactly as many. A checksum that is there is compared; an unknown compression is refused by name.

A chunk says twice how long it is: in the length of its record, and in that of its data. Where the two differ
and nothing follows where the record ends, the second decides, and the checksum proves it.
"""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import lz4.frame
import numpy as np
import zstandard

from data.mcap.limits import CHUNK_BYTES, FREE_BYTES, PACKED_RATIO
from data.mcap.records import HEADER, ByteArray, Damage
from data.names import shown

_WINDOW_CAP: Final = 32 << 20  # bytes that zstd may keep behind
_FIXED: Final = struct.Struct("<QQQII")  # first and last log time, unpacked size, checksum, length of a name
_SIZE: Final = struct.Struct("<Q")
_LONGEST_NAME: Final = 64
_EMPTY: Final = 64  # [bytes] that nothing may pack to
_PIECE: Final = 4 << 20  # bytes that lz4 gives at once
_MAGIC: Final = {"zstd": b"\x28\xb5\x2f\xfd", "lz4": b"\x04\x22\x4d\x18", "": b""}


@dataclass(frozen=True)
class ChunkHead:
    """What a chunk's record says before its data; places are bytes of the file."""

    where: int  # where the record's content begins
    time_range: tuple[int, int]  # [ns] log times
    unpacked_size: int
    checksum: int  # 0: none
    compression: str
    begin: int  # where the packed data begin
    end: int  # and end

    @property
    def credible(self) -> bool:
        """Whether times, compression and sizes agree with each other."""
        first, last = self.time_range
        if self.unpacked_size == 0 and self.end - self.begin > _EMPTY:
            return False
        if first > last or last >= 1 << 63 or self.compression not in _MAGIC:
            return False
        return self.compression != "" or self.end - self.begin == self.unpacked_size

    def starts_as_it_says(self, content: ByteArray) -> bool:
        """Whether the data begin as that compression does."""
        magic = _MAGIC.get(self.compression, b"")
        return content[self.begin : self.begin + len(magic)].tobytes() == magic


def read_head(content: ByteArray, begin: int, end: int) -> ChunkHead:
    """What a chunk says whose content begins at `begin`, and whose data may reach as far as `end`.

    Raises
    ------
    Damage
        When it does not fit there.
    """
    if begin + _FIXED.size + _SIZE.size > min(end, content.size):
        raise Damage(begin, "the chunk record there contradicts itself (it is too short)")
    first, last, size, checksum, name = _FIXED.unpack_from(content.data, begin)
    data = begin + _FIXED.size + name + _SIZE.size
    if name > _LONGEST_NAME or data > min(end, content.size):
        raise Damage(
            begin, f"the chunk record there contradicts itself (a compression's name of {name} bytes)"
        )
    (packed,) = _SIZE.unpack_from(content.data, data - _SIZE.size)
    if packed > end - data:
        raise Damage(
            begin, f"the chunk record there contradicts itself ({packed} bytes promised, {end - data} left)"
        )
    word = content[begin + _FIXED.size : data - _SIZE.size].tobytes().decode(errors="replace")
    return ChunkHead(begin, (first, last), size, checksum, word, data, data + packed)


def extent(content: ByteArray, here: int) -> ChunkHead | None:
    """The head of the chunk record at `here`, if its lengths agree with each other."""
    if here < 0 or here + HEADER.size > content.size:
        return None
    opcode, length = HEADER.unpack_from(content.data, here)
    begin = here + HEADER.size
    if opcode != 6 or length > content.size - begin:
        return None
    try:
        head = read_head(content, begin, begin + length)
    except Damage:
        return None
    return head if head.credible and head.end == begin + length else None


def unpack(content: ByteArray, head: ChunkHead, *, unpacked_before: int) -> ByteArray:
    """Decompress and check a chunk.

    Parameters
    ----------
    content
        The file.
    head
        As read from it.
    unpacked_before
        What the file's chunks have unpacked to so far [bytes].

    Raises
    ------
    Damage
        When it does not unpack to what it declares, or its checksum differs.
    """
    size, where = head.unpacked_size, head.where
    packed = content[head.begin : head.end]
    if size > CHUNK_BYTES or unpacked_before + size > FREE_BYTES + PACKED_RATIO * content.size:
        raise Damage(where, f"a chunk of {packed.size} bytes claims to unpack to {size}: over the cap")
    block = _decompress(packed, head)
    if block.size != size:
        raise Damage(where, f"a chunk unpacks to {block.size} bytes or more, it declares {size}")
    if head.checksum and zlib.crc32(block.data) != head.checksum:
        raise Damage(where, "a chunk's checksum differs from its content")
    block.flags.writeable = False  # compiled code is made for one kind of array
    return block


def _decompress(packed: ByteArray, head: ChunkHead) -> ByteArray:
    """At most one byte more than declared."""
    limit = head.unpacked_size + 1
    if head.compression == "":
        return packed[:limit]
    try:
        if head.compression == "zstd":
            return _unzstd(packed, limit)
        if head.compression == "lz4":
            return _unlz4(packed, limit)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError) as error:
        raise Damage(head.where, f"a {head.compression} chunk does not unpack ({error})") from error
    raise Damage(head.where, f"a chunk's compression {shown(head.compression, 30)!r} is none of zstd, lz4")


def _unzstd(packed: ByteArray, limit: int) -> ByteArray:
    machine = zstandard.ZstdDecompressor(max_window_size=_WINDOW_CAP)
    frame = zstandard.get_frame_parameters(packed.data)
    if frame.content_size == limit - 1 and frame.window_size <= _WINDOW_CAP:  # takes no more than declared
        with suppress(zstandard.ZstdError):  # several frames, perhaps
            return np.frombuffer(machine.decompress(packed.data, allow_extra_data=False), np.uint8)
    block, found = np.empty(limit, np.uint8), 0  # pages that are never written cost nothing
    with machine.stream_reader(packed.data, read_across_frames=True) as stream:
        while found < limit and (count := stream.readinto(block[found:].data)):
            found += count
    return block[:found]


def _unlz4(packed: ByteArray, limit: int) -> ByteArray:
    machine = lz4.frame.LZ4FrameDecompressor()
    block, found = np.empty(limit, np.uint8), 0
    piece = machine.decompress(packed.tobytes(), max_length=min(limit, _PIECE))
    while piece:
        block[found : found + len(piece)] = np.frombuffer(piece, np.uint8)
        found += len(piece)
        if found == limit or machine.eof:
            break
        piece = machine.decompress(b"", max_length=min(limit - found, _PIECE))
    if machine.unused_data:
        raise ValueError(f"{len(machine.unused_data)} bytes stand behind its end")
    return block[:found]

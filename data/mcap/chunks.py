"""A chunk's content, unpacked under a cap and checked.

A few kilobytes of zstd can claim gigabytes, and its own frame header is believed by the plain decompressor,
as is lz4's. So the size that the chunk declares is capped first, in itself and by what the file so far has
already unpacked to; then never more than that many bytes are taken from a streaming decompressor, and they
must be exactly as many. A checksum that is there is compared; an unknown compression is refused by name.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import Final

import lz4.frame
import numpy as np
import zstandard
from mcap.records import Chunk

from data.mcap.records import ByteArray, Damage
from data.names import shown

CHUNK_CAP: Final = 128 << 20  # bytes that one chunk may unpack to
_WINDOW_CAP: Final = 32 << 20  # bytes that zstd may keep behind
_FREE: Final = 256 << 20  # bytes that any file may unpack to
_RATIO: Final = 1000  # beyond which a chunk's packing is no log's


@dataclass(frozen=True)
class Unpacked:
    """A chunk's content."""

    block: ByteArray
    checked: bool  # by a checksum


def unpack(chunk: Chunk, *, where: int, unpacked_before: int, file_size: int) -> Unpacked:
    """Decompress and check a chunk.

    Parameters
    ----------
    chunk
        As parsed.
    where
        Its first byte in the file, for messages.
    unpacked_before, file_size
        What the file's chunks have unpacked to so far, and the file's size [bytes].

    Raises
    ------
    Damage
        When it does not unpack to what it declares, or its checksum differs.
    """
    size = chunk.uncompressed_size
    if size > CHUNK_CAP or unpacked_before + size > _FREE + _RATIO * file_size:
        raise Damage(where, f"a chunk of {len(chunk.data)} bytes claims to unpack to {size}: over the cap")
    raw = _decompress(chunk, where=where)
    if len(raw) != size:
        raise Damage(where, f"a chunk unpacks to {len(raw)} bytes or more, it declares {size}")
    checked = chunk.uncompressed_crc != 0
    if checked and zlib.crc32(raw) != chunk.uncompressed_crc:
        raise Damage(where, "a chunk's checksum differs from its content")
    return Unpacked(np.frombuffer(raw, np.uint8), checked)


def _decompress(chunk: Chunk, *, where: int) -> bytes:
    """At most one byte more than declared."""
    limit = chunk.uncompressed_size + 1
    if chunk.compression == "":
        return chunk.data[:limit]
    try:
        if chunk.compression == "zstd":
            machine = zstandard.ZstdDecompressor(max_window_size=_WINDOW_CAP)
            with machine.stream_reader(BytesIO(chunk.data), read_across_frames=True) as stream:
                return _read(stream, limit)
        if chunk.compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=limit))
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError) as error:
        raise Damage(where, f"a {chunk.compression} chunk does not unpack ({error})") from error
    raise Damage(where, f"a chunk's compression {shown(chunk.compression, 30)!r} is none of zstd, lz4")


def _read(stream: zstandard.ZstdDecompressionReader, limit: int) -> bytes:
    """Read until `limit` bytes or the end."""
    parts, left = [], limit
    while left > 0 and (part := stream.read(min(left, 1 << 24))):
        parts.append(part)
        left -= len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)

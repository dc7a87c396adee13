"""Finding the way again in a damaged MCAP file.

After a place that cannot be read, the next chunk is sought by the name of its compression, and believed only
when the lengths around it agree. A recording whose first chunk is lost has lost the declarations of its
channels with it; the summary repeats them, and is believed when its checksum holds.
"""

from __future__ import annotations

import struct
import zlib
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema

from data.mcap.container import MAGIC
from data.mcap.records import HEADER, ByteArray, Damage, parse, tile

_PREFIX: Final = struct.Struct("<QQQI")  # a chunk's first and last log time, unpacked size, checksum
_NAMES: Final = (b"zstd", b"lz4")
_FOOTER_CONTENT: Final = 20
_PIECE: Final = 16 << 20


def chunk_extent(content: ByteArray, here: int) -> tuple[int, tuple[int, int]] | None:
    """Where the chunk record at `here` ends, and its log times [ns], if its lengths agree with each other."""
    size = content.size
    fixed = here + HEADER.size + _PREFIX.size
    if here < 0 or fixed + 4 > size:
        return None
    opcode, length = HEADER.unpack_from(content.data, here)
    first, last, _, _ = _PREFIX.unpack_from(content.data, here + HEADER.size)
    name = int.from_bytes(content[fixed : fixed + 4].tobytes(), "little")
    packed = fixed + 4 + name
    end = here + HEADER.size + length
    if opcode != Opcode.CHUNK or name > 16 or packed + 8 > size or end > size or first > last:
        return None
    data = int.from_bytes(content[packed : packed + 8].tobytes(), "little")
    return (end, (first, last)) if packed + 8 + data <= end else None


def next_chunk(content: ByteArray, after: int) -> int | None:
    """Where the next credible chunk record begins, None if there is none."""
    marks = [len(name).to_bytes(4, "little") + name for name in _NAMES]
    before = HEADER.size + _PREFIX.size
    for start in range(after, content.size, _PIECE):
        piece = content[start : start + _PIECE + before + 64].tobytes()
        found = sorted(place for mark in marks for place in _places(piece, mark))
        for place in found:
            here = start + place - before
            if here >= after and chunk_extent(content, here) is not None:
                return here
    return None


def _places(piece: bytes, mark: bytes) -> list[int]:
    places: list[int] = []
    at = piece.find(mark)
    while at >= 0 and len(places) < 10_000:
        places.append(at)
        at = piece.find(mark, at + 1)
    return places


def summary_declarations(content: ByteArray) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """The schemas and channels that the summary repeats; nothing where its checksum does not hold."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    begin = content.size - len(MAGIC) - _FOOTER_CONTENT
    if begin < HEADER.size:
        return schemas, channels
    try:
        footer = parse(
            Footer.read,
            content[begin : begin + _FOOTER_CONTENT].tobytes(),
            where=begin,
            name="footer",
        )
        start = footer.summary_start
        held = zlib.crc32(content[start : begin + 16].data) if 0 < start < begin else None
        if held is None or not footer.summary_crc or held != footer.summary_crc:
            return schemas, channels
        summary = content[start : begin - HEADER.size]
        tiling = tile(summary)
        for k in np.flatnonzero((tiling.opcode == Opcode.SCHEMA) | (tiling.opcode == Opcode.CHANNEL)):
            raw = summary[int(tiling.begin[k]) : int(tiling.begin[k] + tiling.length[k])].tobytes()
            if tiling.opcode[k] == Opcode.SCHEMA:
                schema = parse(Schema.read, raw, where=start, name="schema")
                schemas[schema.id] = schema
            else:
                channel = parse(Channel.read, raw, where=start, name="channel")
                channels[channel.id] = channel
    except Damage:
        return {}, {}
    return schemas, channels

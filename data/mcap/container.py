"""The MCAP container, written: chunks, indexes, statistics, summary and checksums.

An MCAP file is a magic number, a row of records (one byte of opcode, eight of length, the content), and the
magic number again. Messages stand in compressed chunks, each followed by a message index; at the end a
summary repeats schemas and channels and says where each chunk is, so that a viewer can jump. This writer
takes the messages of a chunk as one block of bytes that numpy has laid out, because a Python call for each of
a million messages would cost more than everything else together; all other records are mcap's own.

Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import BinaryIO, Final, Literal

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

Compression = Literal["zstd", "lz4", "none"]
MAGIC: Final = b"\x89MCAP0\r\n"
MESSAGE_HEADER: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)  # packed, as it stands in the file: 31 bytes before the message's own
_COMPRESS: Final[dict[Compression, Callable[[bytes], bytes]]] = {
    "zstd": lambda raw: zstandard.ZstdCompressor(level=3, write_checksum=True).compress(raw),
    "lz4": lambda raw: bytes(lz4.frame.compress(raw)),
    "none": lambda raw: raw,
}


@dataclass(frozen=True)
class Indexed:
    """The messages of one channel within a chunk's block: their stamps and where they begin."""

    channel: int
    log_time: NDArray[np.int64]  # (n,) [ns]
    offset: NDArray[np.int64]  # (n,) bytes from the start of the block


class ContainerWriter:
    """Writes one MCAP file in order: `schema`, `channel`, `metadata`, each `chunk`, then `finish`."""

    def __init__(self, stream: BinaryIO, *, profile: str, compression: Compression = "zstd") -> None:
        self._stream = stream
        self._compression: Compression = compression
        self._offset = 0
        self._crc = 0
        self._schemas: list[McapRecord] = []
        self._channels: list[McapRecord] = []
        self._chunks: list[McapRecord] = []
        self._metadata: list[McapRecord] = []
        self._counts: dict[int, int] = {}
        self._times: tuple[int, int] | None = None
        self._write(MAGIC)
        self._record(Header(profile=profile, library="stribeck"))

    def _write(self, raw: bytes) -> None:
        self._stream.write(raw)
        self._crc = zlib.crc32(raw, self._crc)
        self._offset += len(raw)

    def _record(self, record: McapRecord) -> tuple[int, int]:
        """Write a record; where it begins and how long it is, header included."""
        where, raw = self._offset, _bytes(record)
        self._write(raw)
        return where, len(raw)

    def schema(self, name: str, *, encoding: str, text: str) -> int:
        """Declare a message type; its number."""
        number = len(self._schemas) + 1
        self._schemas.append(Schema(id=number, name=name, encoding=encoding, data=text.encode()))
        self._record(self._schemas[-1])
        return number

    def channel(self, topic: str, *, encoding: str, schema: int) -> int:
        """Declare a topic; its number."""
        number = len(self._channels) + 1
        channel = Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema)
        self._channels.append(channel)
        self._record(channel)
        return number

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record."""
        where, length = self._record(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=where, length=length, name=name))

    def chunk(self, block: bytes, messages: list[Indexed]) -> None:
        """Write one chunk: the message records of `block`, already in log-time order, and their index."""
        first = min(int(part.log_time.min()) for part in messages)
        last = max(int(part.log_time.max()) for part in messages)
        packed = _COMPRESS[self._compression](block)
        name = "" if self._compression == "none" else self._compression
        where, length = self._record(
            Chunk(
                compression=name,
                data=packed,
                message_start_time=first,
                message_end_time=last,
                uncompressed_crc=zlib.crc32(block),
                uncompressed_size=len(block),
            )
        )
        begin, offsets = self._offset, {}
        for part in messages:
            offsets[part.channel] = self._offset
            self._write(_message_index(part))
            self._counts[part.channel] = self._counts.get(part.channel, 0) + part.log_time.size
        self._chunks.append(
            ChunkIndex(
                message_start_time=first,
                message_end_time=last,
                chunk_start_offset=where,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=self._offset - begin,
                compression=name,
                compressed_size=len(packed),
                uncompressed_size=len(block),
            )
        )
        before = self._times or (first, last)
        self._times = (min(before[0], first), max(before[1], last))

    def finish(self) -> None:
        """Close the data section and write the summary, its offsets, the footer and the magic number."""
        self._record(DataEnd(data_section_crc=self._crc))
        begin, summary, offsets = self._offset, b"", []
        for opcode, records in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            group = b"".join(_bytes(record) for record in records)
            if group:
                place = begin + len(summary)
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(group)))
                summary += group
        offset_start = begin + len(summary)
        summary += b"".join(_bytes(offset) for offset in offsets)
        # The summary's checksum also covers the footer as far as the checksum itself.
        crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, begin, offset_start), zlib.crc32(summary))
        self._write(summary)
        self._record(Footer(summary_start=begin, summary_offset_start=offset_start, summary_crc=crc))
        self._write(MAGIC)

    def _statistics(self) -> Statistics:
        first, last = self._times or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_start_time=first,
            message_end_time=last,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    raw: bytes = builder.end()  # type: ignore[no-untyped-call]  # mcap leaves this one untyped
    return raw


def _message_index(part: Indexed) -> bytes:
    """A message index record: (log time, offset) pairs, from arrays."""
    pairs = np.column_stack((part.log_time, part.offset)).astype("<u8").tobytes()
    return struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(pairs), part.channel, len(pairs)) + pairs

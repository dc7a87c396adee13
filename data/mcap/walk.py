"""The linear walk through an MCAP file: from the first byte to the last, trusting only what it checks.

The summary at the end of a file says where things are, and is neither complete in valid files nor reliable in
damaged ones. This walk goes through the records in order instead, unpacks each chunk, and hands on blocks of
messages as bytes with the places of their records; schemas, channels, metadata and attachments are collected
on the way. Checksums are always compared. What cannot be read becomes a `Loss` and the walk goes on at the
next place that can be proved to be a chunk; whether a loss is acceptable is the caller's question.

Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Metadata, Schema, Statistics

from data.integrity import Checksums, Integrity, Loss
from data.mcap.chunks import unpack
from data.mcap.container import MAGIC
from data.mcap.records import HEADER, ByteArray, Damage, Messages, Tiling, look, messages, parse, tile
from data.mcap.resync import chunk_extent, next_chunk, summary_declarations

_LOOSE: Final = frozenset({int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE)})
_LARGE: Final = 4 << 20  # [bytes]
_MOST_LOSSES: Final = 1000  # after which the rest of a file is given up
_READERS: Final[dict[int, Callable[[ReadDataStream], Any]]] = {
    Opcode.HEADER: Header.read,
    Opcode.METADATA: Metadata.read,
    Opcode.STATISTICS: Statistics.read,
    Opcode.DATA_END: DataEnd.read,
}


@dataclass(frozen=True)
class Block:
    """A stretch of messages: a chunk's content, or a stretch of a file outside chunks."""

    where: int  # first byte in the file
    data: ByteArray
    messages: Messages


@dataclass(frozen=True)
class AttachmentLabel:
    """An attachment's label; its content stays in the file."""

    name: str
    media_type: str
    size: int  # [bytes]
    log_time: int  # [ns]
    create_time: int  # [ns]


class McapWalk:
    """One walk through the bytes of one file: iterate `blocks` to the end, then read the rest.

    `schemas` and `channels` hold all that a block needs by the time it is handed out.
    """

    def __init__(self, content: ByteArray) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: list[Metadata] = []
        self.attachments: list[AttachmentLabel] = []
        self.header = Header(profile="", library="")
        self.compressions: dict[str, int] = {}  # chunks by compression, "none" included
        self.indexed = False  # whether a summary stands at the end
        self.large = content.size > _LARGE  # worth compiled code
        self._content = content
        self._statistics: Statistics | None = None
        self._losses: list[Loss] = []
        self._notes: list[str] = []
        self._vouched = [0, 0]  # stretches of messages without a checksum, and with one
        self._unpacked = 0
        self._chunks = 0
        self._messages = 0
        self._times: tuple[int, int] | None = None
        self._summary_read = False
        self._data_ended = False

    @property
    def integrity(self) -> Integrity:
        """What is proved, once `blocks` has been exhausted."""
        without, with_one = self._vouched
        checksums: Checksums = "verified" if with_one and not without else "absent"
        return Integrity(
            checksums="failed" if self._losses else checksums,
            losses=tuple(self._losses),
            chunks=self._chunks,
            messages=self._messages,
            time_range=self._times,
            notes=tuple(self._notes),
        )

    def blocks(self) -> Iterator[Block]:
        """The file's messages, block by block, in the order of the file."""
        size = self._content.size
        if self._content[: len(MAGIC)].tobytes() != MAGIC:
            self._losses.append(Loss(0, size, "it does not begin as an MCAP file does"))
            return
        here, ended = len(MAGIC), False
        while here < size and not ended:
            try:
                block, here, ended = self._step(here)
            except Damage as damage:
                here = self._lose(here, damage)
                continue
            if block is not None:
                self._count(block.messages)
                yield block
        if not ended and not (self._losses and self._losses[-1].end == size):
            why = "it stops there: the recording was cut off"
            self._losses.append(Loss(size, size, why, behind=self._latest()))
        promised = self._statistics.message_count if self._statistics else self._messages
        if promised != self._messages and not self._losses:
            why = f"the statistics promise {promised} messages, {self._messages} were found"
            self._losses.append(Loss(0, size, why))

    def _step(self, here: int) -> tuple[Block | None, int, bool]:
        """Read what stands at `here`: its messages if any, where to go on, whether this was the end."""
        why, opcode, length = look(self._content.data, here, self._content.size)
        if why:
            raise Damage(here, why)
        begin = here + HEADER.size
        end = begin + length
        if opcode in _LOOSE:
            tiling = tile(self._content, begin=here, within=_LOOSE, large=self.large)
            try:
                block = self._block(self._content, tiling, where=here)
            except Damage as damage:
                raise Damage(here, damage.why, resume=tiling.end) from damage
            self._vouched[0] += block is not None
            return block, tiling.end, False
        if opcode == Opcode.CHUNK:
            return self._chunk(begin, end), end, False
        if opcode == Opcode.FOOTER:
            self._footer(begin, end)
            return None, end, True
        if opcode == Opcode.ATTACHMENT:
            self._attachment(begin, end)
        elif opcode in _READERS:
            self._record(opcode, begin, end)
        return None, end, False  # indexes are hints not needed here; unknown records are to be passed over

    def _chunk(self, begin: int, end: int) -> Block | None:
        chunk = parse(Chunk.read, self._content[begin:end].tobytes(), where=begin, name="chunk")
        content = unpack(chunk, where=begin, unpacked_before=self._unpacked, file_size=self._content.size)
        self._unpacked += chunk.uncompressed_size
        try:
            found = self._block(content.block, tile(content.block, large=self.large), where=begin)
        except Damage as damage:
            raise Damage(begin, f"inside a chunk, {damage.why}", resume=end) from damage
        self._chunks += 1
        self._vouched[content.checked] += 1
        name = chunk.compression or "none"
        self.compressions[name] = self.compressions.get(name, 0) + 1
        return found

    def _block(self, data: ByteArray, tiling: Tiling, *, where: int) -> Block | None:
        """Take in a block's schemas and channels; its messages, if it has any."""
        for k in np.flatnonzero((tiling.opcode == Opcode.SCHEMA) | (tiling.opcode == Opcode.CHANNEL)):
            begin = int(tiling.begin[k])
            content = data[begin : begin + int(tiling.length[k])].tobytes()
            if tiling.opcode[k] == Opcode.SCHEMA:
                self._declare(self.schemas, parse(Schema.read, content, where=where, name="schema"), where)
            else:
                self._declare(self.channels, parse(Channel.read, content, where=where, name="channel"), where)
        found = messages(data, tiling)
        if not found.channel.size:
            return None
        for number in np.unique(found.channel).tolist():
            self._require(number, where)
        return Block(where, data, found)

    @staticmethod
    def _declare(known: dict[int, Any], record: Schema | Channel, where: int) -> None:
        if known.setdefault(record.id, record) != record:
            kind = type(record).__name__.lower()
            raise Damage(where, f"{kind} {record.id} is declared twice, differently")

    def _require(self, number: int, where: int) -> None:
        """A channel with messages must have been declared, and its schema; the summary may stand in."""
        if not self._declared(number) and not self._summary_read:
            schemas, channels = summary_declarations(self._content)
            self.schemas = schemas | self.schemas
            self.channels = channels | self.channels
            self._summary_read = True
        if not self._declared(number):
            raise Damage(where, f"messages on channel {number}, which is nowhere declared with its schema")

    def _declared(self, number: int) -> bool:
        channel = self.channels.get(number)
        return channel is not None and (channel.schema_id == 0 or channel.schema_id in self.schemas)

    def _record(self, opcode: int, begin: int, end: int) -> None:
        content = self._content[begin:end].tobytes()
        record = parse(_READERS[opcode], content, where=begin, name=Opcode(opcode).name.lower())
        if isinstance(record, Header):
            self.header = record
        elif isinstance(record, Metadata):
            self.metadata.append(record)
        elif isinstance(record, Statistics):
            self._statistics = record
        elif isinstance(record, DataEnd):
            self._end_data(record, begin, end)

    def _end_data(self, record: DataEnd, begin: int, end: int) -> None:
        """Check the checksum of all that came before, where there is one."""
        self._data_ended = True
        if record.data_section_crc and not self._losses:
            before = begin - HEADER.size
            if zlib.crc32(self._content[:before].data) == record.data_section_crc:
                self._vouched = [0, 1]  # for everything that came before
            else:
                raise Damage(0, "the data section's checksum differs from its content", resume=end)

    def _attachment(self, begin: int, end: int) -> None:
        """Check an attachment and keep its label, without copying its content."""
        head = self._content[begin : min(end, begin + (1 << 16))].tobytes()

        def label(stream: ReadDataStream) -> tuple[AttachmentLabel, int]:
            log_time, create_time = stream.read8(), stream.read8()
            name, media_type = stream.read_prefixed_string(), stream.read_prefixed_string()
            size = stream.read8()
            return AttachmentLabel(name, media_type, size, log_time, create_time), stream.count

        found, offset = parse(label, head, where=begin, name="attachment")
        checksum = begin + offset + found.size
        if checksum + 4 > end:
            raise Damage(begin, f"an attachment claims {found.size} bytes, more than its record", resume=end)
        stored = int.from_bytes(self._content[checksum : checksum + 4].tobytes(), "little")
        if stored and zlib.crc32(self._content[begin:checksum].data) != stored:
            raise Damage(begin, "an attachment's checksum differs from its content", resume=end)
        self.attachments.append(found)

    def _footer(self, begin: int, end: int) -> None:
        """Check the summary's checksum and the magic number behind it."""
        size = self._content.size
        footer = parse(Footer.read, self._content[begin:end].tobytes(), where=begin, name="footer")
        self.indexed = footer.summary_start != 0
        if not self._data_ended and not self._losses:
            self._losses.append(Loss(0, begin, "the end of the data section is missing"))
        start = footer.summary_start or begin - HEADER.size
        if footer.summary_crc and (
            start > begin or zlib.crc32(self._content[start : begin + 16].data) != footer.summary_crc
        ):
            why = "the summary's checksum differs from its content"
            self._losses.append(Loss(min(start, begin), end, why))
        if self._content[end : end + len(MAGIC)].tobytes() != MAGIC:
            self._losses.append(Loss(end, size, "it does not end as an MCAP file does"))
        elif size > end + len(MAGIC):
            self._notes.append(self._behind(end + len(MAGIC)))

    def _behind(self, end: int) -> str:
        """What is to be said of bytes behind the end."""
        rest = self._content[end:]
        if rest[: len(MAGIC)].tobytes() == MAGIC:
            return (
                f"another MCAP file of {rest.size} bytes stands behind the end of the first and is not read; "
                "split them, or merge them into one"
            )
        return f"{rest.size} bytes stand behind the end and are not read"

    def _lose(self, here: int, damage: Damage) -> int:
        """Note what is lost at `here`; where to go on."""
        size = self._content.size
        extent = chunk_extent(self._content, here)
        after = damage.resume or (extent[0] if extent else None)
        if after is None and len(self._losses) < _MOST_LOSSES:
            after = next_chunk(self._content, here + 1)
        after = size if after is None else after
        begin = min(here, damage.where) if damage.resume else here
        self._losses.append(Loss(begin, after, damage.why, extent[1] if extent else None, self._latest()))
        return after

    def _latest(self) -> int | None:
        """The latest log time so far [ns]."""
        return self._times[1] if self._times else None

    def _count(self, found: Messages) -> None:
        first, last = int(found.log_time.min()), int(found.log_time.max())
        before = self._times or (first, last)
        self._times = (min(before[0], first), max(before[1], last))
        self._messages += found.channel.size

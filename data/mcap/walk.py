"""The linear walk through an MCAP file: from the first byte to the last, trusting only what it checks.

The summary at the end of a file says where things are, and is neither complete in valid files nor reliable in
damaged ones. This walk goes through the records in order instead, unpacks each chunk, and hands on blocks of
messages as bytes with the places of their records; schemas, channels, metadata and attachments are collected
on the way. Checksums are always compared. What cannot be read becomes a `Loss` and the walk goes on at the
next place that can be proved to be a record; whether a loss is acceptable is the caller's question.

A record whose length was damaged still looks like one, and swallows those behind it. So a record is believed
only where another follows it, or where its own lengths add up.

Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema, Statistics

from data.integrity import Integrity, Loss
from data.mcap.ahead import Unpacking
from data.mcap.attachments import AttachmentLabel, read_attachment
from data.mcap.chunks import extent, read_head
from data.mcap.container import MAGIC
from data.mcap.credible import LEAST, Surroundings, follows, message_begins, surroundings
from data.mcap.declarations import Declarations
from data.mcap.endings import Endings
from data.mcap.fields import Fields, read_metadata
from data.mcap.limits import (
    METADATA_BYTES,
    MOST_ATTACHMENTS,
    MOST_METADATA,
    STRETCH_BYTES,
)
from data.mcap.proofs import Proofs
from data.mcap.readable import BLOCK_OPCODES, Dropped, readable, refused
from data.mcap.records import HEADER, MESSAGE_PREFIX, ByteArray, Damage, Messages, Tiling, gather, look, tile
from data.mcap.resync import Seeker, disguised, exact, summary_declarations

_HINTS: Final = (
    Opcode.MESSAGE_INDEX,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.SUMMARY_OFFSET,
)
_UNKNOWN: Final = 16  # opcodes from here on mean nothing yet
_PASSED: Final = frozenset({*map(int, _HINTS), *range(_UNKNOWN, 256)})  # not needed here, or not known
_EMPTIEST: Final = 256  # [bytes] that a record of an empty chunk may take
_AHEAD: Final = 4 << 20  # [bytes] of a file that is worth a thread
_SMALLEST_DISGUISED: Final = MESSAGE_PREFIX  # [bytes]
_MOST_DISGUISED: Final = 10_000  # of a stretch that are looked through


@dataclass(frozen=True)
class Block:
    """A stretch of messages: a chunk's content, or a stretch of a file outside chunks."""

    where: int  # first byte in the file
    data: ByteArray
    messages: Messages


class McapWalk:
    """One walk through the bytes of one file, by `compiled` code or without loading any.

    Iterate `blocks` to the end, then read the rest.

    `schemas` and `channels` hold all that a block needs by the time it is handed out.
    """

    _unpacking: Unpacking  # while there are blocks to come

    def __init__(self, content: ByteArray, *, compiled: bool) -> None:
        self.metadata: list[Metadata] = []
        self.attachments: list[AttachmentLabel] = []
        self.header = Header(profile="", library="")
        self.compressions: dict[str, int] = {}  # chunks by compression, "none" included
        self.compiled = compiled
        self._content = content
        self._declared = Declarations()
        self._seeker = Seeker(content)
        self._proofs = Proofs()
        self._endings = Endings(content, self._proofs)
        self._entries = 0  # of metadata
        self._metadata_bytes = 0
        self._loose = False  # whether messages stand outside chunks
        self._chunked = False  # whether there are chunks
        self._guarded = False  # whether any has a checksum
        self._summary_read = False
        self._suspect = -1  # the record that ends where no other follows

    @property
    def schemas(self) -> dict[int, Schema]:
        """By number, as far as the walk has come."""
        return self._declared.schemas

    @property
    def channels(self) -> dict[int, Channel]:
        """By number, as far as the walk has come, without their metadata."""
        return self._declared.channels

    @property
    def statistics(self) -> Statistics | None:
        """What the file says of itself, if it does."""
        return self._endings.statistics

    @property
    def indexed(self) -> bool:
        """Whether a summary stands at the end."""
        return self._endings.indexed

    @property
    def integrity(self) -> Integrity:
        """What is proved, once `blocks` has been exhausted."""
        return self._proofs.integrity

    def blocks(self) -> Iterator[Block]:
        """The file's messages, block by block, in the order of the file."""
        with Unpacking(self._content, ahead=self._content.size > _AHEAD) as self._unpacking:
            yield from self._blocks()

    def _blocks(self) -> Iterator[Block]:
        size = self._content.size
        here, ended = self._begin(), False
        while here < size and not ended:
            if self._proofs.full:
                self._proofs.lose(here, size, "so much before it is damaged that the rest is given up")
                break
            try:
                block, here, ended = self._step(here)
            except Damage as damage:
                here = self._lose(here, damage)
                continue
            if block is not None:
                yield block
        if not ended and not self._proofs.lost_to(size):
            self._proofs.lose(size, size, "it stops there: the recording was cut off")
        self._endings.compare()

    def _begin(self) -> int:
        """Where the first record stands."""
        content, begin = self._content, len(MAGIC)
        if content[:begin].tobytes() == MAGIC:
            return begin
        why = "it does not begin as an MCAP file does"
        ends_well = content.size > 2 * begin and content[-begin:].tobytes() == MAGIC
        headed = content[begin : begin + 1].tobytes() == bytes([Opcode.HEADER]) and self._headed(begin)
        end = begin if ends_well or headed else content.size
        self._proofs.lose(0, end, why)
        return end

    def _headed(self, here: int) -> bool:
        why, opcode, length = look(self._content.data, here, self._content.size)
        begin = here + HEADER.size
        return not why and exact(self._content, opcode, begin, begin + length)

    def _step(self, here: int) -> tuple[Block | None, int, bool]:
        """Read what stands at `here`: its messages if any, where to go on, whether this was the end."""
        if here == self._suspect:
            raise Damage(here, "a record claims to end where no other follows")
        why, opcode, length = look(self._content.data, here, self._content.size)
        begin = here + HEADER.size
        end = begin + length
        if opcode == Opcode.CHUNK:  # its data have a length of their own
            return *self._chunk(here, end), False
        if why:
            raise Damage(here, why)
        if opcode in BLOCK_OPCODES:
            return *self._stretch(here), False
        if opcode in _PASSED:
            return None, self._pass_over(here), False
        if opcode == Opcode.FOOTER:
            if length != LEAST[Opcode.FOOTER]:
                raise Damage(here, f"a footer of {length} bytes")
            self._endings.footer(begin, end)
            return None, end, True
        try:
            self._record(opcode, begin, end)
        except Damage as damage:
            raise Damage(here, damage.why, resume=self._if_followed(end)) from damage
        return None, end, False

    def _chunk(self, here: int, stated: int) -> tuple[Block | None, int]:
        """The messages of the chunk at `here` whose record claims to end at `stated`, and where to go on."""
        content, begin = self._content, here + HEADER.size
        self._chunked = True
        agree, resume = False, None
        try:
            head = read_head(content, begin, content.size)
            agree = head.end == stated
            if head.unpacked_size == 0 and max(head.end, stated) - head.begin > _EMPTIEST:
                raise Damage(begin, "a chunk that says it is empty is not")
            if head.end < stated and self._if_followed(head.end) is None:
                agree = self._if_followed(stated) is not None  # with fields that are not known yet
            end = stated if agree else head.end
            if agree and head.credible:
                resume = end
            self._guarded |= head.credible and head.checksum != 0
            block = self._unpacking.unpack(head)
            if not agree and not head.checksum:
                raise Damage(begin, "a chunk's two lengths differ, and no checksum tells which is right")
        except Damage as damage:
            resume = self._if_followed(stated) if resume is None else resume
            raise Damage(begin, damage.why, resume=resume) from damage
        try:
            found = self._within(block, (here, end), checked=head.checksum != 0) if block.size else None
        except Damage as damage:
            raise Damage(begin, f"inside a chunk, {damage.why}", resume=end) from damage
        if not agree:
            why = "the length of a chunk's record is wrong; its content is whole by its checksum"
            self._proofs.lose(here, begin, why, gap=False)
        self._proofs.chunks += 1
        name = head.compression or "none"
        self.compressions[name] = self.compressions.get(name, 0) + 1
        return found, end

    def _within(self, data: ByteArray, record: tuple[int, int], *, checked: bool) -> Block | None:
        """The messages of a chunk's content; `record`: where the chunk stands in the file."""
        tiling = tile(data, compiled=self.compiled)
        dropped = [refused(tiling, *one) for one in self._declared.take(data, tiling)]
        return self._block(data, tiling, dropped, record=record, checked=checked)

    def _stretch(self, here: int) -> tuple[Block | None, int]:
        """The messages that stand outside chunks from `here` on, and where to go on."""
        content = self._content
        tiling = tile(
            content[: here + STRETCH_BYTES], begin=here, within=BLOCK_OPCODES, compiled=self.compiled
        )
        if not tiling.opcode.size:  # one record that is longer
            tiling = tile(content, begin=here, within=BLOCK_OPCODES, compiled=self.compiled)
        last = int(tiling.begin[-1]) - HEADER.size
        opcode = int(tiling.opcode[-1])
        own = opcode != Opcode.MESSAGE and exact(content, opcode, last + HEADER.size, tiling.end)
        listed = [refused(tiling, *one) for one in self._declared.take(content, tiling)]
        if not own and not follows(content, tiling.end, self._near()):
            self._suspect = last
            tiling = Tiling(tiling.opcode[:-1], tiling.begin[:-1], tiling.length[:-1], last)
        if not tiling.opcode.size:
            return None, last
        if np.any(tiling.opcode == Opcode.MESSAGE):
            if self._guarded and self._indexes(tiling):
                why = "an index stands there as a message"
                raise Damage(here, why, resume=tiling.end)
            if not self._proofs.whole and (self._guarded or (not self._loose and self._in_chunks())):
                why = "messages stand outside chunks, where no checksum proves them"
                raise Damage(here, why, resume=tiling.end)
            self._loose = True
        try:
            block = self._block(content, tiling, listed, record=None, checked=False)
        except Damage as damage:
            raise Damage(here, damage.why, resume=tiling.end) from damage
        return block, tiling.end

    def _in_chunks(self) -> bool:
        """Whether there is a chunk anywhere, or an index of one."""
        return self._chunked or self._seeker.chunked()

    def _indexes(self, tiling: Tiling) -> bool:
        """Whether what stands as the first message is a chunk's index."""
        mine = np.flatnonzero(tiling.opcode == Opcode.MESSAGE)[:1]
        begin = int(tiling.begin[mine[0]])
        return exact(self._content, Opcode.MESSAGE_INDEX, begin, begin + int(tiling.length[mine[0]]))

    def _near(self) -> Surroundings:
        """What a message must be like to be believed, as far as the walk has come."""
        return surroundings(self._declared.declared, self._proofs.log, self._proofs.publish)

    def _block(
        self,
        data: ByteArray,
        tiling: Tiling,
        dropped: list[Dropped],
        *,
        record: tuple[int, int] | None,
        checked: bool,
    ) -> Block | None:
        """A block's messages, if it has any. `record`: the chunk that it was in."""
        found, lost = readable(
            data, tiling, dropped, self._declared, self._read_summary, compiled=self.compiled
        )
        losses = [(_loss(one, record), one.gap) for one in lost]
        self._proofs.count(found, losses, checked=checked)
        where = record[0] if record else int(tiling.begin[0]) - HEADER.size
        return Block(where, data, found) if found.channel.size else None

    def _read_summary(self) -> None:
        """Let the summary stand in for declarations that are missing."""
        if not self._summary_read:
            self._summary_read = True
            self._declared.stand_in(*summary_declarations(self._content))

    def _pass_over(self, here: int) -> int:
        """Pass over indexes, and records of unknown opcodes; where to go on."""
        content = self._content
        tiling = self._to_false_index(tile(content, begin=here, within=_PASSED, compiled=self.compiled))
        near = self._near()
        starts = tiling.begin - HEADER.size
        large = np.flatnonzero(tiling.length >= _SMALLEST_DISGUISED)[:_MOST_DISGUISED]
        for k in large.tolist():
            begin, end = int(tiling.begin[k]), int(tiling.begin[k] + tiling.length[k])
            hidden = self._loose and message_begins(content, int(starts[k]), near)
            if hidden or disguised(content, begin, end):
                if k:
                    return int(starts[k])
                kind = "message" if hidden else "chunk"
                why = f"a {kind} stands there as a record of opcode {int(tiling.opcode[0])}"
                raise Damage(here, why, resume=self._if_followed(end))
        begin = int(tiling.begin[-1])
        if exact(content, int(tiling.opcode[-1]), begin, tiling.end) or follows(content, tiling.end, near):
            return tiling.end
        self._suspect = begin - HEADER.size
        return self._suspect

    def _to_false_index(self, tiling: Tiling) -> Tiling:
        """Records up to the first index of messages of a false length; Damage where that is the first."""
        false = _false_index(self._content, tiling)
        if false is None:
            return tiling
        begin = int(tiling.begin[false]) - HEADER.size
        if false:
            return Tiling(tiling.opcode[:false], tiling.begin[:false], tiling.length[:false], begin)
        end = int(tiling.begin[0] + tiling.length[0])
        known = end < self._content.size and int(self._content[end]) < _UNKNOWN
        why = "an index of messages whose lengths do not add up"
        raise Damage(begin, why, resume=self._if_followed(end) if known else None)

    def _record(self, opcode: int, begin: int, end: int) -> None:
        content = self._content[begin:end]
        name = Opcode(opcode).name.lower()
        if opcode == Opcode.METADATA:
            self._take_metadata(begin, end)
            return
        if not exact(self._content, opcode, begin, end) and self._if_followed(end) is None:
            raise Damage(begin, f"a {name} record whose lengths do not add up")
        if opcode == Opcode.HEADER:
            fields = Fields(content.data, where=begin, record=name)
            self.header = Header(profile=fields.text(), library=fields.text())
            if begin != len(MAGIC) + HEADER.size:
                raise Damage(begin, "a header record that is not the first")
        elif opcode == Opcode.STATISTICS:
            self._endings.take_statistics(begin, end)
        elif opcode == Opcode.DATA_END:
            self._endings.end_data(begin)
        elif opcode == Opcode.ATTACHMENT:
            if len(self.attachments) >= MOST_ATTACHMENTS:
                raise Damage(begin, f"more than {MOST_ATTACHMENTS} attachments")
            self.attachments.append(read_attachment(self._content, begin, end))

    def _take_metadata(self, begin: int, end: int) -> None:
        self._metadata_bytes += end - begin
        if self._metadata_bytes > METADATA_BYTES:
            raise Damage(begin, f"more than {METADATA_BYTES} bytes of metadata")
        most = MOST_METADATA - self._entries
        if most <= 0:
            raise Damage(begin, f"more than {MOST_METADATA} entries of metadata")
        found, used = read_metadata(self._content[begin:end].data, where=begin, most=most)
        if used != end - begin and self._if_followed(end) is None:
            raise Damage(begin, "a metadata record whose lengths do not add up")
        self._entries += 1 + len(found.metadata)
        self.metadata.append(found)

    def _if_followed(self, end: int) -> int | None:
        """Where a record ends, if another follows there."""
        return end if end <= self._content.size and follows(self._content, end, self._near()) else None

    def _lose(self, here: int, damage: Damage) -> int:
        """Note what is lost at `here`; where to go on."""
        head = extent(self._content, here)
        after = damage.resume
        if after is None:
            self._read_summary()
            loose = self._loose or not self._in_chunks()
            after = self._seeker.next_record(here + 1, self._near(), loose=loose)
        end = self._content.size if after is None else after
        self._proofs.lose(here, end, damage.why, time_range=head.time_range if head else None)
        return end


def _false_index(content: ByteArray, tiling: Tiling) -> int | None:
    """The first index of messages that is shorter than it says, or longer with no known record behind it."""
    least = LEAST[Opcode.MESSAGE_INDEX]
    mine = np.flatnonzero((tiling.opcode == Opcode.MESSAGE_INDEX) & (tiling.length >= least))
    size = gather(content, tiling.begin[mine] + 2, 4).copy().view("<u4").reshape(-1)
    more = tiling.length[mine] - least - size.astype(np.int64)
    behind = content[np.minimum(tiling.begin[mine] + tiling.length[mine], content.size - 1)]
    false = mine[(more < 0) | ((more > 0) & ((behind >= _UNKNOWN) | (behind == 0)))]
    return int(false[0]) if false.size else None


def _loss(one: Dropped, record: tuple[int, int] | None) -> Loss:
    """A loss of the file, from what was dropped of a stretch or of the chunk record that held it."""
    begin, end = record or (one.begin, one.end)
    why = f"inside a chunk, {one.why}" if record else one.why
    return Loss(begin, end, why, one.time_range, one.before, one.behind)

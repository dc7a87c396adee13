"""Which bytes may be taken for the beginning of a record.

Nothing marks where an MCAP record begins: only that its opcode is known, its length fits, its own lengths
agree, and another record follows. A message adds its channel, which must be one that is declared, and two
times, which must lie near those of the messages around; in a log that is enough to tell it from the bytes of
a number. A record that claims to end where nothing follows is not believed.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from data.mcap.chunks import read_head
from data.mcap.container import MAGIC
from data.mcap.records import HEADER, MESSAGE_PREFIX, ByteArray, Damage

LEAST: Final[dict[int, int]] = {
    Opcode.HEADER: 8,
    Opcode.FOOTER: 20,
    Opcode.SCHEMA: 14,
    Opcode.CHANNEL: 16,
    Opcode.MESSAGE: MESSAGE_PREFIX,
    Opcode.CHUNK: 40,
    Opcode.MESSAGE_INDEX: 6,
    Opcode.CHUNK_INDEX: 64,
    Opcode.ATTACHMENT: 36,
    Opcode.ATTACHMENT_INDEX: 48,
    Opcode.STATISTICS: 46,
    Opcode.METADATA: 8,
    Opcode.METADATA_INDEX: 20,
    Opcode.SUMMARY_OFFSET: 17,
    Opcode.DATA_END: 4,
}  # bytes in the content of each
AROUND: Final = 86_400 * 10**9  # [ns] how far from its neighbours' a message's times may lie
_PREFIX: Final = struct.Struct("<HIQQ")
_LARGEST: Final = 1 << 26  # bytes that a record may claim beyond the end of a file that was cut off
_MOST_HOPS: Final = 64  # over records of unknown opcodes
_LATEST: Final = (1 << 63) - 1


@dataclass(frozen=True)
class Surroundings:
    """What is known of the messages near a place."""

    declared: NDArray[np.bool_]  # (65536,) by channel
    log: tuple[int, int]  # [ns] between which log times are believed
    publish: tuple[int, int]

    def holds(self, channel: int, log: int, publish: int) -> bool:
        """Whether a message on that channel with those times may stand there."""
        return (
            bool(self.declared[channel])
            and self.log[0] <= log <= self.log[1]
            and (self.publish[0] <= publish <= self.publish[1] or publish == 0)
        )


def surroundings(
    declared: NDArray[np.bool_], log: tuple[int, int] | None, publish: tuple[int, int] | None
) -> Surroundings:
    """What the declared channels and the times [ns] read so far (first, last) lead to expect."""
    return Surroundings(declared, _near(log), _near(publish))


def _near(times: tuple[int, int] | None) -> tuple[int, int]:
    return (0, _LATEST) if times is None else (times[0] - AROUND, min(times[1] + AROUND, _LATEST))


def message_begins(content: ByteArray, here: int, near: Surroundings) -> bool:
    """Whether channel and times of a message stand behind a record's header at `here`, whatever that says."""
    if here + HEADER.size + MESSAGE_PREFIX > content.size:
        return False
    channel, _, log, publish = _PREFIX.unpack_from(content.data, here + HEADER.size)
    return near.holds(channel, log, publish)


def follows(content: ByteArray, here: int, near: Surroundings) -> bool:
    """Whether a record may begin at `here`, the file end, or have been cut off."""
    size = content.size
    for _ in range(_MOST_HOPS):
        if here >= size:
            return here == size
        opcode = int(content[here])
        if here + HEADER.size > size:
            return opcode != 0
        length = int.from_bytes(content[here + 1 : here + HEADER.size].tobytes(), "little")
        left = size - here - HEADER.size
        if message_begins(content, here, near):
            return True  # even where its opcode or its length was damaged
        if opcode == Opcode.MESSAGE and left >= MESSAGE_PREFIX:
            channel, _, log, _ = _PREFIX.unpack_from(content.data, here + HEADER.size)
            return MESSAGE_PREFIX <= length <= left and (
                bool(near.declared[channel]) or near.log[0] <= log <= near.log[1]
            )
        if opcode == Opcode.CHUNK and left >= LEAST[opcode]:
            return _chunk_begins(content, here + HEADER.size)  # whatever the record says of its length
        if opcode in LEAST:
            fixed = opcode in (Opcode.DATA_END, Opcode.FOOTER)
            return LEAST[opcode] <= length <= (LEAST[opcode] if fixed else max(_LARGEST, left))
        if opcode == 0:
            return content[here : here + len(MAGIC)].tobytes() == MAGIC
        if length > left:
            return False
        here += HEADER.size + length  # an unknown opcode, to be passed over
    return True


def _chunk_begins(content: ByteArray, begin: int) -> bool:
    """Whether a chunk's head is there; its data may have been cut off."""
    try:
        head = read_head(content, begin, content.size + _LARGEST)
    except Damage:
        return False
    return head.credible and head.starts_as_it_says(content)

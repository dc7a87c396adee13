"""An attachment's label, its checksum's state, and where its content stands in the file."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from data.integrity import Checksums
from data.mcap.fields import Fields
from data.mcap.limits import LONGEST_NAME
from data.mcap.records import ByteArray, Damage

_HEAD: int = 3 * 8 + 2 * (4 + LONGEST_NAME)  # bytes that a label may take


@dataclass(frozen=True)
class AttachmentLabel:
    """An attachment's label; its content stays in the file."""

    name: str
    media_type: str
    offset: int  # where the content begins in the file [bytes]
    size: int  # of the content [bytes]
    log_time: int  # [ns]
    create_time: int  # [ns]
    checksum: Checksums


def read_attachment(content: ByteArray, begin: int, end: int) -> AttachmentLabel:
    """The label of the attachment whose record's content is [begin, end); its content is not copied.

    Raises
    ------
    Damage
        When it contradicts itself, or its checksum differs from its content.
    """
    fields = Fields(content[begin : min(end, begin + _HEAD)].data, where=begin, record="attachment")
    log_time, create_time = fields.number(8), fields.number(8)
    name, media_type, size = fields.text(), fields.text(), fields.number(8)
    offset = begin + fields.here
    checksum = offset + size
    if checksum + 4 > end:
        raise Damage(begin, f"an attachment claims {size} bytes, more than its record")
    stored = int.from_bytes(content[checksum : checksum + 4].tobytes(), "little")
    if stored and zlib.crc32(content[begin:checksum].data) != stored:
        raise Damage(begin, "an attachment's checksum differs from its content", resume=end)
    state: Checksums = "verified" if stored else "absent"
    return AttachmentLabel(name, media_type, offset, size, log_time, create_time, state)

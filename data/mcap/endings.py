"""What the end of a file says of the whole: checksums of both sections, and how many messages there are."""

from __future__ import annotations

import zlib
from typing import Final

from mcap.records import Footer, Statistics

from data.mcap.container import MAGIC
from data.mcap.fields import Fields
from data.mcap.proofs import Proofs
from data.mcap.records import HEADER, ByteArray, Damage, parse

_LONGEST_STATISTICS: Final = 46 + 10 * (1 << 16)  # [bytes]


class Endings:
    """Holds what the last records of a file say against what was read of it."""

    def __init__(self, content: ByteArray, proofs: Proofs) -> None:
        self.indexed = False  # whether a summary stands at the end
        self._content = content
        self._proofs = proofs
        self._statistics: bytes | None = None
        self._data_ended = False

    @property
    def statistics(self) -> Statistics | None:
        """What the file says of itself, if it does."""
        if self._statistics is None:
            return None
        found: Statistics = parse(Statistics.read, self._statistics, where=0, name="statistics")
        return found

    def take_statistics(self, begin: int, end: int) -> None:
        """Note what the statistics record [begin, end) promises; raises Damage."""
        if end - begin > _LONGEST_STATISTICS:
            raise Damage(begin, f"statistics of {end - begin} bytes")
        self._statistics = self._content[begin:end].tobytes()
        fields = Fields(memoryview(self._statistics), where=begin, record="statistics")
        self._proofs.promised = fields.number(8)

    def end_data(self, begin: int) -> None:
        """Check the checksum of all that came before, where there is one."""
        self._data_ended = True
        checksum = int.from_bytes(self._content[begin : begin + 4].tobytes(), "little")
        if checksum and self._proofs.whole:
            before = begin - HEADER.size
            if zlib.crc32(self._content[:before].data) == checksum:
                self._proofs.prove_all()
            else:
                why = (
                    "the data section's checksum differs from its content: something before it was changed, "
                    "and only what has a checksum of its own is proved"
                )
                self._proofs.lose(before, begin + 4, why, gap=False)

    def footer(self, begin: int, end: int) -> None:
        """Check the summary's checksum and the magic number behind it."""
        size = self._content.size
        footer = parse(Footer.read, self._content[begin:end].tobytes(), where=begin, name="footer")
        self.indexed = footer.summary_start != 0
        if not self._data_ended and self._proofs.whole:
            why = "the end of the data section is not marked; all that stands before it was read"
            self._proofs.lose(begin - HEADER.size, begin - HEADER.size, why, gap=False)
        start = footer.summary_start or begin - HEADER.size
        if footer.summary_crc and (
            start > begin or zlib.crc32(self._content[start : begin + 16].data) != footer.summary_crc
        ):
            why = "the summary's checksum differs from its content"
            self._proofs.lose(min(start, begin), end, why, gap=False)
        if self._content[end : end + len(MAGIC)].tobytes() != MAGIC:
            self._proofs.lose(end, size, "it does not end as an MCAP file does", gap=False)
        elif size > end + len(MAGIC):
            self._proofs.notes.append(self._behind(end + len(MAGIC)))

    def _behind(self, end: int) -> str:
        """What is to be said of bytes behind the end."""
        rest = self._content[end:]
        if rest[: len(MAGIC)].tobytes() == MAGIC:
            return (
                f"another MCAP file of {rest.size} bytes stands behind the end of the first and is not read; "
                "split them, or merge them into one"
            )
        return f"{rest.size} bytes stand behind the end and are not read"

    def compare(self) -> None:
        """Hold the messages that were found against those that the file promises."""
        promised, found = self._proofs.promised, self._proofs.messages
        if promised is not None and promised != found and self._proofs.whole:
            end = self._content.size
            why = f"the statistics promise {promised} messages, {found} were found"
            self._proofs.lose(end, end, f"{why}; where the others belong is not told", gap=False)

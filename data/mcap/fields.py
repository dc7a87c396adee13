"""The fields of an MCAP record, read one after the other, each length checked before it is believed.

mcap's own parser takes any length that fits into the record; this one also knows how long a name may be (see
`limits`), and leaves alone what nobody asked for, such as a channel's metadata. All numbers are
little-endian. Source: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

from mcap.records import Channel, Metadata, Schema

from data.mcap.limits import LARGEST_SCHEMA, LONGEST_NAME, LONGEST_VALUE
from data.mcap.records import Damage


class Fields:
    """Steps through the content of one record. `where` is its first byte, for messages."""

    def __init__(self, content: bytes | memoryview, *, where: int, record: str) -> None:
        self._content = content
        self._where = where
        self._record = record
        self.here = 0  # bytes read so far

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._content) - self.here

    def number(self, size: int) -> int:
        """An unsigned number of `size` bytes."""
        return int.from_bytes(self._take(size), "little")

    def raw(self, longest: int) -> bytes:
        """Bytes behind their length of four bytes, at most `longest`."""
        size = self.number(4)
        if size > min(longest, self.left):
            raise self.damage(f"{size} bytes are promised, {self.left} are left and {longest} are the most")
        return self._take(size)

    def text(self, longest: int = LONGEST_NAME) -> str:
        """A string behind its length."""
        raw = self.raw(longest)
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise self.damage("a text is not UTF-8") from error

    def damage(self, why: str) -> Damage:
        """What to raise when the record contradicts itself."""
        return Damage(self._where, f"the {self._record} record there contradicts itself ({why})")

    def _take(self, size: int) -> bytes:
        if size > self.left:
            raise self.damage(f"{size} bytes are promised, {self.left} are left")
        self.here += size
        return bytes(self._content[self.here - size : self.here])


def read_schema(content: bytes | memoryview, *, where: int) -> tuple[Schema, int]:
    """A schema, and how many bytes of the record it takes. Raises Damage."""
    fields = Fields(content, where=where, record="schema")
    number, name, encoding = fields.number(2), fields.text(), fields.text()
    schema = Schema(id=number, name=name, encoding=encoding, data=fields.raw(LARGEST_SCHEMA))
    return schema, fields.here


def read_channel(content: bytes | memoryview, *, where: int) -> tuple[Channel, int]:
    """A channel without its metadata, and how many bytes of the record it takes. Raises Damage."""
    fields = Fields(content, where=where, record="channel")
    number, schema, topic, encoding = fields.number(2), fields.number(2), fields.text(), fields.text()
    fields.raw(len(content))
    channel = Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema)
    return channel, fields.here


def read_metadata(content: bytes | memoryview, *, where: int, most: int) -> tuple[Metadata, int]:
    """A metadata record of at most `most` entries, and how many bytes of it they take. Raises Damage."""
    fields = Fields(content, where=where, record="metadata")
    name, size = fields.text(), fields.number(4)
    end = fields.here + size
    if size > fields.left:
        raise fields.damage(f"{size} bytes are promised, {fields.left} are left")
    entries: dict[str, str] = {}
    while fields.here < end:
        if len(entries) >= most:
            raise fields.damage(f"more than the {most} entries that are still read")
        key = fields.text()
        entries[key] = fields.text(LONGEST_VALUE)
    if fields.here != end:
        raise fields.damage("its entries do not fill what they claim")
    return Metadata(name=name, metadata=entries), fields.here

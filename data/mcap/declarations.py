"""The schemas and channels that a file declares: taken once, compared when repeated, limited in number.

A writer may repeat its declarations in every chunk, so a repeat that is the same to the byte costs one
comparison. A number that is declared a second time with another meaning is contested: nobody can tell which
of the two its messages mean, so from there on they are not read.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from data.mcap.fields import read_channel, read_schema
from data.mcap.limits import DECLARED_BYTES, MOST_CHANNELS, MOST_DECLARATIONS, MOST_SCHEMAS, SCHEMA_TYPES
from data.mcap.records import HEADER, ByteArray, Damage, Tiling

_DECLARES: Final = np.isin(np.arange(256), (Opcode.SCHEMA, Opcode.CHANNEL))  # by opcode
_LONGEST_STRETCH: Final = 8 << 20  # [bytes] of declarations that are remembered as a whole


class Declarations:
    """What is declared so far, by number."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.contested: set[tuple[int, int]] = set()  # opcode and number
        self.declared = np.zeros(1 << 16, np.bool_)  # (65536,) channels whose messages can be read
        self._users: dict[int, list[int]] = {}  # channels by schema
        self._raw: dict[tuple[int, bytes], bytes] = {}
        self._stretch = b""  # the last block's declarations, where they stood together
        self._bytes = 0
        self._compared = 0

    def take(self, data: ByteArray, tiling: Tiling) -> list[tuple[int, int, str, bool]]:
        """Take in a block's declarations; those that are refused.

        Refusals for the same reason are one: the first record of the tiling, how many, why, and whether it
        is no declaration at all, but damaged.
        """
        places = np.flatnonzero(_DECLARES[tiling.opcode])
        if not places.size:
            return []
        first, last = int(places[0]), int(places[-1])
        together = last - first + 1 == places.size
        ends = int(tiling.begin[last] + tiling.length[last])
        stretch = data.data[int(tiling.begin[first]) - HEADER.size : ends] if together else data.data[:0]
        if together and len(stretch) <= _LONGEST_STRETCH:
            if stretch == self._stretch:
                return []
            self._stretch = bytes(stretch)
        refused: dict[tuple[str, bool], list[int]] = {}
        for why, beyond in self._beyond(data, tiling, places):
            refused[why, False] = [int(places[beyond][0]), int(beyond.sum())]
            places = places[~beyond]
        columns = (places, tiling.opcode[places], tiling.begin[places], tiling.length[places])
        for place, opcode, begin, length in zip(*(column.tolist() for column in columns), strict=True):
            content = bytes(data.data[begin : begin + length])
            if self._raw.get((opcode, content[:2])) == content:
                continue
            damaged = False
            try:
                why = self._one(opcode, content, begin)
            except Damage as damage:
                why, damaged = damage.why, True
            if why:
                refused.setdefault((why, damaged), [place, 0])[1] += 1
        return [(place, count, *why) for why, (place, count) in refused.items()]

    def stand_in(self, schemas: dict[int, Schema], channels: dict[int, Channel]) -> None:
        """Take what is missing from elsewhere."""
        for number, schema in schemas.items():
            if self.schemas.setdefault(number, schema) is schema:
                self._judge_users(number)
        for number, channel in channels.items():
            if self.channels.setdefault(number, channel) is channel:
                self._users.setdefault(channel.schema_id, []).append(number)
                self._judge(number)

    def missing(self, numbers: NDArray[np.uint16]) -> str:
        """Why the messages on channels `numbers` cannot be read."""
        listed = ", ".join(str(number) for number in numbers[:4].tolist())
        more = f" and {numbers.size - 4} others" if numbers.size > 4 else ""
        channels = f"channel{'s' * (numbers.size > 1)} {listed}{more}"
        if all(self._is_contested(number) for number in numbers[:4].tolist()):
            return f"{channels}, declared twice, differently"
        return f"{channels}, which {'is' if numbers.size == 1 else 'are'} nowhere declared with a schema"

    def _beyond(
        self, data: ByteArray, tiling: Tiling, places: NDArray[np.intp]
    ) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Which of the declarations at `places` are more than are read, and why."""
        for opcode, known, most in (
            (Opcode.SCHEMA, self.schemas, MOST_SCHEMAS),
            (Opcode.CHANNEL, self.channels, MOST_CHANNELS),
        ):
            if len(known) < most:
                continue
            listed = np.zeros(1 << 16, np.bool_)
            listed[list(known)] = True
            begin = np.minimum(tiling.begin[places], data.size - 2)
            number = data[begin] | (data[begin + 1].astype(np.uint16) << 8)
            beyond = (tiling.opcode[places] == opcode) & (tiling.length[places] >= 2) & ~listed[number]
            if beyond.any():
                yield f"more than {most} {opcode.name.lower()}s are declared", beyond
                places = places[~beyond]

    def _one(self, opcode: int, content: bytes, where: int) -> str:
        """Take one declaration; why it is refused, if it is. Raises Damage when it contradicts itself."""
        is_schema = opcode == Opcode.SCHEMA
        known: dict[int, Any] = self.schemas if is_schema else self.channels
        most = MOST_SCHEMAS if is_schema else MOST_CHANNELS
        key = (opcode, content[:2])
        new = int.from_bytes(content[:2], "little") not in known
        self._compared += 1
        if self._compared > MOST_DECLARATIONS:
            return f"more than {MOST_DECLARATIONS} declarations that differ"
        if new and len(known) >= most:
            return f"more than {most} {'schemas' if is_schema else 'channels'} are declared"
        self._bytes += len(content) if new else 0
        if self._bytes > DECLARED_BYTES:
            return f"more than {DECLARED_BYTES} bytes of declarations"
        return self._schema(key, content, where) if is_schema else self._channel(key, content, where)

    def _schema(self, key: tuple[int, bytes], content: bytes, where: int) -> str:
        schema, _ = read_schema(content, where=where)
        if schema.id == 0:
            return "a schema numbered 0, which means none"
        if schema.data.count(b"\nMSG:") > SCHEMA_TYPES:
            return f"schema {schema.id} defines more than {SCHEMA_TYPES} types"
        known = self.schemas.get(schema.id)
        if known is None:
            self.schemas[schema.id] = schema
            self._judge_users(schema.id)
        elif known != schema:
            if (Opcode.SCHEMA, schema.id) not in self.contested:
                self.contested.add((Opcode.SCHEMA, schema.id))
                self._judge_users(schema.id)
            return f"schema {schema.id} is declared twice, differently"
        self._raw[key] = content
        return ""

    def _channel(self, key: tuple[int, bytes], content: bytes, where: int) -> str:
        channel, _ = read_channel(content, where=where)
        known = self.channels.get(channel.id)
        if known is None:
            self.channels[channel.id] = channel
            self._users.setdefault(channel.schema_id, []).append(channel.id)
        elif known != channel:
            self.contested.add((Opcode.CHANNEL, channel.id))
        self._judge(channel.id)
        if known is not None and known != channel:
            return f"channel {channel.id} is declared twice, differently"
        self._raw[key] = content
        return ""

    def _is_contested(self, number: int) -> bool:
        channel = self.channels.get(number)
        return (Opcode.CHANNEL, number) in self.contested or (
            channel is not None and (Opcode.SCHEMA, channel.schema_id) in self.contested
        )

    def _judge(self, number: int) -> None:
        """Say again whether a channel can be read."""
        schema = self.channels[number].schema_id
        known = schema == 0 or schema in self.schemas
        self.declared[number] = known and not self._is_contested(number)

    def _judge_users(self, schema: int) -> None:
        for number in self._users.get(schema, ()):
            self._judge(number)

"""Columns of numbers out of an MCAP file, straight from its blocks where that can be proved.

Binary messages that share a layout (`layout`) are taken as arrays, and JSON ones that share a text
(`json_layout`); the proof is made for every message, and those that cannot be proved go through the ordinary
decoder one by one. Both ways give the same numbers, bit for bit.

Each topic keeps its three clocks: the log time (when the recorder got a message), the publish time, and the
stamp in the message's own header where it has one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from data.findings import LogError
from data.integrity import Integrity
from data.mcap.decoding import Decode, decoder, recogniser
from data.mcap.field_path import FieldPath, resolve, resolve_exactly
from data.mcap.layout import Taken
from data.mcap.layout_reader import LayoutReader
from data.mcap.records import ByteArray
from data.mcap.stamp import NO_STAMP, header_stamp
from data.mcap.walk import Block, McapWalk
from data.names import nearest, shown

if TYPE_CHECKING:
    from data.mcap.json_layout import JsonReader

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
_MOST_NAMED: Final = 4  # channels
_LARGE: Final = 4 << 20  # [bytes] of a file that is worth loading compiled code


@dataclass(frozen=True)
class Topic:
    """What was read of one topic, in the order of the file; arrays are (n,)."""

    values: Mapping[str, FloatArray]  # by field path
    log_time: TimeArray  # [ns]
    publish_time: TimeArray  # [ns]
    header_time: TimeArray | None  # [ns]; None: the messages have no stamp
    ticks: tuple[Decimal, ...] = ()  # of the field that is the clock, exact [as logged]


@dataclass(frozen=True)
class McapColumns:
    """What was asked of one file."""

    topics: Mapping[str, Topic]
    metadata: Mapping[str, str]
    integrity: Integrity
    decoded_singly: int  # messages that went through the ordinary decoder


def read_columns(
    content: ByteArray, wanted: Sequence[FieldPath], *, clock: FieldPath | None = None
) -> McapColumns:
    """Read the wanted fields of every message of their topics.

    Parameters
    ----------
    content
        The file.
    wanted
        The fields to read.
    clock
        The one of them that is the time, whose numbers are also kept exactly.

    Raises
    ------
    LogError
        When a topic is missing, declared on two channels at once, in an unread encoding, or a field is not a
        number in it. A damaged file is no error here: see `McapColumns.integrity`.
    """
    walk = McapWalk(content, compiled=content.size > _LARGE)
    paths: dict[str, list[FieldPath]] = {}
    for path in wanted:
        paths.setdefault(path.topic, []).append(path)
    readers: dict[str, dict[int, _ChannelReader]] = {topic: {} for topic in paths}
    for block in walk.blocks():
        for number in np.flatnonzero(np.bincount(block.messages.channel)).tolist():
            channel = walk.channels[number]
            for topic in called(channel.topic, number, paths):
                mine = readers[topic]
                if number not in mine:
                    mine[number] = _reader(walk, channel, paths[topic], clock)
                mine[number].take(block, number)
    declared = [channel.topic for channel in walk.channels.values()]
    return McapColumns(
        topics={
            topic: joined(topic, {number: reader.topic() for number, reader in mine.items()}, declared)
            for topic, mine in readers.items()
        },
        metadata=run_metadata(walk),
        integrity=walk.integrity,
        decoded_singly=sum(reader.singly for mine in readers.values() for reader in mine.values()),
    )


def called(topic: str, number: int, wanted: Collection[str]) -> list[str]:
    """Which of the wanted topics a channel is read as: its own, `/state`, or with its number, `/state#3`."""
    return [name for name in (topic, f"{topic}#{number}") if name in wanted]


def survey(content: ByteArray) -> Integrity:
    """What is proved of a file's bytes, whatever its messages hold."""
    walk = McapWalk(content, compiled=False)
    for _ in walk.blocks():
        pass
    return walk.integrity


def run_metadata(walk: McapWalk) -> dict[str, str]:
    """All metadata records as one mapping; a key that two records hold is also found as `record/key`."""
    merged: dict[str, str] = {}
    for record in walk.metadata:
        for key, value in record.metadata.items():
            merged[f"{record.name}/{key}"] = value
            merged.setdefault(key, value)
    return merged


def _reader(
    walk: McapWalk, channel: Channel, paths: list[FieldPath], clock: FieldPath | None
) -> _ChannelReader:
    clock = clock if clock in paths else None
    schema = walk.schemas.get(channel.schema_id) if channel.schema_id else None
    decode = decoder(channel, schema, exact=clock is not None)
    if clock is not None:
        return _ChannelReader(paths, decode, clock=clock)
    if channel.message_encoding == "json" and walk.compiled:
        from data.mcap.json_layout import JsonReader  # noqa: PLC0415  # numba takes long to load

        return _ChannelReader(paths, decode, JsonReader(paths))
    recognise = recogniser(channel, schema)
    return _ChannelReader(paths, decode, recognise and LayoutReader(paths, recognise, compiled=walk.compiled))


def joined(topic: str, channels: Mapping[int, Topic], declared: Sequence[str]) -> Topic:
    """A topic's columns, from its one channel or from several that took turns, by number.

    Raises
    ------
    LogError
        When no channel had a message of it (`declared` are the log's topics), or two had at the same time.
    """
    if not channels:
        if topic in declared:
            raise LogError(f"topic {shown(topic)!r} is declared but holds no message")
        raise LogError(f"no topic {shown(topic)!r}; the log has {nearest(topic, declared)}")
    parts = sorted(channels.values(), key=lambda part: int(part.log_time[0]))
    for before, after in pairwise(parts):
        if before.log_time.max() >= after.log_time.min():
            numbers = sorted(channels)[:_MOST_NAMED]
            names = " or ".join(repr(shown(f"{topic}#{number}")) for number in numbers)
            raise LogError(
                f"topic {shown(topic)!r} is on {len(parts)} channels at the same time: two publishers, and "
                f"no way to tell which is the rig's. Name one by its number: {names}"
            )
    if len(parts) == 1:
        return parts[0]
    headers = [part.header_time for part in parts if part.header_time is not None]
    return Topic(
        values={name: np.concatenate([part.values[name] for part in parts]) for name in parts[0].values},
        log_time=np.concatenate([part.log_time for part in parts]),
        publish_time=np.concatenate([part.publish_time for part in parts]),
        header_time=np.concatenate(headers) if len(headers) == len(parts) else None,
        ticks=tuple(tick for part in parts for tick in part.ticks),
    )


@dataclass
class _ChannelReader:
    """Gathers one channel's columns block by block."""

    paths: list[FieldPath]
    decode: Decode
    reader: LayoutReader | JsonReader | None = None  # reads a block at once
    clock: FieldPath | None = None  # which of the paths is the time
    singly: int = 0
    columns: list[list[FloatArray]] = field(default_factory=list)  # of each path, a block each
    clocks: list[list[TimeArray]] = field(default_factory=lambda: [[], [], []])  # log, publish, header
    ticks: list[Decimal] = field(default_factory=list)

    def take(self, block: Block, number: int) -> None:
        """Read this channel's messages of a block."""
        found = block.messages.of(number)
        if self.reader is not None:
            taken = self.reader.read(block.data, found.begin, found.length)
        else:
            taken = Taken.nothing(len(self.paths), found.begin.size)
        for k in np.flatnonzero(taken.left).tolist():
            raw = block.data[int(found.begin[k]) : int(found.begin[k] + found.length[k])].tobytes()
            message = self.decode(raw)
            taken.values[:, k] = [resolve(message, path) for path in self.paths]
            taken.header[k] = header_stamp(message)
            if self.clock is not None:
                self.ticks.append(resolve_exactly(message, self.clock))
            self.singly += 1
        self.columns = self.columns or [[] for _ in self.paths]
        for column, row in zip(self.columns, taken.values, strict=True):
            column.append(row.copy())
        for clock, own in zip(self.clocks, (found.log_time, found.publish_time, taken.header), strict=True):
            clock.append(own)

    def topic(self) -> Topic:
        """All that was gathered; the blocks are let go as they are joined, column by column."""
        values = {
            path.text: _run_together(column) for path, column in zip(self.paths, self.columns, strict=True)
        }
        log_time, publish_time, header = (_run_together(clock) for clock in self.clocks)
        return Topic(
            values=values,
            log_time=log_time,
            publish_time=publish_time,
            header_time=header if np.all(header != NO_STAMP) else None,
            ticks=tuple(self.ticks),
        )


def _run_together(parts: list[NDArray[Any]]) -> NDArray[Any]:
    whole = np.concatenate(parts)
    parts.clear()
    return whole

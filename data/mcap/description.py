"""What an MCAP file holds, with no settings: channels, their fields, clocks, and what is proved of the bytes.

One walk. Every channel's log times are kept; the first message is decoded to list its fields. Header stamps
are read for all messages where a layout can be proved, which costs next to nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from data.clocks import ClockReport, clock_report_ns
from data.findings import LogError
from data.integrity import Integrity
from data.mcap.attachments import AttachmentLabel
from data.mcap.columns import run_metadata
from data.mcap.decoding import decoder, recogniser
from data.mcap.field_path import leaves
from data.mcap.layout import Layout, Taken, take
from data.mcap.records import ByteArray
from data.mcap.stamp import NO_STAMP
from data.mcap.walk import Block, McapWalk

MOST_LISTED: Final = 500  # channels
_MOST_FIELDS: Final = 200
_LONGEST: Final = 200  # characters of a value
_HUGE: Final = 1 << 1000  # integers beyond are no numbers to a program that reads JSON
_SHOWN: Final = (int, float, str, np.integer, np.floating)
_LARGE: Final = 256 << 20  # [bytes] of a file that is worth loading compiled code


@dataclass(frozen=True)
class Field:
    """One field of a channel's messages, from the first one."""

    path: str  # as a field path after the topic's colon
    value: float | str | None  # [as logged] of the first message; None: an empty array
    length: int | None = None  # of an array
    joints: tuple[str, ...] = ()  # names beside an array of that length


@dataclass(frozen=True)
class ChannelDescription:
    """One channel."""

    number: int  # as the file counts channels
    topic: str
    encoding: str
    schema: str  # name, empty for none
    schema_encoding: str
    fields: tuple[Field, ...]
    refused: str | None  # why its messages cannot be decoded
    log_clock: ClockReport
    header_clock: ClockReport | None


@dataclass(frozen=True)
class McapDescription:
    """One file."""

    profile: str
    library: str
    compressions: Mapping[str, int]  # chunks by compression
    indexed: bool
    channels: tuple[ChannelDescription, ...]
    unlisted: int  # further channels with messages
    empty_topics: tuple[str, ...]  # declared, without a message
    metadata: Mapping[str, str]
    attachments: tuple[AttachmentLabel, ...]
    integrity: Integrity


@dataclass
class _Seen:
    """What the walk gathers of one channel."""

    channel: Channel
    schema: Schema | None
    first: bytes
    log: list[NDArray[np.int64]] = field(default_factory=list)
    header: list[NDArray[np.int64]] = field(default_factory=list)
    layout: Layout | None = None


def describe(content: ByteArray) -> McapDescription:
    """Describe a file's bytes. Damage is no error here: see its `integrity`."""
    walk = McapWalk(content, compiled=content.size > _LARGE)
    seen: dict[int, _Seen] = {}
    found = np.zeros(1 << 16, np.bool_)
    for block in walk.blocks():
        for number, mine in _by_channel(block.messages.channel):
            found[number] = True
            if number in seen or len(seen) < MOST_LISTED:
                _take(walk, block, number, mine, seen)
    topics = {channel.topic for number, channel in walk.channels.items() if found[number]}
    return McapDescription(
        profile=walk.header.profile,
        library=walk.header.library,
        compressions=walk.compressions,
        indexed=walk.indexed,
        channels=tuple(_channel(part) for part in seen.values()),
        unlisted=int(found.sum()) - len(seen),
        empty_topics=tuple(c.topic for c in walk.channels.values() if c.topic not in topics),
        metadata=run_metadata(walk),
        attachments=tuple(walk.attachments),
        integrity=walk.integrity,
    )


def _by_channel(channel: NDArray[np.uint16]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each channel among messages (n,), and which of them are its own, in order."""
    order = np.argsort(channel, kind="stable")
    ordered = channel[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    for begin, end in pairwise((*begins.tolist(), channel.size)):
        yield int(ordered[begin]), order[begin:end]


def _take(walk: McapWalk, block: Block, number: int, mine: NDArray[np.intp], seen: dict[int, _Seen]) -> None:
    found = block.messages
    begin, length = found.begin[mine], found.length[mine]
    if number not in seen:
        channel = walk.channels[number]
        schema = walk.schemas.get(channel.schema_id)
        first = block.data[int(begin[0]) : int(begin[0] + length[0])].tobytes()
        seen[number] = _Seen(channel, schema, first)
        recognise = recogniser(channel, schema)
        seen[number].layout = recognise(first) if recognise else None
    part = seen[number]
    part.log.append(found.log_time[mine])
    if part.layout is None:
        return
    taken = Taken.nothing(0, begin.size)
    take(part.layout, (), block.data, (begin, length), taken, compiled=walk.compiled)
    if taken.left.any() or np.any(taken.header == NO_STAMP):
        part.layout, part.header = None, []
    else:
        part.header.append(taken.header)


def _channel(part: _Seen) -> ChannelDescription:
    fields: tuple[Field, ...] = ()
    refused = None
    try:
        fields = described_fields(decoder(part.channel, part.schema)(part.first))
    except LogError as error:
        refused = str(error)
    return ChannelDescription(
        number=part.channel.id,
        topic=part.channel.topic,
        encoding=part.channel.message_encoding,
        schema=part.schema.name if part.schema else "",
        schema_encoding=part.schema.encoding if part.schema else "",
        fields=fields,
        refused=refused,
        log_clock=clock_report_ns(np.concatenate(part.log)),
        header_clock=clock_report_ns(np.concatenate(part.header)) if part.header else None,
    )


def described_fields(message: object) -> tuple[Field, ...]:
    """The fields of a decoded message, for a person to choose from."""
    listed = []
    found = dict(leaves(message))
    for path, value in list(found.items())[:_MOST_FIELDS]:
        if isinstance(value, str | bytes) or not hasattr(value, "__len__"):
            listed.append(Field(path, _plain(value)))
            continue
        elements = list(value) if hasattr(value, "__iter__") else []
        names = found.get(path.rpartition(".")[0] + "." * ("." in path) + "name")
        joints = tuple(str(name) for name in names) if isinstance(names, list) and path != "name" else ()
        first = _plain(elements[0]) if elements and isinstance(elements[0], _SHOWN) else None
        listed.append(Field(path, first, len(elements), joints if len(joints) == len(elements) else ()))
    return tuple(listed)


def _plain(value: object) -> float | str:
    if isinstance(value, np.integer | np.floating):
        value = value.item()
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if abs(value) < _HUGE or isinstance(value, float) else str(value)[:_LONGEST]
    if isinstance(value, bytes | bytearray):
        return f"{len(value)} bytes"
    return str(value)[:_LONGEST]

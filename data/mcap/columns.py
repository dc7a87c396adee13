"""Columns of numbers out of an MCAP file, straight from its blocks where that can be proved.

Messages of `sensor_msgs/msg/JointState` that share a layout (see `joint_state`) are taken as arrays; the
proof is made for every message, and those that fit no layout go through the ordinary decoder one by one, as
all other messages do. Both ways give the same numbers, bit for bit.

Each topic keeps its three clocks: the log time (when the recorder got a message), the publish time, and the
stamp in the message's own header where it has one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import pairwise

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from data.findings import LogError
from data.integrity import Integrity
from data.mcap import joint_state
from data.mcap.decoding import Decode, decoder
from data.mcap.field_path import FieldPath, Number, resolve, resolve_exactly
from data.mcap.records import ByteArray, gather
from data.mcap.walk import Block, McapWalk
from data.names import nearest, shown

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
_MOST_LAYOUTS = 16  # of one topic, before its messages are decoded one by one
_NO_STAMP = np.iinfo(np.int64).min


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
    walk = McapWalk(content)
    paths: dict[str, list[FieldPath]] = {}
    for path in wanted:
        paths.setdefault(path.topic, []).append(path)
    readers: dict[int, _ChannelReader] = {}
    for block in walk.blocks():
        for number in np.unique(block.messages.channel).tolist():
            channel = walk.channels[number]
            if channel.topic in paths:
                if number not in readers:
                    readers[number] = _reader(walk, channel, paths[channel.topic], clock)
                readers[number].take(block, number)
    topics = {topic: _topic(walk, topic, readers) for topic in paths}
    return McapColumns(
        topics=topics,
        metadata=run_metadata(walk),
        integrity=walk.integrity,
        decoded_singly=sum(reader.singly for reader in readers.values()),
    )


def survey(content: ByteArray) -> Integrity:
    """What is proved of a file's bytes, whatever its messages hold."""
    walk = McapWalk(content)
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
    plain = (
        clock is None
        and channel.message_encoding == "cdr"
        and schema is not None
        and schema.encoding == "ros2msg"
        and joint_state.is_joint_state(schema.name, schema.data.decode(errors="replace"))
        and all(len(path.steps) == 1 and path.steps[0].name in joint_state.SIGNALS for path in paths)
    )
    decode = decoder(channel, schema, exact=clock is not None)
    return _ChannelReader(paths=paths, decode=decode, plain=plain, clock=clock)


def _topic(walk: McapWalk, topic: str, readers: Mapping[int, _ChannelReader]) -> Topic:
    """The topic's columns, from its one channel or from several that took turns."""
    mine = [(number, readers[number].topic()) for number in readers if walk.channels[number].topic == topic]
    if not mine:
        declared = [channel.topic for channel in walk.channels.values()]
        if topic in declared:
            raise LogError(f"topic {topic!r} is declared but holds no message")
        raise LogError(f"no topic {topic!r}; the log has {nearest(topic, declared)}")
    mine.sort(key=lambda pair: int(pair[1].log_time[0]))
    for (_, before), (_, after) in pairwise(mine):
        if before.log_time.max() >= after.log_time.min():
            raise LogError(
                f"topic {shown(topic)!r} is on {len(mine)} channels at the same time: two publishers, and no "
                "way to tell which is the rig's. Keep one of them in the log"
            )
    parts = [part for _, part in mine]
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
    plain: bool  # whether a layout may be proved
    clock: FieldPath | None = None  # which of the paths is the time
    singly: int = 0
    layouts: list[joint_state.Layout] = field(default_factory=list)
    columns: list[FloatArray] = field(default_factory=list)  # (paths, n) a block
    clocks: list[TimeArray] = field(default_factory=list)  # (3, n) a block: log, publish, header
    ticks: list[Decimal] = field(default_factory=list)

    def take(self, block: Block, number: int) -> None:
        """Read this channel's messages of a block."""
        found = block.messages
        mine = np.flatnonzero(found.channel == number)
        begin, length = found.begin[mine], found.length[mine]
        values = np.empty((len(self.paths), mine.size))
        header = np.full(mine.size, _NO_STAMP, np.int64)
        left = np.ones(mine.size, np.bool_)
        if self.plain:
            self._take_layouts(block, begin=begin, length=length, left=left, values=values, header=header)
        for k in np.flatnonzero(left).tolist():
            raw = block.data[int(begin[k]) : int(begin[k] + length[k])].tobytes()
            message = self.decode(raw)
            values[:, k] = [resolve(message, path) for path in self.paths]
            header[k] = header_stamp(message)
            if self.clock is not None:
                self.ticks.append(_exact(resolve_exactly(message, self.clock)))
            self.singly += 1
        self.columns.append(values)
        self.clocks.append(np.stack((found.log_time[mine], found.publish_time[mine], header)))

    def _take_layouts(
        self,
        block: Block,
        *,
        begin: NDArray[np.int64],
        length: NDArray[np.int64],
        left: NDArray[np.bool_],
        values: FloatArray,
        header: TimeArray,
    ) -> None:
        """Take the messages that a layout can be proved of; `left` keeps the others."""
        tried = 0
        while left.any() and tried < _MOST_LAYOUTS:
            if tried == len(self.layouts):
                k = int(np.argmax(left))
                shape = joint_state.recognise(block.data[int(begin[k]) : int(begin[k] + length[k])].tobytes())
                if shape is None:
                    return
                self.layouts.append(shape)
            shape = self.layouts[tried]
            tried += 1
            candidates = np.flatnonzero(left & (length == shape.size))
            if not candidates.size:
                continue
            rows = gather(block.data, begin[candidates], shape.size)
            proved = joint_state.matches(shape, rows)
            if not proved.all():
                candidates, rows = candidates[proved], rows[proved]
            for row, path in enumerate(self.paths):
                values[row, candidates] = joint_state.numbers(rows, _place(shape, path))
            header[candidates] = joint_state.stamps(rows)
            left[candidates] = False

    def topic(self) -> Topic:
        """All that was gathered."""
        values = np.concatenate(self.columns, axis=1)
        clocks = np.concatenate(self.clocks, axis=1)
        return Topic(
            values={path.text: values[row] for row, path in enumerate(self.paths)},
            log_time=clocks[0],
            publish_time=clocks[1],
            header_time=clocks[2] if np.all(clocks[2] != _NO_STAMP) else None,
            ticks=tuple(self.ticks),
        )


def _exact(value: Number) -> Decimal:
    return Decimal(value.item() if isinstance(value, np.integer | np.floating) else value)


def _place(shape: joint_state.Layout, path: FieldPath) -> int:
    """Where the path's number stands in messages of a layout.

    Raises
    ------
    LogError
        When the joint or the element is not there.
    """
    step = path.steps[0]
    count = shape.count(step.name)
    index = step.index
    if step.joint is not None:
        if step.joint not in shape.names:
            raise LogError(
                f"{path.text}: no joint {step.joint!r}; the log has {nearest(step.joint, shape.names)}"
            )
        index = shape.names.index(step.joint)
    elif index is None:
        if count != 1:
            raise LogError(
                f"{path.text} is an array of {count} elements; say which, by [i] from 0 or {{joint}}"
            )
        index = 0
    if index >= count:
        raise LogError(f"{path.text}: {step.name} has {count} elements, so there is no element {index}")
    return shape.place(step.name) + 8 * index


def header_stamp(message: object) -> int:
    """A decoded message's own stamp [ns], or the least integer where it has none."""
    header = _get(message, "header")
    stamp = _get(header, "stamp")
    seconds = _get(stamp, "sec", "secs")
    rest = _get(stamp, "nanosec", "nsec", "nsecs")
    if not isinstance(seconds, int) or not isinstance(rest, int) or abs(seconds) > 2**33 or abs(rest) > 2**33:
        return _NO_STAMP
    return seconds * 1_000_000_000 + rest


def _get(value: object, *names: str) -> object:
    for name in names:
        inside = value.get(name) if isinstance(value, Mapping) else getattr(value, name, None)
        if inside is not None:
            return inside
    return None

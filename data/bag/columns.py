"""Columns of numbers out of a ROS bag: the fields that are wanted of every message of their topics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np

from data.bag.reader import Bag, opened
from data.integrity import Integrity
from data.mcap.columns import McapColumns, Topic, called, joined
from data.mcap.field_path import FieldPath, resolve, resolve_exactly
from data.mcap.stamp import NO_STAMP, header_stamp


@dataclass
class _Gathered:
    """One connection's messages so far."""

    values: list[list[float]] = field(default_factory=list)  # [as logged] a row a message
    log: list[int] = field(default_factory=list)  # [ns]
    header: list[int] = field(default_factory=list)  # [ns]
    ticks: list[Decimal] = field(default_factory=list)

    def topic(self, paths: Sequence[FieldPath]) -> Topic:
        """As columns."""
        values, header = np.array(self.values, np.float64), np.array(self.header, np.int64)
        log = np.array(self.log, np.int64)
        return Topic(
            values={path.text: values[:, k] for k, path in enumerate(paths)},
            log_time=log,
            publish_time=log,
            header_time=header if np.all(header != NO_STAMP) else None,
            ticks=tuple(self.ticks),
        )


def read_columns(path: Path, wanted: Sequence[FieldPath], *, clock: FieldPath | None = None) -> McapColumns:
    """Read the wanted fields; `clock`, one of them, is the time, whose numbers are also kept exactly.

    Raises
    ------
    LogError
        When rosbags is missing, the bag cannot be read, or a topic or field is not in it.
    """
    paths: dict[str, list[FieldPath]] = {}
    for one in wanted:
        paths.setdefault(one.topic, []).append(one)
    with opened(path) as bag:
        gathered = _gathered(bag, paths, clock)
        declared = [connection.topic for connection in bag.connections]
    topics = {
        topic: joined(topic, {number: own.topic(paths[topic]) for number, own in mine.items()}, declared)
        for topic, mine in gathered.items()
    }
    count = sum(len(own.log) for mine in gathered.values() for own in mine.values())
    return McapColumns(topics, {}, Integrity("absent", messages=count), decoded_singly=count)


def _gathered(
    bag: Bag, paths: dict[str, list[FieldPath]], clock: FieldPath | None
) -> dict[str, dict[int, _Gathered]]:
    """The messages of each wanted topic, by the connection that they came on."""
    topics = {own.id: called(own.topic, own.id, paths) for own in bag.connections}
    mine = [connection for connection in bag.connections if topics[connection.id]]
    gathered: dict[str, dict[int, _Gathered]] = {topic: {} for topic in paths}
    for connection, log_time, raw in bag.messages(mine) if mine else ():
        message = bag.decode(bytes(raw), connection.msgtype)
        for topic in topics[connection.id]:
            found, own = gathered[topic].setdefault(connection.id, _Gathered()), paths[topic]
            found.values.append([resolve(message, one) for one in own])
            found.log.append(log_time)
            found.header.append(header_stamp(message))
            if clock in own and clock is not None:
                found.ticks.append(resolve_exactly(message, clock))
    return gathered

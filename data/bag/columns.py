"""Columns of numbers out of a ROS bag: the fields that are wanted of every message of their topics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from data.bag.reader import Bag, opened
from data.findings import LogError
from data.integrity import Integrity
from data.mcap.columns import McapColumns, Topic
from data.mcap.field_path import FieldPath, resolve, resolve_exactly
from data.mcap.stamp import header_stamp
from data.names import nearest, shown

_NO_STAMP = np.iinfo(np.int64).min


@dataclass
class _Gathered:
    """One connection's messages so far."""

    values: list[list[float]] = field(default_factory=list)  # [as logged] a row a message
    log: list[int] = field(default_factory=list)  # [ns]
    header: list[int] = field(default_factory=list)  # [ns]
    ticks: list[Decimal] = field(default_factory=list)


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
        topics = {topic: _topic(bag, topic, paths[topic], gathered) for topic in paths}
        count = sum(len(found.log) for found in gathered.values())
    return McapColumns(topics, {}, Integrity("absent", messages=count), decoded_singly=count)


def _gathered(bag: Bag, paths: dict[str, list[FieldPath]], clock: FieldPath | None) -> dict[int, _Gathered]:
    mine = [connection for connection in bag.connections if connection.topic in paths]
    gathered = {connection.id: _Gathered() for connection in mine}
    for connection, log_time, raw in bag.messages(mine) if mine else ():
        message = bag.decode(bytes(raw), connection.msgtype)
        found, own = gathered[connection.id], paths[connection.topic]
        found.values.append([resolve(message, one) for one in own])
        found.log.append(log_time)
        found.header.append(header_stamp(message))
        if clock in own and clock is not None:
            exact: Any = resolve_exactly(message, clock)
            found.ticks.append(Decimal(exact.item() if isinstance(exact, np.generic) else exact))
    return gathered


def _topic(bag: Bag, topic: str, paths: list[FieldPath], gathered: dict[int, _Gathered]) -> Topic:
    """A topic's columns, from its one publisher or from several that took turns."""
    names = [connection.topic for connection in bag.connections]
    parts = [
        gathered[connection.id]
        for connection in bag.connections
        if connection.topic == topic and gathered[connection.id].log
    ]
    if not parts:
        if topic in names:
            raise LogError(f"topic {shown(topic)!r} is declared but holds no message")
        raise LogError(f"no topic {shown(topic)!r}; the log has {nearest(topic, names)}")
    parts.sort(key=lambda part: part.log[0])
    for before, after in pairwise(parts):
        if max(before.log) >= min(after.log):
            raise LogError(
                f"topic {shown(topic)!r} has {len(parts)} publishers at the same time, and no way to tell "
                "which is the rig's. Keep one of them in the log"
            )
    values = np.array([row for part in parts for row in part.values], np.float64)
    log = np.array([stamp for part in parts for stamp in part.log], np.int64)
    header = np.array([stamp for part in parts for stamp in part.header], np.int64)
    return Topic(
        values={path.text: values[:, k] for k, path in enumerate(paths)},
        log_time=log,
        publish_time=log,
        header_time=header if np.all(header != _NO_STAMP) else None,
        ticks=tuple(tick for part in parts for tick in part.ticks),
    )

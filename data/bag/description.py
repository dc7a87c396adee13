"""What a ROS bag holds, with no settings, in the same words as an MCAP file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from data.bag.reader import Bag, opened
from data.clocks import clock_report_ns
from data.findings import LogError
from data.integrity import Integrity
from data.mcap.description import ChannelDescription, Field, McapDescription, described_fields


def describe(path: Path) -> McapDescription:
    """Describe a bag; raises LogError where rosbags is missing, or it cannot be read."""
    with opened(path) as bag:
        stamps: dict[int, list[int]] = {}
        first: dict[int, bytes] = {}
        for connection, log_time, raw in bag.messages(list(bag.connections)) if bag.connections else ():
            stamps.setdefault(connection.id, []).append(log_time)
            first.setdefault(connection.id, bytes(raw))
        channels = tuple(
            _channel(bag, connection, first[connection.id], stamps[connection.id])
            for connection in bag.connections
            if connection.id in stamps
        )
        empty = tuple(c.topic for c in bag.connections if c.id not in stamps)
    return McapDescription(
        profile=bag.profile,
        library="",
        compressions={},
        indexed=True,
        channels=channels,
        unlisted=0,
        empty_topics=empty,
        metadata={},
        attachments=(),
        integrity=Integrity("absent", messages=sum(map(len, stamps.values()))),
    )


def _channel(bag: Bag, connection: Any, first: bytes, stamps: list[int]) -> ChannelDescription:
    fields: tuple[Field, ...] = ()
    refused = None
    try:
        fields = described_fields(bag.decode(first, connection.msgtype))
    except Exception as error:  # a foreign decoder on foreign bytes may raise anything
        refused = str(error) if isinstance(error, LogError) else f"it cannot be decoded ({error})"
    return ChannelDescription(
        number=connection.id,
        topic=connection.topic,
        encoding="ros1" if bag.profile == "ros1" else "cdr",
        schema=connection.msgtype,
        schema_encoding="",
        fields=fields,
        refused=refused,
        log_clock=clock_report_ns(np.array(stamps, np.int64)),
        header_clock=None,
    )

"""A ROS bag opened through rosbags, whatever it raises becoming one error that says what to do.

rosbags is an extra, loaded when a bag is opened. Its reader of ROS 1 bags unpacks chunks without a limit:
they are unpacked here instead, no further than a log would (`data.unpacking`).
"""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Final

import lz4.frame

from data.findings import LogError
from data.names import shown
from data.unpacking import over_limit

_STEP: Final = 1 << 20  # [bytes] that are unpacked at once
_LONGEST: Final = 1 << 24  # elements of one array in a message


@dataclass(frozen=True)
class Bag:
    """An opened bag."""

    profile: str  # "ros1" or "ros2"
    connections: tuple[Any, ...]  # of rosbags: id, topic, msgtype, msgcount
    messages: Callable[[list[Any]], Iterator[tuple[Any, int, bytes]]]  # connection, log time [ns], bytes
    decode: Callable[[bytes, str], Mapping[str, object]]  # a message of a type, as a mapping


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a bag.

    Raises
    ------
    LogError
        When rosbags is not installed, or the file cannot be read: in here, or in the block.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1  # noqa: PLC0415  (an extra)
        from rosbags.rosbag2 import Reader as Reader2  # noqa: PLC0415
    except ImportError as error:
        raise LogError(
            "ROS bags are read through rosbags, which is not installed: pip install stribeck[bags]"
        ) from error
    one = path.suffix.lower() == ".bag"
    try:
        with (Reader1 if one else Reader2)(path) as reader:
            if one:
                _limit(reader)
            store = _types(reader.connections)
            decode = store.deserialize_ros1 if one else store.deserialize_cdr
            yield Bag(
                profile="ros1" if one else "ros2",
                connections=tuple(reader.connections),
                messages=lambda wanted: reader.messages(connections=wanted),
                decode=lambda raw, kind: _mapping(decode(raw, kind)),
            )
    except LogError:
        raise
    except Exception as error:  # a foreign reader on foreign bytes may raise anything
        raise LogError(
            f"it cannot be read as a ROS bag ({shown(f'{type(error).__name__}: {error}', 200)}); a bag that "
            "was cut off is mended by `rosbag reindex` or `ros2 bag reindex`"
        ) from error


def _types(connections: list[Any]) -> Any:
    """The types of the messages: as the bag defines them, else those of ROS 2."""
    from rosbags.interfaces import MessageDefinitionFormat as Form  # noqa: PLC0415
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore  # noqa: PLC0415

    found: dict[str, Any] = {}
    for connection in connections:
        definition = connection.msgdef
        if definition.format == Form.MSG:
            found |= get_types_from_msg(definition.data, connection.msgtype)
        elif definition.format == Form.IDL:
            found |= get_types_from_idl(definition.data)
    store = get_typestore(Stores.EMPTY)
    store.max_sequence_length = _LONGEST
    store.register(found or get_typestore(Stores.LATEST).fielddefs)
    return store


def _limit(reader: Any) -> None:
    """Have the chunks of a ROS 1 bag unpacked under a limit."""
    for place, chunk in list(reader.chunks.items()):
        reader.chunks[place] = chunk._replace(decompressor=_unpacked)


def _unpacked(packed: bytes) -> bytes:
    """A chunk unpacked, as its first bytes say how."""
    parts: list[bytes] = []
    total, left = 0, packed
    while left[:3] == b"BZh" or left[:4] == b"\x04\x22\x4d\x18":
        stream: Any = bz2.BZ2Decompressor() if left[:3] == b"BZh" else lz4.frame.LZ4FrameDecompressor()
        parts.append(stream.decompress(left, _STEP))
        total += len(parts[-1])
        while not stream.eof and not stream.needs_input:
            parts.append(stream.decompress(b"", _STEP))
            total += len(parts[-1])
            if over_limit(total, len(packed)):
                raise LogError(f"a chunk of {len(packed)} bytes unpacks to over {total}: no log does")
        if not stream.eof:
            raise LogError("a chunk is cut off")
        left = stream.unused_data or b""
    return b"".join(parts) if parts else packed


def _mapping(message: object) -> Any:
    """A message as mappings of its fields, arrays of messages included."""
    if is_dataclass(message):
        return {field.name: _mapping(getattr(message, field.name)) for field in fields(message)}
    if isinstance(message, list):
        return [_mapping(inside) for inside in message]
    return message

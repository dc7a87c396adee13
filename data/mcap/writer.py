"""A rig log as MCAP, written: one joint's states, and whatever else was sampled with them.

Every sample k becomes one `sensor_msgs/msg/JointState` message with the stamp t_k in its header, which is
also its log and publish time, in ROS 2 CDR or as JSON with a schema. Other signals on the same clock (a
command, a reference) go to topics of their own as JointState messages that carry a position only.

What is written opens in mcap's own reader, in ROS 2 tools and in the viewers that read MCAP.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, Literal

import numpy as np
from numpy.typing import NDArray

from data.files import write_atomically
from data.findings import LogError
from data.mcap import joint_state
from data.mcap.container import MESSAGE_HEADER, Compression, ContainerWriter, Indexed

FloatArray = NDArray[np.float64]
Encoding = Literal["cdr", "json"]
METADATA_NAME: Final = "stribeck"  # the metadata record that carries a run's settings
_CHUNK_BYTES: Final = 1 << 20
_NUMBERS: Final = {"type": "array", "items": {"type": "number"}}
_INTEGER: Final = {"type": "integer"}
_JSON_SCHEMA: Final = {
    "title": "JointState",
    "type": "object",
    "properties": {
        "header": {
            "type": "object",
            "properties": {
                "stamp": {"type": "object", "properties": {"sec": _INTEGER, "nanosec": _INTEGER}},
                "frame_id": {"type": "string"},
            },
        },
        "name": {"type": "array", "items": {"type": "string"}},
        "position": _NUMBERS,
        "velocity": _NUMBERS,
        "effort": _NUMBERS,
    },
}


@dataclass(frozen=True)
class _Topic:
    """One topic's arrays: those of position, velocity and effort that it carries."""

    channel: int
    joint: str
    signals: dict[str, FloatArray]


def write_mcap(
    path: Path,
    *,
    topic: str = "/joint_states",
    joint: str = "link",
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray | None = None,
    effort: FloatArray | None = None,
    metadata: Mapping[str, str] | None = None,
    encoding: Encoding = "cdr",
    extra: Mapping[str, FloatArray] | None = None,
    compression: Compression = "zstd",
    epoch: int = 0,
) -> None:
    """Write one run, whole or not at all.

    Parameters
    ----------
    path
        The file; folders on the way are made.
    topic, joint
        Where the joint's states go, and its name in them.
    time
        (n,) stamps [s] from `epoch`, kept to the nanosecond; increasing.
    position, velocity, effort
        (n,) in the units that the log shall carry [rad], [rad/s], [N m]; absent ones become empty arrays.
    metadata
        Text by key, in a metadata record named "stribeck" (`simulated = true` marks a virtual rig's log).
    encoding
        "cdr" (ROS 2) or "json" (with a JSON schema).
    extra
        Further topics: each (n,) array becomes JointState messages with a position only.
    compression
        Of the chunks.
    epoch
        [ns] since 1970 of time 0.

    Raises
    ------
    LogError
        When an array's length is not that of `time`, or a stamp does not fit.
    """
    stamp = _stamps(time, epoch)
    signals = {"position": position, "velocity": velocity, "effort": effort}
    states = {name: array for name, array in signals.items() if array is not None}
    topics = {topic: states} | {name: {"position": array} for name, array in (extra or {}).items()}
    for name, arrays in topics.items():
        for signal, array in arrays.items():
            if array.shape != stamp.shape:
                raise LogError(
                    f"{path.name}: {name}:{signal} has shape {array.shape}, time has {stamp.shape}"
                )

    def write(stream: BinaryIO) -> None:
        writer = ContainerWriter(stream, profile="ros2" if encoding == "cdr" else "", compression=compression)
        schema = _declare(writer, encoding)
        channels = [
            _Topic(writer.channel(name, encoding=encoding, schema=schema), joint, arrays)
            for name, arrays in topics.items()
        ]
        if metadata:
            writer.metadata(METADATA_NAME, metadata)
        _write_chunks(writer, channels, stamp=stamp, encoding=encoding)
        writer.finish()

    write_atomically(path, write)


def _stamps(time: FloatArray, epoch: int) -> NDArray[np.int64]:
    """Nanoseconds since 1970; MCAP's stamps are unsigned."""
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.abs(time) > 2.0**31):
        raise LogError("the times to write must be a row of finite seconds below 2^31")
    stamp: NDArray[np.int64] = np.rint(time * 1e9).astype(np.int64) + epoch
    if stamp.size and stamp.min() < 0:
        raise LogError(f"a log's stamps cannot lie before 1970; the first is {stamp.min() * 1e-9:g} s")
    return stamp


def _declare(writer: ContainerWriter, encoding: Encoding) -> int:
    if encoding == "cdr":
        return writer.schema(joint_state.SCHEMA_NAME, encoding="ros2msg", text=joint_state.SCHEMA)
    return writer.schema("JointState", encoding="jsonschema", text=json.dumps(_JSON_SCHEMA))


def _write_chunks(
    writer: ContainerWriter, topics: list[_Topic], *, stamp: NDArray[np.int64], encoding: Encoding
) -> None:
    per_sample = 200 * len(topics)  # bytes, roughly; only the size of a chunk hangs on it
    samples = max(1, _CHUNK_BYTES // per_sample)
    records = _cdr_records if encoding == "cdr" else _json_records
    for begin in range(0, stamp.size, samples):
        part = slice(begin, min(begin + samples, stamp.size))
        writer.chunk(*records(topics, stamp=stamp[part], part=part))


def _cdr_records(
    topics: list[_Topic], *, stamp: NDArray[np.int64], part: slice
) -> tuple[bytes, list[Indexed]]:
    """Message records of samples `part`, the topics of a sample side by side."""
    columns, offsets, width = [], [], 0
    for topic in topics:
        counts = [int(signal in topic.signals) for signal in joint_state.SIGNALS]
        shape = joint_state.layout(frame="", names=(topic.joint,), counts=(counts[0], counts[1], counts[2]))
        signals = {name: array[part] for name, array in topic.signals.items()}
        body = joint_state.encode(shape, stamp=stamp, signals=signals)
        header = _message_headers(topic, stamp=stamp, first=part.start, sizes=np.array(shape.size))
        columns += [header.view(np.uint8).reshape(stamp.size, -1), body]
        offsets.append(width)
        width += MESSAGE_HEADER.itemsize + shape.size
    block = np.concatenate(columns, axis=1)
    row = np.arange(stamp.size, dtype=np.int64) * width
    return block.tobytes(), [
        Indexed(topic.channel, stamp, row + offset) for topic, offset in zip(topics, offsets, strict=True)
    ]


def _json_records(
    topics: list[_Topic], *, stamp: NDArray[np.int64], part: slice
) -> tuple[bytes, list[Indexed]]:
    """The same with JSON bodies, whose sizes differ."""
    bodies = [_json_bodies(topic, stamp=stamp, part=part) for topic in topics]
    sizes = np.array([[len(body) for body in column] for column in bodies], np.int64)  # (topics, samples)
    headers = [
        _message_headers(topic, stamp=stamp, first=part.start, sizes=size).tobytes()
        for topic, size in zip(topics, sizes, strict=True)
    ]
    head = MESSAGE_HEADER.itemsize
    block = b"".join(
        header[k * head : (k + 1) * head] + column[k]
        for k in range(stamp.size)
        for header, column in zip(headers, bodies, strict=True)
    )
    ends = np.cumsum((sizes + head).T.ravel())
    starts = np.concatenate(([0], ends[:-1])).reshape(stamp.size, len(topics))
    return block, [Indexed(topic.channel, stamp, starts[:, i]) for i, topic in enumerate(topics)]


def _json_bodies(topic: _Topic, *, stamp: NDArray[np.int64], part: slice) -> list[bytes]:
    names = json.dumps([topic.joint])
    seconds, nanoseconds = (piece.tolist() for piece in np.divmod(stamp, 1_000_000_000))
    empty = [""] * stamp.size
    numbers = [
        [_json_number(x) for x in topic.signals[signal][part].tolist()] if signal in topic.signals else empty
        for signal in joint_state.SIGNALS
    ]
    return [
        f'{{"header":{{"stamp":{{"sec":{s},"nanosec":{ns}}},"frame_id":""}},"name":{names},'
        f'"position":[{q}],"velocity":[{v}],"effort":[{u}]}}'.encode()
        for s, ns, q, v, u in zip(seconds, nanoseconds, *numbers, strict=True)
    ]


def _json_number(value: float) -> str:
    if value - value != 0.0:
        raise LogError(f"JSON has no word for {value}; write this log as CDR")
    return repr(value)


def _message_headers(
    topic: _Topic, *, stamp: NDArray[np.int64], first: int, sizes: NDArray[np.int64]
) -> NDArray[np.void]:
    header: NDArray[np.void] = np.zeros(stamp.size, MESSAGE_HEADER)
    header["opcode"] = 5
    header["length"] = sizes + (MESSAGE_HEADER.itemsize - 9)
    header["channel"] = topic.channel
    header["sequence"] = np.arange(first, first + stamp.size)
    header["log_time"] = header["publish_time"] = stamp
    return header

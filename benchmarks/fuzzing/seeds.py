"""Small logs to be damaged, as the product's own writer and the mcap library make them."""

from __future__ import annotations

import io
import json
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from data.csv.log import write_csv
from data.mcap import joint_state
from data.mcap.container import Compression
from data.mcap.writer import Encoding, write_mcap

BEGIN: Final = 1_700_000_000_000_000_000  # [ns]
STEP: Final = 1_000_000
TOPIC: Final = "/joint_states"
Guard = Literal["chunk", "file", "none", "table"]


@dataclass(frozen=True)
class Seed:
    """One small log.

    `guard` says what vouches for its messages: a checksum for each chunk, one for the whole data section,
    nothing, or that it is a table.
    """

    name: str
    content: bytes
    guard: Guard


@cache
def seeds(samples: int = 20) -> tuple[Seed, ...]:
    """All seeds, each of `samples` messages or rows."""
    own: tuple[tuple[Encoding, Compression], ...] = (("cdr", "zstd"), ("cdr", "none"), ("json", "lz4"))
    listed = [
        Seed(f"own {encoding} {pack}", _own(samples, encoding, pack), "chunk") for encoding, pack in own
    ]
    for compression in CompressionType:
        name = compression.name.lower()
        chunks = _peer(samples, "cdr", chunk_size=450, compression=compression)
        listed.append(Seed(f"chunks cdr {name}", chunks, "chunk"))
    bare = _peer(samples, "json", chunk_size=450, compression=CompressionType.NONE, enable_crcs=False)
    listed.append(Seed("chunks json none, no checksum", bare, "none"))
    loose: dict[str, Any] = {"use_chunking": False, "index_types": IndexType.NONE}
    fastwrite = {"use_statistics": False, "use_summary_offsets": False, "enable_crcs": False}
    nothing = {"repeat_channels": False, "repeat_schemas": False}
    listed += [
        Seed("loose cdr, no checksum", _peer(samples, "cdr", **loose, **fastwrite, **nothing), "none"),
        Seed("loose json, no checksum, summary", _peer(samples, "json", **loose, enable_crcs=False), "none"),
        Seed("loose cdr, checksum", _peer(samples, "cdr", **loose, enable_data_crcs=True), "file"),
        Seed("table", _table(samples), "table"),
        Seed("table, decimal comma", _table(samples).replace(b",", b";").replace(b".", b","), "table"),
    ]
    return tuple(listed)


def _signals(samples: int) -> tuple[np.ndarray[Any, np.dtype[np.float64]], ...]:
    time = np.arange(samples, dtype=np.float64) * (STEP * 1e-9)
    return time, np.sin(40.0 * time) + 0.5, np.cos(37.0 * time) - 0.25


def _own(samples: int, encoding: Encoding, compression: Compression) -> bytes:
    time, position, effort = _signals(samples)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        write_mcap(
            path,
            topic=TOPIC,
            time=time,
            position=position,
            effort=effort,
            metadata={"r": "0.9"},
            encoding=encoding,
            compression=compression,
            epoch=BEGIN,
        )
        return path.read_bytes()


def _peer(samples: int, encoding: Encoding, **options: Any) -> bytes:
    stream = io.BytesIO()
    writer = Writer(stream, **options)
    writer.start(profile="ros2" if encoding == "cdr" else "")
    if encoding == "cdr":
        schema = writer.register_schema(joint_state.SCHEMA_NAME, "ros2msg", joint_state.SCHEMA.encode())
        encode = serialize_dynamic(joint_state.SCHEMA_NAME, joint_state.SCHEMA)[joint_state.SCHEMA_NAME]
    else:
        schema = writer.register_schema("JointState", "jsonschema", b'{"type": "object"}')
        encode = _json
    channel = writer.register_channel(TOPIC, encoding, schema)
    other = writer.register_channel("/note", "json", 0)
    writer.add_attachment(BEGIN, BEGIN, "calibration.txt", "text/plain", b"gain 0.12\n")
    writer.add_metadata("rig", {"r": "0.9"})
    for k, (_, position, effort) in enumerate(zip(*_signals(samples), strict=True)):
        at = BEGIN + k * STEP
        stamp = {"sec": at // 10**9, "nanosec": at % 10**9}
        message = {
            "header": {"stamp": stamp, "frame_id": "base"},
            "name": ["link"],
            "position": [float(position)],
            "velocity": [],
            "effort": [float(effort)],
        }
        writer.add_message(channel, at, encode(message), at, k)
        if k % 7 == 3:
            writer.add_message(other, at, b'{"x": 1}', at, k)
    writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves this one untyped
    return stream.getvalue()


def _json(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode()


def _table(samples: int) -> bytes:
    time, position, effort = _signals(samples)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        write_csv(path, columns={"t [s]": time, "q [rad]": position, "i [A]": effort}, metadata={"r": "0.9"})
        return path.read_bytes()

"""Small MCAP files, honest and otherwise, built record by record."""

import struct
import zlib
from pathlib import Path

import numpy as np

from data.mcap.container import MAGIC
from data.mcap.writer import Encoding, write_mcap


def record(opcode: int, content: bytes, claimed: int | None = None) -> bytes:
    """A record that may lie about its length."""
    return struct.pack("<BQ", opcode, len(content) if claimed is None else claimed) + content


def text(value: str) -> bytes:
    """A string with its length."""
    raw = value.encode()
    return struct.pack("<I", len(raw)) + raw


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    return record(
        3, struct.pack("<H", number) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data
    )


def channel(number: int, schema_number: int, topic: str, encoding: str) -> bytes:
    return record(
        4, struct.pack("<HH", number, schema_number) + text(topic) + text(encoding) + struct.pack("<I", 0)
    )


def message(number: int, time: int, data: bytes, sequence: int = 0) -> bytes:
    return record(5, struct.pack("<HIQQ", number, sequence, time, time) + data)


def chunk(
    content: bytes,
    *,
    compression: str = "",
    packed: bytes | None = None,
    size: int | None = None,
    checksum: bool | None = None,
) -> bytes:
    body = content if packed is None else packed
    checked = packed is None if checksum is None else checksum
    head = struct.pack(
        "<QQQI", 0, 1, len(content) if size is None else size, zlib.crc32(content) if checked else 0
    )
    return record(6, head + text(compression) + struct.pack("<Q", len(body)) + body)


def file(*records: bytes, end: bool = True) -> bytes:
    """A file without index: header, the records, data end, footer."""
    tail = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC if end else b""
    return MAGIC + record(1, text("") + text("test")) + b"".join(records) + tail


def run(path: Path, n: int = 50, *, encoding: Encoding = "cdr", compression: str = "zstd") -> bytes:
    """A short honest run as our own writer makes it; its bytes."""
    t = np.arange(n, dtype=np.float64) * 1e-3
    write_mcap(
        path,
        time=t,
        position=np.sin(t),
        velocity=np.cos(t),
        effort=0.1 * t,
        metadata={"simulated": "true", "r": "0.9"},
        encoding=encoding,
        compression=compression,  # type: ignore[arg-type]  # the tests name it as a word
        epoch=1_700_000_000_000_000_000,
    )
    return path.read_bytes()

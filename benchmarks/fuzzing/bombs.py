"""Bombs and lies: files of a few kilobytes that ask for gigabytes, for minutes, or for belief.

Each is made and then read in a process of its own: refused or told as damaged within a second and 256 MB,
whatever it claims.
"""

from __future__ import annotations

import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import lz4.frame
import numpy as np
import zstandard

from benchmarks.fuzzing.memory import peak_memory
from data.mcap.container import MAGIC

MOST_TIME: Final = 1.0  # [s]
MOST_MEMORY: Final = 256 << 20  # [bytes] resident
WATCHDOG: Final = 30.0  # [s]


@dataclass(frozen=True)
class BombResult:
    """What reading one bomb took."""

    seconds: float
    memory: int  # resident at most [bytes]
    wrong: str  # what must not be; empty for nothing


def record(opcode: int, content: bytes, claimed: int | None = None) -> bytes:
    """A record that may lie about its length."""
    return struct.pack("<BQ", opcode, len(content) if claimed is None else claimed) + content


def text(value: str) -> bytes:
    """A string with its length."""
    return struct.pack("<I", len(value.encode())) + value.encode()


def schema(number: int, body: bytes, *, name: str = "pkg/msg/T", encoding: str = "ros2msg") -> bytes:
    """A schema record."""
    size = struct.pack("<I", len(body))
    return record(3, struct.pack("<H", number) + text(name) + text(encoding) + size + body)


def channel(number: int, of: int = 0, topic: str = "/a", encoding: str = "json") -> bytes:
    """A channel record."""
    return record(4, struct.pack("<HH", number, of) + text(topic) + text(encoding) + bytes(4))


def message(number: int, at: int, body: bytes = b"{}") -> bytes:
    """A message record."""
    return record(5, struct.pack("<HIQQ", number, 0, at, at) + body)


def chunk(packed: bytes, *, name: str, size: int, checksum: int = 0) -> bytes:
    """A chunk record that may lie about its size."""
    head = struct.pack("<QQQI", 1, 2, size, checksum)
    return record(6, head + text(name) + struct.pack("<Q", len(packed)) + packed)


def zstd(content: bytes, *, copies: int = 1, size: int | None = None) -> bytes:
    """Chunks of packed content."""
    packed = zstandard.ZstdCompressor(level=3).compress(content)
    return chunk(packed, name="zstd", size=len(content) if size is None else size) * copies


def file(*parts: bytes, tail: bytes | None = None) -> bytes:
    """A file around records."""
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    return MAGIC + record(1, text("") + text("")) + b"".join(parts) + (end if tail is None else tail)


def _window() -> bytes:
    """A zstd frame that asks for a window of 2 GiB."""
    small = zstandard.ZstdCompressor(
        compression_params=zstandard.ZstdCompressionParameters(window_log=30)
    ).compressobj()
    return small.compress(bytes(1000)) + small.flush()


def _nested_schema(depth: int) -> bytes:
    """A message type that holds another, and so on."""
    line = "=" * 80
    parts = [f"pkg/T{k + 1} x\n" for k in range(depth)]
    body = parts[0] + "".join(f"{line}\nMSG: pkg/T{k}\n{parts[k]}" for k in range(1, depth))
    return (body + f"{line}\nMSG: pkg/T{depth}\nfloat64 y\n").encode()


def _doubling_schema(depth: int) -> bytes:
    """A message type that holds the next twice: 2 ** depth numbers."""
    line = "=" * 80
    body = "pkg/T1 a\npkg/T1 b\n"
    body += "".join(f"{line}\nMSG: pkg/T{k}\npkg/T{k + 1} a\npkg/T{k + 1} b\n" for k in range(1, depth))
    return (body + f"{line}\nMSG: pkg/T{depth}\nfloat64 y\n").encode()


def _entries(count: int) -> bytes:
    inside = b"".join(text(f"{k}") + text("") for k in range(count))
    return record(12, text("m") + struct.pack("<I", len(inside)) + inside)


def _offsets() -> bytes:
    """A footer whose summary lies past the end."""
    return record(15, bytes(4)) + record(2, struct.pack("<QQI", 1 << 62, 1 << 63, 1)) + MAGIC


def _nested_chunks(depth: int) -> bytes:
    inside = message(1, 1)
    for _ in range(depth):
        inside = chunk(inside, name="", size=len(inside), checksum=zlib.crc32(inside))
    return inside


def _quine() -> bytes:
    """Messages of no bytes, as many as a chunk may hold."""
    return zstd(channel(1) + record(5, struct.pack("<HIQQ", 1, 0, 1, 1)) * 1_500_000)


_MILLIONS: Final = bytes(60 << 20)
_CDR: Final = b"\0\1\0\0"
BOMBS: Final[dict[str, Callable[[], bytes]]] = {
    "zstd that says 2 GiB": lambda: file(zstd(_MILLIONS, size=2 << 30)),
    "zstd that says 1 byte": lambda: file(zstd(_MILLIONS, size=1)),
    "zstd of zeros, a hundred chunks": lambda: file(zstd(_MILLIONS, copies=100)),
    "zeros behind noise": lambda: file(
        record(9, np.random.default_rng(1).bytes(6 << 20)), zstd(_MILLIONS, copies=10)
    ),
    "zstd with a window of 1 GiB": lambda: file(chunk(_window(), name="zstd", size=1000)),
    "lz4 that says 2 GiB": lambda: file(chunk(lz4.frame.compress(_MILLIONS), name="lz4", size=2 << 30)),
    "lz4 that says 1 byte": lambda: file(chunk(lz4.frame.compress(_MILLIONS), name="lz4", size=1)),
    "lz4 of zeros": lambda: file(chunk(lz4.frame.compress(_MILLIONS), name="lz4", size=len(_MILLIONS))),
    "a record of 1 TiB": lambda: file(record(5, b"x" * 30, claimed=1 << 40), tail=b""),
    "a chunk of 1 TiB": lambda: file(chunk(b"x", name="", size=1 << 40)),
    "a chunk's data of 1 TiB": lambda: file(
        record(6, struct.pack("<QQQI", 1, 2, 9, 0) + text("") + b"\0\0\0\0\0\1\0\0")
    ),
    "the largest length": lambda: file(record(12, b"", claimed=2**64 - 1)),
    "records of no bytes": lambda: file(record(5, b"") * 300_000),
    "opcode 0": lambda: file(bytes(9) * 300_000),
    "unknown records of no bytes": lambda: file(zstd(record(200, b"") * 3_000_000)),
    "messages of no bytes": lambda: file(_quine()),
    "lengths within lengths": lambda: file(record(3, struct.pack("<HI", 1, 2**32 - 1) + b"x" * 40)),
    "chunks within chunks": lambda: file(_nested_chunks(200)),
    "offsets past the end": lambda: file(channel(1), message(1, 1), tail=_offsets()),
    "a million metadata entries": lambda: file(_entries(1_000_000)),
    "metadata records": lambda: file(_entries(1) * 50_000),
    "schemas": lambda: file(zstd(b"".join(schema(k, b"", encoding="x") for k in range(1, 65_536)), copies=4)),
    "channels": lambda: file(
        zstd(b"".join(channel(k, topic=f"/{k}") + message(k, k + 1) for k in range(65_536)))
    ),
    "a topic of 20 MB": lambda: file(channel(1, topic="x" * 20_000_000), message(1, 1)),
    "a schema nested deeply": lambda: file(
        schema(1, _nested_schema(20_000)), channel(1, 1, encoding="cdr"), message(1, 1, _CDR + bytes(8))
    ),
    "a schema that doubles": lambda: file(
        schema(1, _doubling_schema(30)), channel(1, 1, encoding="cdr"), message(1, 1, _CDR + bytes(8))
    ),
    "an array of 4 G numbers": lambda: file(
        schema(1, b"float64[] x"), channel(1, 1, encoding="cdr"), message(1, 1, _CDR + b"\xff" * 4)
    ),
    "a fixed array of 1 G numbers": lambda: file(
        schema(1, b"float64[1000000000] x"), channel(1, 1, encoding="cdr"), message(1, 1, _CDR + bytes(8))
    ),
    "JSON nested deeply": lambda: file(channel(1), message(1, 1, b"[" * 1_000_000)),
    "a JSON number of a million digits": lambda: file(
        channel(1), message(1, 1, b'{"x": ' + b"9" * 1_000_000 + b"}")
    ),
    "candidates for a record": lambda: file(
        channel(1), message(1, 1), b"\0", (record(5, struct.pack("<HIQQ", 1, 0, 1, 1)) + b"\0") * 100_000
    ),
    "the smallest chunks": lambda: file(chunk(b"", name="", size=0) * 20_000),
    "statistics": lambda: file(record(11, bytes(42) + struct.pack("<I", 650_000) + bytes(650_000)) * 10),
}


def read_bomb(name: str) -> BombResult:
    """Read a bomb in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bomb.mcap"
        path.write_bytes(BOMBS[name]())
        command = [sys.executable, "-m", "benchmarks.fuzzing.bombs", str(path)]
        try:
            run = subprocess.run(  # noqa: S603  # our own module
                command, capture_output=True, text=True, check=False, timeout=WATCHDOG
            )
        except subprocess.TimeoutExpired:
            return BombResult(WATCHDOG, 0, f"runs for over {WATCHDOG:g} s")
    if run.returncode:
        return BombResult(0.0, 0, run.stderr.strip().splitlines()[-1])
    seconds, memory = run.stdout.split()
    wrong = "" if int(memory) <= MOST_MEMORY else f"takes {int(memory) >> 20} MB"
    return BombResult(float(seconds), int(memory), wrong)


def main(path: Path) -> None:
    """Describe the file and read it, and print the time [s] and the memory [bytes] that it took."""
    from data.files import read_bytes  # noqa: PLC0415
    from data.findings import LogError  # noqa: PLC0415  # a light process
    from data.mcap.columns import read_columns  # noqa: PLC0415
    from data.mcap.description import describe  # noqa: PLC0415
    from data.mcap.field_path import parse_path  # noqa: PLC0415

    begun = time.perf_counter()
    content = read_bytes(path, log=path.name)
    describe(content)
    with suppress(LogError):
        read_columns(content, [parse_path("/a:x")])
    taken = time.perf_counter() - begun
    print(taken, peak_memory())


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""How a log is damaged: at random bytes, at its records' lengths and offsets, and within packed chunks.

The records of an intact log are known, so damage can be put where it hurts: a length, an offset of the
summary, the bytes of a chunk once unpacked. A chunk that is packed again keeps its old checksum.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final

import lz4.frame
import zstandard
from numpy.random import Generator

from data.mcap.container import MAGIC

Mutation = Callable[[bytes, Generator], bytes]
_EDGES: Final = (0, 1, 2, 0x7F, 0x80, 0xFFFF, 1 << 31, (1 << 32) - 1, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)


def records(content: bytes) -> list[tuple[int, int, int]]:
    """Opcode, first byte and end of every record of an intact log; none in a table."""
    found: list[tuple[int, int, int]] = []
    here = len(MAGIC)
    if not content.startswith(MAGIC):
        return found
    while here < len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, here)
        found.append((opcode, here, here + 9 + length))
        here += 9 + length
    return found


def mutate(content: bytes, rng: Generator) -> tuple[str, bytes]:
    """One to three mutations, and their names."""
    names: list[str] = []
    whole = content
    for _ in range(int(rng.choice((1, 1, 1, 2, 3)))):
        name = str(rng.choice(list(MUTATIONS)))
        # What knows records needs an intact log; after the first mutation, only bytes are known.
        if names and name in _OF_RECORDS:
            name = "flip"
        names.append(name)
        content = MUTATIONS[name](content, rng) if content else whole
    return " + ".join(names), content


def _span(content: bytes, rng: Generator) -> tuple[int, int]:
    begin = int(rng.integers(len(content)))
    size = int(rng.integers(1, 1 + min(len(content), int(rng.choice((4, 64, 1024))))))
    return begin, min(begin + size, len(content))


def _truncate(content: bytes, rng: Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def _flip(content: bytes, rng: Generator) -> bytes:
    mutant = bytearray(content)
    for _ in range(int(rng.choice((1, 1, 2, 8)))):
        mutant[int(rng.integers(len(mutant)))] ^= 1 << int(rng.integers(8))
    return bytes(mutant)


def _fill(content: bytes, rng: Generator) -> bytes:
    begin, end = _span(content, rng)
    kind = int(rng.integers(3))
    noise = rng.bytes(end - begin) if kind == 2 else bytes([0xFF * kind]) * (end - begin)
    return content[:begin] + noise + content[end:]


def _delete(content: bytes, rng: Generator) -> bytes:
    begin, end = _span(content, rng)
    return content[:begin] + content[end:]


def _duplicate(content: bytes, rng: Generator) -> bytes:
    begin, end = _span(content, rng)
    return content[:end] + content[begin:]


def _swap(content: bytes, rng: Generator) -> bytes:
    (a, b), (c, d) = sorted((_span(content, rng), _span(content, rng)))
    c, d = max(b, c), max(b, d)
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _swap_records(content: bytes, rng: Generator) -> bytes:
    listed = records(content)
    if len(listed) < 2:
        return _swap(content, rng)
    one, other = sorted(rng.choice(len(listed), 2, replace=False).tolist())
    (_, a, b), (_, c, d) = listed[one], listed[other]
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _repeat_record(content: bytes, rng: Generator) -> bytes:
    listed = records(content)
    if not listed:
        return _duplicate(content, rng)
    _, begin, end = listed[int(rng.integers(len(listed)))]
    place = listed[int(rng.integers(len(listed)))][1]
    return content[:place] + content[begin:end] + content[place:]


def _delete_record(content: bytes, rng: Generator) -> bytes:
    listed = records(content)
    if not listed:
        return _delete(content, rng)
    _, begin, end = listed[int(rng.integers(len(listed)))]
    return content[:begin] + content[end:]


def _length(content: bytes, rng: Generator) -> bytes:
    """Another length of a record."""
    listed = records(content)
    if not listed:
        return _flip(content, rng)
    _, begin, end = listed[int(rng.integers(len(listed)))]
    near = max(end - begin - 9 + int(rng.integers(-40, 41)), 0)
    value = near if rng.random() < 0.5 else int(rng.choice(len(_EDGES)))
    value = value if value == near else _EDGES[value]
    return content[: begin + 1] + struct.pack("<Q", value) + content[begin + 9 :]


def _offset(content: bytes, rng: Generator) -> bytes:
    """Another number of four or eight bytes within the head of a record: lengths, offsets, times, sizes."""
    listed = records(content)
    if not listed:
        return _flip(content, rng)
    _, begin, end = listed[int(rng.integers(len(listed)))]
    size = int(rng.choice((4, 8)))
    if end - begin - 9 < size:
        return _flip(content, rng)
    place = begin + 9 + int(rng.integers(min(end - begin - 9 - size, 60) + 1))
    value = _EDGES[int(rng.integers(len(_EDGES)))] % (1 << 8 * size)
    return content[:place] + value.to_bytes(size, "little") + content[place + size :]


def _within_chunk(content: bytes, rng: Generator) -> bytes:
    """A chunk whose unpacked content was damaged and packed again, its checksum left as it was."""
    chunks = [(begin, end) for opcode, begin, end in records(content) if opcode == 6]
    if not chunks:
        return _flip(content, rng)
    begin, end = chunks[int(rng.integers(len(chunks)))]
    head = content[begin + 9 : begin + 9 + 28]
    (name_size,) = struct.unpack_from("<I", content, begin + 37)
    name = content[begin + 41 : begin + 41 + name_size]
    raw = _unpacked(name, content[begin + 49 + name_size : end])
    change = (_flip, _fill, _delete, _duplicate, _swap)[int(rng.integers(5))]
    mutant = change(raw, rng)
    packed = _packed(name, mutant)
    if rng.random() < 0.5:
        head = head[:16] + struct.pack("<Q", len(mutant)) + head[24:]
    body = head + struct.pack("<I", name_size) + name + struct.pack("<Q", len(packed)) + packed
    return content[:begin] + struct.pack("<BQ", 6, len(body)) + body + content[end:]


def _unpacked(name: bytes, raw: bytes) -> bytes:
    if name == b"zstd":
        return zstandard.ZstdDecompressor().decompress(raw, max_output_size=1 << 24)
    return bytes(lz4.frame.decompress(raw)) if name == b"lz4" else raw


def _packed(name: bytes, raw: bytes) -> bytes:
    if name == b"zstd":
        return zstandard.ZstdCompressor().compress(raw)
    return bytes(lz4.frame.compress(raw)) if name == b"lz4" else raw


MUTATIONS: Final[dict[str, Mutation]] = {
    "truncate": _truncate,
    "flip": _flip,
    "fill": _fill,
    "delete": _delete,
    "duplicate": _duplicate,
    "swap": _swap,
    "swap records": _swap_records,
    "repeat a record": _repeat_record,
    "delete a record": _delete_record,
    "length": _length,
    "offset": _offset,
    "within a chunk": _within_chunk,
}
_OF_RECORDS: Final = frozenset(
    {"swap records", "repeat a record", "delete a record", "length", "offset", "within a chunk"}
)

"""The shape of a ROS message: ROS 2 CDR (little-endian XCDR1) and ROS 1.

CDR writes four bytes that say how, then the fields in order, each aligned to its own size counted from
behind those; strings carry a length and a NUL. ROS 1 aligns nothing, and its strings have no NUL. Arrays of
any length carry a count in both. A message is walked once, field by field; every length in it must fit.

Source: OMG DDS-XTYPES 1.3, section 7.4 (encoding version 1); wiki.ros.org/ROS/Technical Overview.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np

from data.mcap.layout import Kind, Layout, Leaf
from data.mcap.ros_definitions import NUMBERS, Dialect, Field

_KINDS: Final[dict[str, Kind]] = {
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_LITTLE_ENDIAN: Final = b"\x00\x01"  # CDR; the two bytes behind are options, without meaning here
_ENCAPSULATION: Final = 4
_MOST_LEAVES: Final = 4096
_PADDED: Final = 3  # bytes by which a message may be longer than its fields


def recognise(fields: tuple[Field, ...], dialect: Dialect, message: bytes) -> Layout | None:
    """The layout that a message shows; None where it holds what no layout can prove."""
    try:
        walk = _Walk(message, dialect)
        walk.message(fields, "")
    except (_Unprovable, struct.error, UnicodeDecodeError):
        return None
    if not len(message) - _PADDED <= walk.here <= len(message):
        return None
    return Layout(
        np.frombuffer(message, np.uint8).copy(),
        np.frombuffer(bytes(walk.mask), np.uint8),
        walk.leaves,
        walk.texts,
    )


class _Unprovable(Exception):  # noqa: N818  # what a message is, not what went wrong
    """A message has no shape that can be proved byte by byte."""


class _Walk:
    """Goes through one message field by field, noting what is fixed and where the numbers stand."""

    def __init__(self, raw: bytes, dialect: Dialect) -> None:
        self.raw = raw
        self.mask = bytearray(len(raw))
        self.leaves: dict[str, Leaf] = {}
        self.texts: dict[str, tuple[str, ...]] = {}
        self.is_cdr = dialect == "ros2"
        self.here = 0
        if self.is_cdr:
            if raw[:2] != _LITTLE_ENDIAN:
                raise _Unprovable
            self._fix(2)
            self.here = _ENCAPSULATION

    def message(self, fields: tuple[Field, ...], prefix: str) -> None:
        """Walk the fields of a message whose path begins with `prefix`."""
        if not fields:
            raise _Unprovable  # an empty message is a byte in one dialect and nothing in the other
        for field in fields:
            self._field(field, prefix + field.name)

    def _field(self, field: Field, path: str) -> None:
        count = field.length
        if count == -1:
            count = self._count()
        if field.kind in NUMBERS:
            self._numbers(field.kind, count, path)
        elif field.kind == "bool":
            self._take(1 if count is None else count)
        elif field.kind == "string":
            self.texts[path] = tuple(
                self._text() for _ in range(1 if count is None else self._checked(count, 4))
            )
        elif field.kind in ("time", "duration"):
            self._instants(field.kind, count, path)
        elif field.kind == "message" and count is None:
            self.message(field.fields, f"{path}.")
        elif field.kind == "message":
            for k in range(self._checked(count or 0, 1)):
                self.message(field.fields, f"{path}[{k}].")
        else:
            raise _Unprovable

    def _numbers(self, kind: str, count: int | None, path: str) -> None:
        width = NUMBERS[kind]
        if count != 0:
            self._align(width)
        self._note(path, Leaf(self.here, _KINDS[kind], width, count))
        self._take(width * (1 if count is None else count))

    def _instants(self, kind: str, count: int | None, path: str) -> None:
        if self.is_cdr or count is not None:
            raise _Unprovable
        signed: Kind = "i4" if kind == "duration" else "u4"
        self._note(f"{path}.secs", Leaf(self.here, signed, 4))
        self._note(f"{path}.nsecs", Leaf(self.here + 4, signed, 4))
        self._take(8)

    def _note(self, path: str, leaf: Leaf) -> None:
        if len(self.leaves) >= _MOST_LEAVES:
            raise _Unprovable
        self.leaves[path] = leaf

    def _count(self) -> int:
        self._align(4)
        (value,) = struct.unpack_from("<I", self.raw, self.here)
        self._fix(4)
        return int(value)

    def _text(self) -> str:
        length = self._count()
        raw = self.raw[self.here : self.here + length]
        self._fix(length)
        if self.is_cdr:
            if not raw.endswith(b"\0"):
                raise _Unprovable
            raw = raw[:-1]
        return raw.decode()

    def _checked(self, count: int, size: int) -> int:
        if count * size > len(self.raw) - self.here or count > _MOST_LEAVES:
            raise _Unprovable
        return count

    def _align(self, size: int) -> None:
        if self.is_cdr:
            self.here += -(self.here - _ENCAPSULATION) % size

    def _fix(self, size: int) -> None:
        begin = self.here
        self._take(size)
        self.mask[begin : self.here] = b"\xff" * size

    def _take(self, size: int) -> None:
        if size > len(self.raw) - self.here:
            raise _Unprovable
        self.here += size

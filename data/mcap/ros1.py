"""ROS 1 messages, one at a time: the ordinary decoder, and the oracle of `ros_layout` for this dialect."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from data.mcap.ros_definitions import NUMBERS, Field

_FORMATS: Final = {
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q",
    "uint64": "Q", "float32": "f", "float64": "d", "byte": "b", "char": "B",
}  # fmt: skip
_WIDTHS: Final = {**NUMBERS, "byte": 1, "char": 1}
MOST_ELEMENTS: Final = 100_000  # of one message that are made one by one: texts, times, messages


def decode(fields: tuple[Field, ...], raw: bytes) -> Mapping[str, Any]:
    """A message as nested mappings; ValueError or struct.error where it contradicts its definition."""
    return _Reader(raw).message(fields)


class _Reader:
    """Takes values off the front of a message."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw
        self.here = 0
        self.elements = 0

    def message(self, fields: tuple[Field, ...]) -> dict[str, Any]:
        return {field.name: self._value(field) for field in fields}

    def _value(self, field: Field) -> Any:
        if field.kind in _WIDTHS:
            return self._numbers(field.kind, field.length)
        single: Callable[[], Any] = {
            "bool": lambda: self._unpack("?"),
            "string": self._text,
            "time": lambda: self._instant("I"),
            "duration": lambda: self._instant("i"),
            "message": lambda: self.message(field.fields),
        }[field.kind]
        if field.length is None:
            return single()
        count = self._count(field.length)
        self.elements += count
        if self.elements > MOST_ELEMENTS:
            raise ValueError(f"more than {MOST_ELEMENTS} elements that are made one by one")
        return [single() for _ in range(count)]

    def _numbers(self, kind: str, length: int | None) -> Any:
        if length is None:
            return self._unpack(_FORMATS[kind])
        raw = self._take(self._count(length) * _WIDTHS[kind])
        return np.frombuffer(raw, f"<{_FORMATS[kind]}")

    def _count(self, length: int) -> int:
        count = int(self._unpack("I")) if length == -1 else length
        if count > len(self.raw) - self.here:
            raise ValueError(f"{count} elements in {len(self.raw) - self.here} bytes")
        return count

    def _instant(self, kind: str) -> dict[str, int]:
        return {"secs": self._unpack(kind), "nsecs": self._unpack(kind)}

    def _text(self) -> str:
        return self._take(int(self._unpack("I"))).decode()

    def _unpack(self, kind: str) -> Any:
        (value,) = struct.unpack(f"<{kind}", self._take(struct.calcsize(f"<{kind}")))
        return value

    def _take(self, size: int) -> bytes:
        if size > len(self.raw) - self.here:
            raise ValueError(f"{size} bytes are promised, {len(self.raw) - self.here} are left")
        self.here += size
        return self.raw[self.here - size : self.here]

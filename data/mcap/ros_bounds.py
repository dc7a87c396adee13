"""How much a ROS message claims to hold, before the ordinary decoder believes it.

That decoder makes as many elements as a count says, and those of no size never meet the end of the message:
four bytes can ask for four thousand million of them. Here every count is held against the bytes that are
left, and elements that are made one by one are limited.
"""

from __future__ import annotations

import struct
from typing import Final

from data.findings import LogError
from data.mcap.ros1 import MOST_ELEMENTS
from data.mcap.ros_definitions import NUMBERS, Field

_ENCAPSULATION: Final = 4  # [bytes]


def require_bounds(fields: tuple[Field, ...], raw: bytes) -> None:
    """Refuse a ROS 2 CDR message (LogError) that claims more than its bytes can hold."""
    walk = _Walk(raw)
    try:
        walk.message(fields)
    except (_Unsure, struct.error):  # for the decoder to say
        return


class _Unsure(Exception):  # noqa: N818  # what a message is, not what went wrong
    """From here on it is not known where the fields stand."""


class _Walk:
    """Goes through one message field by field."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw
        self.order = "<" if raw[1:2] == b"\1" else ">"
        self.here = _ENCAPSULATION
        self.elements = 0

    def message(self, fields: tuple[Field, ...]) -> None:
        """Pass over a message."""
        if not fields:
            raise _Unsure
        for field in fields:
            self._field(field)

    def _field(self, field: Field) -> None:
        count = self._count() if field.length == -1 else field.length
        width = 1 if field.kind == "bool" else NUMBERS.get(field.kind)
        if width is not None:
            if count != 0:
                self._align(width)
            self._take(width * (1 if count is None else count))
            return
        if field.kind not in {"string", "message"}:
            raise _Unsure
        for _ in range(self._made(1 if count is None else count)):
            if field.kind == "string":
                self._take(self._count())
            else:
                self.message(field.fields)

    def _made(self, count: int) -> int:
        """A number of elements that are made one by one."""
        self.elements += count
        if count > max(len(self.raw) - self.here, 1) or self.elements > MOST_ELEMENTS:
            raise LogError(f"it claims {count} elements in {max(len(self.raw) - self.here, 0)} bytes")
        return count

    def _count(self) -> int:
        self._align(4)
        (value,) = struct.unpack_from(f"{self.order}I", self.raw, self.here)
        self.here += 4
        return int(value)

    def _align(self, size: int) -> None:
        self.here += -(self.here - _ENCAPSULATION) % size

    def _take(self, size: int) -> None:
        if size > len(self.raw) - self.here:
            raise LogError(f"it claims {size} bytes where {max(len(self.raw) - self.here, 0)} are left")
        self.here += size

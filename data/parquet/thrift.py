"""Thrift's compact protocol, in which a Parquet file describes itself, read out of untrusted bytes.

A struct becomes a mapping from field numbers to values, a list a list; whole numbers and byte strings are
kept, floating-point numbers and maps are stepped over, since nothing that is needed is one. Every length is
held against the bytes that are left, and depth and the number of values are bounded.

Source: Apache Thrift, compact protocol.
"""

from __future__ import annotations

from typing import Final

_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _MAP, _STRUCT = 1, 2, 3, 7, 8, 11, 12
_INTEGERS: Final = (4, 5, 6)
_LISTS: Final = (9, 10)
_LONG: Final = 15  # a list whose length is written apart
_DEEPEST: Final = 12
_MOST_VALUES: Final = 4_000_000

Value = int | bytes | None | list["Value"] | dict[int, "Value"]
Struct = dict[int, Value]


class ThriftError(Exception):
    """The bytes are no struct."""


class Reader:
    """Reads structs one behind the other, from `here` on."""

    def __init__(self, content: memoryview, here: int = 0) -> None:
        self._content = content
        self._left = _MOST_VALUES
        self.here = here

    def struct(self, depth: int = 0) -> Struct:
        """The struct that begins at `here`, which then is where it ends; raises ThriftError."""
        if depth > _DEEPEST:
            raise ThriftError("structs are nested too deep")
        fields: Struct = {}
        number = 0
        while (head := self._byte()) != 0:
            number = number + (head >> 4) if head >> 4 else self._signed()
            kind = head & 15
            fields[number] = int(kind == _TRUE) if kind in {_TRUE, _FALSE} else self._value(kind, depth)
        return fields

    def _value(self, kind: int, depth: int) -> Value:
        self._left -= 1
        if self._left < 0:
            raise ThriftError(f"more than {_MOST_VALUES} values")
        if kind in _INTEGERS:
            return self._signed()
        if kind == _BINARY:
            return bytes(self._take(self._unsigned()))
        if kind == _STRUCT:
            return self.struct(depth + 1)
        if kind in _LISTS:
            return self._list(depth)
        if kind in {_TRUE, _FALSE, _BYTE}:  # as elements of a list, true and false take a byte too
            return self._byte()
        if kind == _DOUBLE:
            self._take(8)
        elif kind == _MAP:
            self._map(depth)
        else:
            raise ThriftError(f"a value of type {kind}, which is none")
        return None

    def _list(self, depth: int) -> list[Value]:
        if depth > _DEEPEST:
            raise ThriftError("lists are nested too deep")
        head = self._byte()
        count = self._unsigned() if head >> 4 == _LONG else head >> 4
        self._require(count)
        return [self._value(head & 15, depth + 1) for _ in range(count)]

    def _map(self, depth: int) -> None:
        if depth > _DEEPEST:
            raise ThriftError("maps are nested too deep")
        count = self._unsigned()
        kinds = self._byte() if count else 0
        self._require(count)
        for _ in range(count):
            self._value(kinds >> 4, depth + 1)
            self._value(kinds & 15, depth + 1)

    def _signed(self) -> int:
        found = self._unsigned()
        return (found >> 1) ^ -(found & 1)

    def _unsigned(self) -> int:
        found = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            found |= (byte & 127) << shift
            if byte < 128:
                return found
        raise ThriftError("an integer of more than 64 bits")

    def _byte(self) -> int:
        return self._take(1)[0]

    def _take(self, count: int) -> memoryview:
        self._require(count)
        begin, self.here = self.here, self.here + count
        return self._content[begin : self.here]

    def _require(self, count: int) -> None:
        if count > len(self._content) - self.here:
            raise ThriftError(f"{count} more bytes or values are claimed than there are bytes")

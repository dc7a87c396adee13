"""The shape of a protobuf message: tags, lengths and text are fixed, numbers are free.

An integer is written in as many bytes as it needs, seven bits in each; the eighth, which says that another
follows, is part of the shape, and so is the number of bytes. proto3 leaves out what is 0: messages with other
zeros have another shape.

Source: protobuf.dev/programming-guides/encoding.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor

from data.mcap.layout import Fixed, Layout, Leaf, Variable

_VARINT, _EIGHT, _DELIMITED, _FOUR = 0, 1, 2, 5  # wire types
_FIXED: Final[dict[int, Fixed]] = {
    FieldDescriptor.TYPE_DOUBLE: "f8", FieldDescriptor.TYPE_FLOAT: "f4", FieldDescriptor.TYPE_FIXED64: "u8",
    FieldDescriptor.TYPE_FIXED32: "u4", FieldDescriptor.TYPE_SFIXED64: "i8",
    FieldDescriptor.TYPE_SFIXED32: "i4",
}  # fmt: skip
_VARIABLE: Final[dict[int, Variable]] = {
    FieldDescriptor.TYPE_INT32: "int32", FieldDescriptor.TYPE_UINT32: "uint32",
    FieldDescriptor.TYPE_SINT32: "sint32", FieldDescriptor.TYPE_INT64: "int64",
    FieldDescriptor.TYPE_UINT64: "uint64", FieldDescriptor.TYPE_SINT64: "sint64",
}  # fmt: skip
_NUMBERS: Final = {**_FIXED, **_VARIABLE}
_LONGEST: Final = 10  # bytes of a varint
_MOST_LEAVES: Final = 4096
_DEEPEST: Final = 32


def recognise(descriptor: Descriptor, message: bytes) -> Layout | None:
    """The layout that a message shows; None where it holds what no layout can prove."""
    walk = _Walk(message)
    try:
        walk.message(descriptor, "", end=len(message), depth=0)
    except (_Unprovable, UnicodeDecodeError):
        return None
    template, mask = (np.frombuffer(bytes(raw), np.uint8) for raw in (message, walk.mask))
    return Layout(template, mask, walk.leaves, walk.texts, frozenset(walk.zero))


class _Unprovable(Exception):  # noqa: N818  # what a message is, not what went wrong
    """A message has no shape that can be proved byte by byte."""


class _Walk:
    """Goes through one message tag by tag, noting what is fixed and where the numbers stand."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw
        self.mask = bytearray(len(raw))
        self.leaves: dict[str, Leaf] = {}
        self.texts: dict[str, tuple[str, ...]] = {}
        self.zero: set[str] = set()
        self.here = 0

    def message(self, descriptor: Descriptor, prefix: str, *, end: int, depth: int) -> None:
        """Walk a message that ends at `end`, whose paths begin with `prefix`."""
        if depth > _DEEPEST:
            raise _Unprovable
        seen: dict[str, int] = {}
        while self.here < end:
            tag = self._fixed_varint(end)
            field = descriptor.fields_by_number.get(tag >> 3)
            if field is None:
                raise _Unprovable
            choice = field.containing_oneof
            if choice is not None and any(own.name in seen for own in choice.fields if own is not field):
                raise _Unprovable  # the last of several members counts
            number = seen.get(field.name, 0)
            seen[field.name] = number + 1
            self._field(field, tag & 7, prefix + field.name, number, end=end, depth=depth)
        for field in descriptor.fields:
            if field.name not in seen and not field.has_presence and not field.is_repeated:
                self.zero |= {prefix + field.name} if field.type in _NUMBERS else set()

    def _field(
        self, field: FieldDescriptor, wire: int, path: str, number: int, *, end: int, depth: int
    ) -> None:
        if number and not (field.is_repeated and field.type in (field.TYPE_MESSAGE, field.TYPE_STRING)):
            raise _Unprovable  # the last of several counts, or numbers that stand apart
        if wire == _DELIMITED:
            inside = self._fixed_varint(end)
            if inside > end - self.here:
                raise _Unprovable
            self._delimited(field, path, number, end=self.here + inside, depth=depth)
        elif field.is_repeated:
            raise _Unprovable
        elif wire == _VARINT and (
            field.type in _VARIABLE or field.type in (field.TYPE_BOOL, field.TYPE_ENUM)
        ):
            width = self._free_varint(end)
            if field.type in _VARIABLE:
                self._note(path, Leaf(self.here - width, _VARIABLE[field.type], width))
        elif field.type in _FIXED and wire == (_EIGHT if _FIXED[field.type][1] == "8" else _FOUR):
            width = int(_FIXED[field.type][1])
            self._note(path, Leaf(self.here, _FIXED[field.type], width))
            self._take(width, end)
        else:
            raise _Unprovable

    def _delimited(self, field: FieldDescriptor, path: str, number: int, *, end: int, depth: int) -> None:
        begin = self.here
        inside = field.message_type
        if inside is not None:
            if inside.GetOptions().map_entry or field.type != field.TYPE_MESSAGE:
                raise _Unprovable
            place = f"{path}[{number}]" if field.is_repeated else path
            self.message(inside, f"{place}.", end=end, depth=depth + 1)
        elif field.type == field.TYPE_STRING:
            self.mask[begin:end] = b"\xff" * (end - begin)
            self.texts[path] = (*self.texts.get(path, ()), self.raw[begin:end].decode())
        elif field.type in _FIXED and field.is_repeated:
            width = int(_FIXED[field.type][1])
            if (end - begin) % width:
                raise _Unprovable
            self._note(path, Leaf(begin, _FIXED[field.type], width, (end - begin) // width))
        elif field.type != field.TYPE_BYTES:
            raise _Unprovable
        self.here = end

    def _note(self, path: str, leaf: Leaf) -> None:
        if len(self.leaves) >= _MOST_LEAVES:
            raise _Unprovable
        self.leaves[path] = leaf

    def _fixed_varint(self, end: int) -> int:
        begin = self.here
        width = self._free_varint(end)
        self.mask[begin : self.here] = b"\xff" * width
        return sum((byte & 0x7F) << (7 * k) for k, byte in enumerate(self.raw[begin : self.here]))

    def _free_varint(self, end: int) -> int:
        """Pass over a varint of any value in as many bytes; its width."""
        for width in range(1, _LONGEST + 1):
            if self.here + width > end:
                break
            if self.raw[self.here + width - 1] < 0x80:
                self.mask[self.here : self.here + width] = b"\x80" * width
                self.here += width
                return width
        raise _Unprovable

    def _take(self, size: int, end: int) -> None:
        if size > end - self.here:
            raise _Unprovable
        self.here += size

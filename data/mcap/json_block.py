"""JSON messages a block at a time: all of them as lines, decoded in one call to the fields that are wanted.

msgspec parses a sequence of lines into structures that hold nothing but the wanted fields. The messages of
a block stand apart by record headers, of which a copy of the block makes blanks and a line's end. A message
that holds a line's end itself is left to the ordinary decoder, and so is a whole block in which anything is
not as the structure says: a field is missing, no number, or NaN, which Python reads and JSON does not know.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from typing import Any, Final, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from data.mcap.field_path import FieldPath
from data.mcap.records import ByteArray
from data.mcap.scan import as_lines
from data.mcap.stamp import LATEST, NO_STAMP, stamp_of

FloatArray = NDArray[np.float64]
_UNREAD: Final = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, LookupError, TypeError)
_NAMES: Final = "name"  # the field that names the joints of an array beside it


_Other: TypeAlias = int | float | str | bool | list[Any] | None


class _Stamp(msgspec.Struct, gc=False):
    """A stamp by the names that its parts have in one tool or another."""

    sec: Any = None
    secs: Any = None
    seconds: Any = None
    nanosec: Any = None
    nsec: Any = None
    nsecs: Any = None
    nanos: Any = None


class _Header(msgspec.Struct, gc=False):
    stamp: _Stamp | _Other = None


class _UnlikeError(Exception):
    """The messages are not as the structure says."""


@dataclass(frozen=True)
class _Field:
    """Where a number stands in a decoded structure."""

    attribute: str
    index: int | None
    joint: str | None
    names: str  # where the joints' names stand


class JsonBlock:
    """Reads the numbers at some paths out of blocks of JSON messages."""

    def __init__(self, paths: Sequence[FieldPath]) -> None:
        tree: dict[str, Any] = {}
        for path in paths:
            _plant(tree, path)
        self._fields = [_field(tree, path) for path in paths]
        self._decoder = msgspec.json.Decoder(_structure(tree, stamps=True))

    @staticmethod
    def can_read(paths: Sequence[FieldPath]) -> bool:
        """Whether the paths lead through objects alone, and past the stamps."""
        return all(
            path.steps[0].name not in {"header", "timestamp"}
            and all(step.index is None and step.joint is None for step in path.steps[:-1])
            for path in paths
        )

    def read(
        self, block: ByteArray, begin: NDArray[np.int64], length: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], FloatArray, NDArray[np.int64]]:
        """Which messages (n,) could be read; of those, the numbers (paths, m) and stamps (m,) [ns]."""
        lines, single = _lines(block, begin, length)
        try:
            with _uncollected():
                messages = self._decoder.decode_lines(lines)
                if len(messages) != int(single.sum()):
                    raise _UnlikeError
                values = np.array([_numbers(messages, own) for own in self._fields])
                return single, values, _stamps(messages)
        except (
            msgspec.MsgspecError,
            _UnlikeError,
            UnicodeDecodeError,
            RecursionError,
            LookupError,
            TypeError,
        ):
            return np.zeros(begin.size, np.bool_), np.empty((len(self._fields), 0)), np.empty(0, np.int64)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without the garbage collector, which walks through thousands of new objects again and again."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _lines(
    block: ByteArray, begin: NDArray[np.int64], length: NDArray[np.int64]
) -> tuple[bytes, NDArray[np.bool_]]:
    """The messages as lines, and which of them (n,) are one."""
    lines = np.empty(int(begin[-1] + length[-1] - begin[0]) + 1, np.uint8)
    single = np.empty(begin.size, np.bool_)
    as_lines(block, begin, length, lines, single)
    return lines.tobytes(), single


def _plant(tree: dict[str, Any], path: FieldPath) -> None:
    """Add a path to a tree of names: objects are trees, other fields have their type."""
    for step in path.steps[:-1]:
        below = tree.setdefault(step.name, {})
        if not isinstance(below, dict):
            return
        tree = below
    last = path.steps[-1]
    tree.setdefault(last.name, float | list[float])
    if last.joint is not None:
        tree.setdefault(_NAMES, list[str])


def _field(tree: Mapping[str, Any], path: FieldPath) -> _Field:
    names, last = [step.name for step in path.steps], path.steps[-1]
    beside = "" if last.joint is None else _attribute(tree, [*names[:-1], _NAMES])
    return _Field(_attribute(tree, names), last.index, last.joint, beside)


def _attribute(tree: Mapping[str, Any], names: Sequence[str]) -> str:
    """The way to a field in the structures of a tree, as an attribute of an attribute."""
    way = []
    for name in names:
        way.append(f"field_{list(tree).index(name)}")
        tree = tree[name] if isinstance(tree[name], dict) else {}
    return ".".join(way)


def _structure(tree: Mapping[str, Any], *, stamps: bool = False) -> type[msgspec.Struct]:
    fields: list[Any] = []
    names: dict[str, str] = {}
    for number, (name, below) in enumerate(tree.items()):
        fields.append((f"field_{number}", _structure(below) if isinstance(below, dict) else below))
        names[f"field_{number}"] = name
    if stamps:
        fields += [("header", _Header | _Other, None), ("timestamp", _Stamp | _Other, None)]
    return msgspec.defstruct("Wanted", fields, rename=names, gc=False)


def _numbers(messages: Sequence[Any], field: _Field) -> list[float]:
    """The numbers of a field, as `field_path.resolve` finds them; raises where it would."""
    found = list(map(attrgetter(field.attribute), messages))
    if field.index is not None:
        return list(map(itemgetter(field.index), found))
    if field.joint is not None:
        names = list(map(attrgetter(field.names), messages))
        if any(own != names[0] for own in names) or field.joint not in names[0]:
            raise _UnlikeError
        return list(map(itemgetter(names[0].index(field.joint)), found))
    kinds = set(map(type, found))
    if kinds == {list} and set(map(len, found)) == {1}:
        return [value for (value,) in found]
    if kinds != {float}:
        raise _UnlikeError
    return found


def _stamps(messages: Sequence[Any]) -> NDArray[np.int64]:
    """The messages' own stamps (m,) [ns], as `columns.header_stamp` finds them."""
    headers = list(map(attrgetter("header"), messages))
    if set(map(type, headers)) == {_Header}:
        stamps = list(map(attrgetter("stamp"), headers))
        if set(map(type, stamps)) == {_Stamp}:
            parts = [np.array(list(map(attrgetter(name), stamps))) for name in ("sec", "nanosec")]
            if all(part.dtype == np.int64 and np.abs(part).max() <= LATEST for part in parts):
                return np.asarray(parts[0] * 1_000_000_000 + parts[1])
    return np.array([_stamp(message) for message in messages], np.int64)


def _stamp(message: Any) -> int:
    inside = message.header.stamp if isinstance(message.header, _Header) else None
    stamp = message.timestamp if inside is None else inside
    return stamp_of(stamp) if isinstance(stamp, _Stamp) else NO_STAMP

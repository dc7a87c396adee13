"""JSON messages of one text but for their numbers: read as arrays, each compared with the text.

One message is parsed to see where its numbers stand. Another is its like if all that lies between the numbers
is the same, byte by byte, and numbers stand where numbers stood; then its structure is the same too. What is
no like of any goes to the ordinary decoder: another spacing or text, NaN, a number of more digits than a
double needs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.mcap.field_path import FieldPath
from data.mcap.json_scan import POWERS, take
from data.mcap.layout import Layout, Leaf, Taken, place, stamp_places
from data.mcap.layout_reader import shapes
from data.mcap.records import ByteArray
from data.mcap.stamp import LATEST, PLACES

_TOKEN: Final = re.compile(
    rb'[ \t\n\r]*(?:([\[\]{}:,])|("(?:[^"\\\x00-\x1f]|\\.)*")|(-?\d[-+.\deE]*)|(true|false|null))'
)
_DEEPEST: Final = 32
_PATH_SIGNS: Final = frozenset(".[]{}")
_STAMPS: Final = tuple(".".join(way) for way in PLACES)
_MOST_NUMBERS: Final = 4096


@dataclass(frozen=True)
class _Shape:
    """A text: what lies between its numbers, and which of them are wanted."""

    text: ByteArray
    edges: NDArray[np.uint64]  # (k + 2,) of the pieces between k numbers
    slot: NDArray[np.int64]  # (k,) what a number is kept as, or -1
    rows: NDArray[np.int64]  # (p,) what those of the paths are kept as
    stamp: NDArray[np.int64]  # (2 or 0,) what seconds and nanoseconds are kept as


class JsonReader:
    """Reads the numbers at some paths out of blocks of JSON messages."""

    def __init__(self, paths: Sequence[FieldPath]) -> None:
        self._paths = paths
        self._shapes: list[_Shape] = []

    def read(self, block: ByteArray, begin: NDArray[np.int64], length: NDArray[np.int64]) -> Taken:
        """What can be read of the messages (n,) at `begin`."""
        taken = Taken.nothing(len(self._paths), begin.size)
        shown = partial(_shape_of, paths=self._paths)
        for shape in shapes(self._shapes, shown, block, (begin, length), taken.left):
            take(
                block,
                begin,
                length,
                shape.text,
                shape.edges,
                shape.slot,
                shape.rows,
                shape.stamp,
                LATEST,
                np.empty(shape.slot.size, np.uint64),
                np.empty(shape.slot.size, np.int64),
                POWERS,
                taken.left,
                taken.values,
                taken.header,
            )
        return taken


def _shape_of(raw: bytes, paths: Sequence[FieldPath]) -> _Shape | None:
    """The shape that a message shows; None where it is no JSON of a shape, or lacks a wanted number."""
    walk = _Walk(raw)
    try:
        walk.value("", depth=0)
        json.loads(raw)  # what it refuses is no JSON, be its structure as it may
    except (_UnlikeError, ValueError):
        return None
    none = np.empty(0, np.uint8)
    layout = Layout(none, none, walk.leaves, walk.texts)
    places = [place(layout, path) for path in paths]
    known = [own.offset for own in places if own is not None]
    if len(known) < len(paths):
        return None
    own_stamp = stamp_places(layout)
    first = next((f"{path}." for path in _STAMPS if path in walk.objects), None)  # the one that counts
    if first is not None and (own_stamp is None or not any(path.startswith(first) for path in walk.leaves)):
        return None
    wanted = [*known, *([] if own_stamp is None else (own.offset for own in own_stamp))]
    slot, rows = np.full(len(walk.numbers), -1, np.int64), []
    for token in wanted:
        slot[token] = slot.max(initial=-1) + 1 if slot[token] < 0 else slot[token]
        rows.append(int(slot[token]))
    ends = np.array([0, *(end for _, end in walk.numbers)])
    starts = np.array([*(start for start, _ in walk.numbers), len(raw)])
    pieces = [raw[end:start] for end, start in zip(ends.tolist(), starts.tolist(), strict=True)]
    edges = np.concatenate([[0], np.cumsum(starts - ends)])
    text = np.frombuffer(b"".join(pieces), np.uint8)
    kept = np.array(rows, np.int64)
    return _Shape(text, edges.astype(np.uint64), slot, kept[: len(paths)], kept[len(paths) :])


class _UnlikeError(Exception):
    """A text of which no shape can be made."""


class _Walk:
    """Goes through one JSON text, noting where its numbers stand; leaves are counted in numbers."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw
        self.at = 0
        self.numbers: list[tuple[int, int]] = []
        self.leaves: dict[str, Leaf] = {}
        self.texts: dict[str, tuple[str, ...]] = {}
        self.objects: set[str] = set()

    def value(self, path: str, *, depth: int) -> str:
        """Pass over a value at a path; what it is: a mark, "text", "number" or "word"."""
        if depth > _DEEPEST or len(self.numbers) > _MOST_NUMBERS:
            raise _UnlikeError
        mark, _, number, word = self._next()
        if path in _STAMPS and mark != b"{":
            raise _UnlikeError  # a stamp that is none, or none at all
        if number is not None:
            self.leaves[path] = Leaf(len(self.numbers), "f8", 1)
            self.numbers.append((self.at - len(number), self.at))
            return "number"
        if mark == b"{":
            self.objects.add(path)
            self._object(path, depth)
        elif mark == b"[":
            self._array(path, depth)
        elif mark is not None:
            raise _UnlikeError
        return "word" if word else "text" if mark is None else mark.decode()

    def _object(self, path: str, depth: int) -> None:
        seen: set[str] = set()
        while True:
            mark, text, _, _ = self._next()
            if mark == b"}" and not seen:
                return
            if text is None or self._next()[0] != b":":
                raise _UnlikeError
            name = str(json.loads(text))
            if name in seen or not name or _PATH_SIGNS.intersection(name):
                raise _UnlikeError  # the last of several counts; a path could mean another field
            seen.add(name)
            self.value(f"{path}.{name}" if path else name, depth=depth + 1)
            mark, _, _, _ = self._next()
            if mark == b"}":
                return
            if mark != b",":
                raise _UnlikeError

    def _array(self, path: str, depth: int) -> None:
        first = len(self.numbers)
        kinds: list[str] = []
        texts: list[bytes] = []
        before = self.at
        if self._next()[0] == b"]":
            self.texts[path] = ()
            return
        self.at = before
        while True:
            begin = self.at
            kinds.append(self.value(f"{path}[{len(kinds)}]", depth=depth + 1))
            texts.append(self.raw[begin : self.at])
            mark, _, _, _ = self._next()
            if mark == b"]":
                break
            if mark != b",":
                raise _UnlikeError
        if set(kinds) == {"number"}:
            self.leaves[path] = Leaf(first, "f8", 1, len(kinds))
        if set(kinds) == {"text"}:
            self.texts[path] = tuple(str(json.loads(text)) for text in texts)

    def _next(self) -> tuple[bytes | None, bytes | None, bytes | None, bytes | None]:
        """The next token: a mark, a text, a number or a word."""
        found = _TOKEN.match(self.raw, self.at)
        if found is None:
            raise _UnlikeError
        self.at = found.end()
        return found[1], found[2], found[3], found[4]

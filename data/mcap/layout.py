"""Messages of one shape: bytes that never change, and where the numbers stand.

Binary messages can be read as an array where every one of them is proved to have the same shape. A `Layout`
is that shape, as one message showed it: the bits that must be the same in all (lengths, counts, tags, text),
and for each number its place. `take` compares those bits message by message; a size proves nothing, since
two texts of different length can give messages of one size. What fits no layout goes through the ordinary
decoder. How a shape is recognised is a matter of the encoding (`ros_layout`, `protobuf_layout`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from data.mcap.field_path import FieldPath
from data.mcap.records import ByteArray, gather
from data.mcap.stamp import LATEST, NANOSECONDS, NO_STAMP, PLACES, SECONDS

FloatArray = NDArray[np.float64]
Fixed = Literal["f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8"]  # little-endian
Variable = Literal["int32", "uint32", "sint32", "int64", "uint64", "sint64"]  # seven bits a byte, as protobuf
Kind = Fixed | Variable
_FIXED: Final = frozenset(get_args(Fixed))
_WORD: Final = 8  # [bytes] that compiled code compares at once
KINDS: Final[tuple[Kind, ...]] = (*get_args(Fixed), *get_args(Variable))  # in the order of `scan`


@dataclass(frozen=True)
class Leaf:
    """Numbers of one kind, one behind the other."""

    offset: int  # [bytes]
    kind: Kind
    width: int  # [bytes] of one
    count: int | None = None  # elements of an array; None: a number by itself


@dataclass(frozen=True)
class Layout:
    """A shape: bits to compare, and places of numbers and texts by their path without the last index."""

    template: ByteArray  # (size,)
    mask: ByteArray  # (size,) ones where a bit is the same in all
    leaves: Mapping[str, Leaf]
    texts: Mapping[str, tuple[str, ...]]  # arrays of text
    zero: frozenset[str] = frozenset()  # numbers that the encoding leaves out where they are 0

    @property
    def size(self) -> int:
        """Bytes in a message."""
        return self.template.size

    @cached_property
    def stamp(self) -> tuple[Place, ...]:
        """Where a message's own seconds and nanoseconds stand, if it has any that are integers."""
        own = stamp_places(self) or ()
        return own if all("f" not in part.kind for part in own) else ()

    @cached_property
    def proof(self) -> NDArray[np.uint64]:
        """The words of eight bytes in which anything is fixed: offset, bits and mask (w, 3)."""
        offsets = np.append(np.arange(0, self.size - _WORD, _WORD), self.size - _WORD)
        words = [
            np.array([own[k : k + _WORD] for k in offsets]).view("<u8") for own in (self.template, self.mask)
        ]
        rows = np.column_stack([offsets.astype(np.uint64), *words])
        return np.ascontiguousarray(rows[rows[:, 2] != 0])


@dataclass(frozen=True)
class Place:
    """Where one number stands in every message of a layout; no width: it is 0 in all."""

    offset: int
    kind: Kind
    width: int


def place(layout: Layout, path: FieldPath) -> Place | None:
    """Where a path leads; None where it leads to no number, which the ordinary decoder will say."""
    key = ""
    for number, step in enumerate(path.steps):
        index = step.index
        if step.joint is not None:
            names = layout.texts.get(f"{key}name", ())
            if step.joint not in names:
                return None
            index = names.index(step.joint)
        here = f"{key}{step.name}"
        if number == len(path.steps) - 1:
            return _element(layout, here, index)
        key = f"{here}." if index is None else f"{here}[{index}]."
    return None


def _element(layout: Layout, key: str, index: int | None) -> Place | None:
    if key in layout.zero and index is None:
        return Place(0, "u1", 0)
    leaf = layout.leaves.get(key)
    if leaf is None or (leaf.count is None and index is not None):
        return None
    if leaf.count is not None and ((index is None and leaf.count != 1) or (index or 0) >= leaf.count):
        return None
    return Place(leaf.offset + leaf.width * (index or 0), leaf.kind, leaf.width)


@dataclass(frozen=True)
class Taken:
    """What is read of n messages: which of them are not read yet, and the numbers of the others."""

    left: NDArray[np.bool_]  # (n,)
    values: FloatArray  # (places, n) [as logged]
    header: NDArray[np.int64]  # (n,) [ns] stamps, `NO_STAMP` where there is none

    @classmethod
    def nothing(cls, places: int, messages: int) -> Taken:
        """All messages are left."""
        header = np.full(messages, NO_STAMP, np.int64)
        return cls(np.ones(messages, np.bool_), np.empty((places, messages)), header)


def take(
    layout: Layout,
    places: Sequence[Place],
    block: ByteArray,
    messages: tuple[NDArray[np.int64], NDArray[np.int64]],
    taken: Taken,
    *,
    compiled: bool,
) -> None:
    """Take the numbers at some places, as the ordinary decoder gives them, and the stamps.

    Parameters
    ----------
    layout, places
        Of one shape of message.
    block, messages
        Bytes, and where messages (n,) begin and how long they are.
    taken
        Written to, for those that are left and whose bits are proved to be the layout's.
    compiled
        Whether by compiled code, which takes long to load.
    """
    own = layout.stamp
    if compiled and layout.size >= _WORD:
        from data.mcap import scan  # noqa: PLC0415  # numba takes long to load

        scan.take(
            block,
            *messages,
            layout.size,
            layout.proof,
            _table(places),
            _table(own),
            LATEST,
            taken.left,
            taken.values,
            taken.header,
        )
        return
    begin, length = messages
    candidates = np.flatnonzero(taken.left & (length == layout.size))
    rows = gather(block, begin[candidates], layout.size)
    candidates = candidates[~np.any((rows ^ layout.template) & layout.mask, axis=1)]
    where = begin[candidates]
    for row, place_ in enumerate(places):
        taken.values[row, candidates] = _stored(block, where, place_).astype(np.float64)
    if own:
        taken.header[candidates] = _stamps(block, where, own)
    taken.left[candidates] = False


def _table(places: Sequence[Place]) -> NDArray[np.int64]:
    """Places as the rows of an array (n, 3)."""
    rows = [(own.offset, own.width, KINDS.index(own.kind)) for own in places]
    return np.array(rows, np.int64).reshape(-1, 3)


def _stamps(block: ByteArray, begin: NDArray[np.int64], own: Sequence[Place]) -> NDArray[np.int64]:
    """Stamps (n,) [ns] of the messages at `begin` (n,), `NO_STAMP` where they are none."""
    whole, part = (_stored(block, begin, place_).astype(np.int64) for place_ in own)
    sane = (whole >= -LATEST) & (whole <= LATEST) & (part >= -LATEST) & (part <= LATEST)
    return np.where(sane, np.where(sane, whole, 0) * 1_000_000_000 + part, NO_STAMP)


def stamp_places(layout: Layout) -> tuple[Place, Place] | None:
    """Where a message's own seconds and nanoseconds stand; None where it has none."""
    for way in PLACES:
        prefix = ".".join(way)
        seconds, rest = (
            next((own for name in names if (own := _element(layout, f"{prefix}.{name}", None))), None)
            for names in (SECONDS, NANOSECONDS)
        )
        if seconds is not None and rest is not None:
            return seconds, rest
        if any(key.startswith(f"{prefix}.") for key in (*layout.leaves, *layout.zero)):
            return None
    return None


def _stored(block: ByteArray, begin: NDArray[np.int64], where: Place) -> NDArray[Any]:
    """Numbers (n,) as they are stored."""
    if not where.width:
        return np.zeros(begin.size, np.int64)
    rows = np.ascontiguousarray(gather(block, begin + where.offset, where.width))
    if where.kind in _FIXED:
        return rows.view(f"<{where.kind}").reshape(-1)
    value = np.zeros(begin.size, np.uint64)
    for k in range(where.width):
        value |= (rows[:, k].astype(np.uint64) & np.uint64(0x7F)) << np.uint64(7 * k)
    if where.kind.endswith("32"):  # longer ones are cut, as protobuf does
        value &= np.uint64(0xFFFFFFFF)
    if where.kind.startswith("sint"):
        return (value >> np.uint64(1)).view(np.int64) ^ -(value & np.uint64(1)).view(np.int64)
    if where.kind == "int32":
        return value.astype(np.uint32).view(np.int32)
    return value.view(np.int64) if where.kind == "int64" else value

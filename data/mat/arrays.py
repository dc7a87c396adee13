"""The arrays of a MATLAB variable: numbers by dotted path, settings as text, and why the rest is neither.

A variable is a matrix of one class: numbers (stored in any type that holds them, so that doubles that are
small integers take a byte each), characters, a struct of further matrices, or what is not read here (cells,
sparse matrices, objects, functions). Numbers lie column by column.

    data.q              a vector, row or column, in a struct
    log[2]              column 2, counted from 0, of a matrix
    out.signals[0].values   a field of the first element of an array of structs

Single numbers and lines of characters are the settings of a run, as comment lines are in a CSV log.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.mat.elements import MATRIX, Element, ElementError, Order, element

_TYPES: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS: Final = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
_CLASSES: Final = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_REFUSED: Final = {
    _CELL: "a cell array",
    _OBJECT: "an object",
    _SPARSE: "a sparse matrix",
    _FUNCTION: "a function",
}
_COMPLEX, _LOGICAL = 0x800, 0x200
_FLAGS: Final = 6  # the type of the array flags
_DEEPEST: Final = 12  # structs in structs
_MOST_ELEMENTS: Final = 64  # of an array of structs, and columns of a matrix, that are listed
_LONGEST_TEXT: Final = 4096


@dataclass(frozen=True)
class Numbers:
    """One column of numbers in a variable's unpacked bytes."""

    path: str
    begin: int  # [bytes] of its first number
    rows: int
    stored: str  # the type that it is stored in
    declared: str  # the type that MATLAB gives it


@dataclass(frozen=True)
class Setting:
    """A single number or a line of characters."""

    path: str
    text: str


@dataclass(frozen=True)
class Refused:
    """What is neither, and why."""

    path: str
    why: str


Leaf = Numbers | Setting | Refused


def leaves(block: memoryview, order: Order) -> Iterator[Leaf]:
    """All that a variable's unpacked bytes hold; raises ElementError where they cannot be right."""
    yield from _matrix(block, element(block, 0, order), order, path="", depth=0)


def numbers(block: memoryview, leaf: Numbers, order: Order) -> NDArray[np.generic]:
    """A column (rows,) in the type that MATLAB gives it."""
    kind = np.dtype(order + leaf.stored)
    column = np.frombuffer(block, kind, count=leaf.rows, offset=leaf.begin)
    return column.astype(np.dtype(leaf.declared))


def _matrix(block: memoryview, found: Element, order: Order, *, path: str, depth: int) -> Iterator[Leaf]:
    if found.kind != MATRIX:
        raise ElementError(f"an element of type {found.kind} stands where a matrix should")
    if found.begin == found.end:
        yield Refused(path, "nothing")
        return
    inside = block[: found.end]
    flags = element(inside, found.begin, order)
    if flags.kind != _FLAGS or flags.end - flags.begin != 8:
        raise ElementError("a matrix has no flags")
    (word,) = struct.unpack_from(order + "I", inside, flags.begin)
    kind = word & 0xFF
    if kind == _OPAQUE:
        yield _opaque(inside, flags.after, order, path)
        return
    dims = element(inside, flags.after, order)
    shape = _integers(inside, dims, order)
    if len(shape) < 2:
        raise ElementError(f"a matrix has the dimensions {shape}; it must have two or more")
    name = element(inside, dims.after, order)
    path = path or _text(inside, name, 1)
    if not path:
        yield Refused(path, "a workspace of functions")
    elif kind in _CLASSES:
        yield from _numeric(inside, name.after, order, path=path, shape=shape, word=word)
    elif kind == _CHAR:
        yield from _characters(inside, element(inside, name.after, order), order, path=path, shape=shape)
    elif kind == _STRUCT:
        yield from _struct(inside, name.after, order, path=path, shape=shape, depth=depth)
    elif kind in _REFUSED:
        yield Refused(path, _REFUSED[kind])
    else:
        raise ElementError(f"a matrix of class {kind}, which is none")


def _numeric(
    block: memoryview, here: int, order: Order, *, path: str, shape: tuple[int, ...], word: int
) -> Iterator[Leaf]:
    found = element(block, here, order)
    stored = _TYPES.get(found.kind)
    if stored is None:
        raise ElementError(f"numbers are stored as type {found.kind}, which is none")
    width, count = np.dtype(stored).itemsize, math.prod(shape)
    if found.end - found.begin != width * count:
        raise ElementError(
            f"{shape} numbers of {width} bytes are claimed, {found.end - found.begin} bytes are there"
        )
    declared = _CLASSES[word & 0xFF]
    long = [n for n in shape if n != 1]
    if word & _COMPLEX:
        yield Refused(path, "complex numbers")
    elif not count:
        yield Refused(path, "nothing")
    elif not long:
        value = np.frombuffer(block, np.dtype(order + stored), 1, found.begin)[0]
        yield Setting(path, str(bool(value)).lower() if word & _LOGICAL else repr(value.item()))
    elif word & _LOGICAL:
        yield Refused(path, "true and false")
    elif len(long) == 1:
        yield Numbers(path, found.begin, count, stored, declared)
    elif len(long) > 2 or long[1] > _MOST_ELEMENTS:
        yield Refused(path, f"an array of {' x '.join(map(str, shape))} numbers")
    else:
        for k in range(long[1]):
            yield Numbers(f"{path}[{k}]", found.begin + k * long[0] * width, long[0], stored, declared)


def _characters(
    block: memoryview, found: Element, order: Order, *, path: str, shape: tuple[int, ...]
) -> Iterator[Leaf]:
    if math.prod(shape[:1] + shape[2:]) > 1 or found.end - found.begin > 2 * _LONGEST_TEXT:
        yield Refused(path, "text")
        return
    encoding = _TEXTS.get(found.kind)
    if encoding is None:
        raise ElementError(f"characters are stored as type {found.kind}, which is none")
    if encoding == "utf-16":
        encoding += "-le" if order == "<" else "-be"
    yield Setting(path, bytes(block[found.begin : found.end]).decode(encoding, errors="replace"))


def _struct(
    block: memoryview, here: int, order: Order, *, path: str, shape: tuple[int, ...], depth: int
) -> Iterator[Leaf]:
    lengths = element(block, here, order)
    longest = (*_integers(block, lengths, order), 0)[0]
    names = element(block, lengths.after, order)
    size = names.end - names.begin
    if longest < 1 or size % longest:
        raise ElementError(f"names of fields of {longest} bytes each do not fill {size} bytes")
    fields = [_text(block, names, 1, k, longest) for k in range(0, size, longest)]
    count, here = math.prod(shape), names.after
    if depth >= _DEEPEST or (count > _MOST_ELEMENTS and fields):
        yield Refused(path, f"an array of {count} structs" if count > 1 else "structs nested too deep")
        return
    for k in range(count):
        for field in fields:
            found = element(block, here, order)
            inside = f"{path}[{k}].{field}" if count > 1 else f"{path}.{field}"
            yield from _matrix(block, found, order, path=inside, depth=depth + 1)
            here = found.after


def _opaque(block: memoryview, here: int, order: Order, path: str) -> Refused:
    """An object of a class that only MATLAB itself can read: table, timeseries, string, datetime."""
    words = []
    for _ in range(3):  # name, type system, class
        found = element(block, here, order)
        words.append(_text(block, found, 1))
        here = found.after
    what = f"an object of class {words[2]}, which only MATLAB can read; save its numbers as plain arrays"
    return Refused(path or words[0] or "(unnamed)", what)


def _integers(block: memoryview, found: Element, order: Order) -> tuple[int, ...]:
    size = found.end - found.begin
    if found.kind != 5 or size % 4 or size > 4 * 32:
        raise ElementError("dimensions or lengths are no row of integers")
    values: tuple[int, ...] = struct.unpack_from(f"{order}{size // 4}i", block, found.begin)
    if any(value < 0 for value in values):
        raise ElementError(f"a length is negative: {values}")
    return values


def _text(block: memoryview, found: Element, kind: int, begin: int = 0, size: int | None = None) -> str:
    """A name: of the element, or a part of it, up to its NUL."""
    if found.kind != kind:
        raise ElementError(f"a name is stored as type {found.kind}")
    end = found.end if size is None else found.begin + begin + size
    return bytes(block[found.begin + begin : end]).split(b"\0", 1)[0].decode("latin-1")

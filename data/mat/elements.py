"""The data elements of a MAT-file of version 5, in untrusted bytes.

The file is a header of 128 bytes and then elements, one a variable: a tag (type and size, 4 bytes each, or
both in 4 for a small one), the bytes, and padding to 8. An element of type *compressed* holds a zlib stream
of one other element, whose Adler-32 checksum proves it; other elements carry none.

Every size is held against the bytes that there are, and a stream is unpacked no further than the size that
its own first bytes claim, which must be one that a log can have (`data.unpacking`).

Source: MathWorks, MAT-File Format, version 5.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

from data.findings import LogError
from data.integrity import Loss
from data.unpacking import over_limit

HEADER: Final = 128
MATRIX: Final = 14
COMPRESSED: Final = 15
_TAG: Final = 8
_VERSION_5: Final = 0x0100
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
Order = Literal["<", ">"]


class ElementError(Exception):
    """What stands in a variable cannot be right, and why."""


@dataclass(frozen=True)
class Element:
    """One element: its type, where its bytes lie in the block it was found in, and where the next begins."""

    kind: int
    begin: int
    end: int
    after: int


@dataclass(frozen=True)
class Place:
    """Where a variable lies in the file."""

    begin: int  # its tag
    end: int  # past it
    kind: int


def byte_order(content: memoryview) -> Order:
    """How the numbers of a MAT-file are written, by its header.

    Raises
    ------
    LogError
        When it is no MAT-file of version 5; versions 4 and 7.3 are named, with what to do.
    """
    head = bytes(content[:HEADER])
    if head.startswith((b"MATLAB 7.3", _HDF5)):
        raise LogError(
            "it is a MAT-file of version 7.3, which is HDF5 and is not read here; in MATLAB, load it and "
            "save it with `save -v7`"
        )
    order: Order = "<" if head[126:128] == b"IM" else ">"
    if len(head) < HEADER or head[126:128] not in {b"IM", b"MI"}:
        raise LogError(
            "it is no MAT-file of version 5 (its header has no endian mark); a file of version 4 or a "
            "damaged one. In MATLAB, load it and save it with `save -v7`"
        )
    (version,) = struct.unpack_from(order + "H", head, 124)
    if version != _VERSION_5:
        raise LogError(f"it is a MAT-file of version {version:#06x}, not 5; save it with `save -v7`")
    return order


def element(block: memoryview, here: int, order: Order) -> Element:
    """The element whose tag stands at `here`; raises ElementError where it does not fit into the block."""
    if here + _TAG > len(block):
        raise ElementError("it stops inside a tag")
    kind, size = struct.unpack_from(order + "II", block, here)
    if kind >> 16:  # small: size and type share the first word, the bytes take the second
        kind, size = kind & 0xFFFF, kind >> 16
        if size > 4:
            raise ElementError(f"a small element claims {size} bytes")
        return Element(kind, here + 4, here + 4 + size, here + _TAG)
    begin = here + _TAG
    if size > len(block) - begin:
        raise ElementError(f"an element of {size} bytes reaches past the end")
    end = begin + size
    padded = end if kind == COMPRESSED else min(end + -size % 8, len(block))
    return Element(kind, begin, end, padded)


def variables(content: memoryview, order: Order) -> Iterator[Place | Loss]:
    """Where each variable lies; last of all a loss, where the elements cannot be followed further."""
    here = HEADER
    while here < len(content):
        try:
            found = element(content, here, order)
            if found.kind not in {MATRIX, COMPRESSED}:
                raise ElementError(f"an element of type {found.kind} stands where a variable should")
        except ElementError as error:
            yield Loss(here, len(content), f"{error}: the file was cut off or damaged")
            return
        yield Place(here, found.after, found.kind)
        here = found.after


def unpacked(content: memoryview, place: Place, order: Order) -> memoryview:
    """The bytes of a variable, from its own tag on; raises ElementError."""
    if place.kind == MATRIX:
        return content[place.begin : place.end]
    packed = content[place.begin + _TAG : place.end]
    stream = zlib.decompressobj()
    try:
        tag = stream.decompress(packed[: min(len(packed), 1 << 16)], _TAG)
        if len(tag) < _TAG:
            raise ElementError("its compressed bytes hold no variable")
        kind, size = struct.unpack(order + "II", tag)
        if kind != MATRIX:
            raise ElementError(f"its compressed bytes hold an element of type {kind}, not a variable")
        if over_limit(size, len(packed)):
            raise ElementError(f"{len(packed)} bytes claim to unpack to {size}: no log does")
        rest = stream.unconsumed_tail + packed[min(len(packed), 1 << 16) :]
        body = stream.decompress(rest, size + 1) if size else b""
    except zlib.error as error:
        raise ElementError(f"its compressed bytes are damaged ({error})") from error
    if len(body) != size:
        raise ElementError(f"it unpacks to {len(body)} bytes, not the {size} that it claims")
    if not stream.eof:
        raise ElementError("its compressed bytes have no end, so that their checksum is missing")
    return memoryview(tag + body)

"""Loops over the bytes of large files, compiled: numba takes longer to load than a small file to read."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from data.compiled import lean_kernel, word

Word: TypeAlias = Any  # np.uint64: every operand is one, or numba would make floats of them
HEADER_SIZE = 9  # opcode u8, length u64
F4, F8, I1, I2, I4, I8, U1, U2, U4, U8, INT32, UINT32, SINT32, INT64, UINT64, SINT64 = range(16)
_U = np.uint64
_ONES = np.uint64(0xFFFFFFFFFFFFFFFF)
_LOW = np.uint64(0xFFFFFFFF)


@lean_kernel
def scan(
    block: NDArray[np.uint8],
    begin: int,
    among: NDArray[np.bool_],
    opcode: NDArray[np.uint8],
    start: NDArray[np.int64],
    length: NDArray[np.int64],
) -> tuple[int, int]:
    """Step through records from `begin` on while they fit, are `among` (256,), and there is room for them.

    Returns how many there are in `opcode`, `start` and `length`, and where it stopped.
    """
    here: Word = begin
    count = 0
    while here + HEADER_SIZE <= block.size and count < opcode.size:
        code = block[_U(here)]
        size = word(block, _U(here + 1))
        if not among[code] or size > _U(block.size - here - HEADER_SIZE):
            break
        opcode[count], start[count], length[count] = code, here + HEADER_SIZE, np.int64(size)
        count += 1
        here += HEADER_SIZE + np.int64(size)
    return count, here


@lean_kernel
def prefixes(
    block: NDArray[np.uint8],
    begin: NDArray[np.int64],
    channel: NDArray[np.uint16],
    sequence: NDArray[np.uint32],
    log_time: NDArray[np.int64],
    publish_time: NDArray[np.int64],
) -> None:
    """What stands before each message whose record's content is at `begin` (n,), all of it in the block."""
    for row in range(begin.size):
        at = _U(begin[row])
        first = word(block, at)
        channel[row] = np.uint16(first & _U(0xFFFF))
        sequence[row] = np.uint32((first >> _U(16)) & _LOW)
        log_time[row] = np.int64(word(block, at + _U(6)))
        publish_time[row] = np.int64(word(block, at + _U(14)))


@lean_kernel
def _stored(block: NDArray[np.uint8], at: Word, width: int, kind: int) -> Word:
    """A number as it is stored, its sign extended to 64 bits."""
    if width == 8 and kind < INT32:
        return word(block, at)
    found = _U(0)
    if kind < INT32:
        for k in range(width):
            found |= _U(block[at + _U(k)]) << _U(8 * k)
        if I1 <= kind <= I8 and width and found >> _U(8 * width - 1):
            found |= _ONES << _U(8 * width)
        return found
    for k in range(width):
        found |= (_U(block[at + _U(k)]) & _U(0x7F)) << _U(7 * k)
    if kind <= SINT32:  # longer ones are cut, as protobuf does
        found &= _LOW
    if kind in (SINT32, SINT64):
        found = (found >> _U(1)) ^ (_U(0) - (found & _U(1)))
    elif kind == INT32 and found >> _U(31):
        found |= _ONES << _U(32)
    return found


@lean_kernel
def take(
    block: NDArray[np.uint8],
    begin: NDArray[np.int64],
    length: NDArray[np.int64],
    size: int,
    proof: NDArray[np.uint64],
    place: NDArray[np.int64],
    stamp: NDArray[np.int64],
    latest: int,
    left: NDArray[np.bool_],
    values: NDArray[np.float64],
    header: NDArray[np.int64],
) -> None:
    """Take the messages at `begin` (n,) that are `left`, of that size and proved; they are left no more.

    `proof` (w, 3) holds offset, bits and mask of words of eight bytes, `place` (p, 3) and `stamp` (2 or 0, 3)
    offset, width and kind; the numbers go to `values` (p, n), and stamps of up to `latest` seconds and
    nanoseconds to `header` (n,).
    """
    bits = values.view(np.uint64)
    for row in range(begin.size):
        if not left[row] or length[row] != size:
            continue
        at, differs = _U(begin[row]), _U(0)
        for k in range(proof.shape[0]):
            differs |= (word(block, at + proof[k, 0]) ^ proof[k, 1]) & proof[k, 2]
        if differs != _U(0):
            continue
        left[row] = False
        for k in range(place.shape[0]):
            kind = place[k, 2]
            stored = _stored(block, at + _U(place[k, 0]), place[k, 1], kind)
            if kind == F8:
                bits[k, row] = stored
            elif kind == F4:
                values[k, row] = np.float64(np.uint32(stored).view(np.float32))
            elif U1 <= kind <= U8 or kind in (UINT32, UINT64):
                values[k, row] = np.float64(stored)
            else:
                values[k, row] = np.float64(np.int64(stored))
        if stamp.shape[0]:
            whole = np.int64(_stored(block, at + _U(stamp[0, 0]), stamp[0, 1], stamp[0, 2]))
            part = np.int64(_stored(block, at + _U(stamp[1, 0]), stamp[1, 1], stamp[1, 2]))
            if -latest <= whole <= latest and -latest <= part <= latest:
                header[row] = whole * 1_000_000_000 + part

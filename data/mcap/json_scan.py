r"""JSON messages of one text but for their numbers, compiled: texts compared, numbers parsed exactly.

A decimal w 10^q becomes the nearest double by one multiplication of w, at most 19 digits, with a 128-bit
power of five (Lemire, Number parsing at a gigabyte per second, Software: Practice and Experience 51, 2021).
Where that product leaves the rounding open, or the number has more digits or is subnormal, nothing is said,
and the message goes to the ordinary decoder.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from data.compiled import kernel

Word: TypeAlias = Any  # np.uint64: every operand is one, or numba would make floats of them
_FIRST, _LAST = -342, 308  # powers of ten that a double may need
_ONES = np.uint64(0xFFFFFFFFFFFFFFFF)
_LOW = np.uint64(0xFFFFFFFF)
_U = np.uint64


def _powers() -> NDArray[np.uint64]:
    """The leading 128 bits of 5^q as two words, rounded down, or up where they are reciprocals."""
    found = []
    for q in range(_FIRST, _LAST + 1):
        power = 5 ** abs(q)
        if q < 0:
            z = (power - 1).bit_length()
            power = (1 << (z + 127 if q >= -27 else 2 * z + 128)) // power + 1
        shift = power.bit_length() - 128
        power = power >> shift if shift > 0 else power << -shift
        found.append((power >> 64, power & 0xFFFFFFFFFFFFFFFF))
    return np.array(found, np.uint64)


POWERS = _powers()


@kernel
def _product(a: Word, b: Word) -> tuple[Word, Word]:
    """The 128 bits of a product of two words: high, low."""
    a0, a1, b0, b1 = a & _LOW, a >> _U(32), b & _LOW, b >> _U(32)
    low, cross, other, high = a0 * b0, a1 * b0, a0 * b1, a1 * b1
    middle = (low >> _U(32)) + (cross & _LOW) + (other & _LOW)
    return (
        high + (cross >> _U(32)) + (other >> _U(32)) + (middle >> _U(32)),
        (middle << _U(32)) | (low & _LOW),
    )


@kernel
def nearest(w: Word, q: int, powers: NDArray[np.uint64]) -> Word:
    """The bits of the double nearest to w 10^q, w > 0; all ones where one product does not tell."""
    if q < -342 or q > 308:
        return _ONES
    zeros = 0
    while w >> _U(63) == _U(0):
        w = w << _U(1)
        zeros += 1
    high, low = _product(w, powers[q + 342, 0])
    if high & _U(0x1FF) == _U(0x1FF):
        more, _ = _product(w, powers[q + 342, 1])
        low = low + more
        if low < more:
            high = high + _U(1)
    if low == _ONES and (q < -27 or q > 55):
        return _ONES
    upper = high >> _U(63)
    shift = upper + _U(9)
    mantissa = high >> shift
    exponent = ((217706 * q) >> 16) + 63 + np.int64(upper) - zeros + 1023
    if exponent <= 0:
        return _ONES
    if low <= _U(1) and -4 <= q <= 23 and mantissa & _U(3) == _U(1) and mantissa << shift == high:
        mantissa = mantissa & ~_U(1)
    mantissa = (mantissa + (mantissa & _U(1))) >> _U(1)
    if mantissa >> _U(53) != _U(0):
        mantissa = _U(1) << _U(52)
        exponent += 1
    if exponent >= 0x7FF:
        return _ONES
    return (mantissa & ~(_U(1) << _U(52))) | (_U(exponent) << _U(52))


@kernel
def _number(block: NDArray[np.uint8], at: int, end: int, powers: NDArray[np.uint64]) -> tuple[int, Word, int]:
    """The number at a place: where it ends (0: none that is told), its bits, and itself if it is an integer.

    No integer, or one of more than 18 digits: the least of all.
    """
    none = int(np.int64(-(2**63)))
    begin = at
    negative = at < end and block[at] == 45
    at += negative
    first, w, digits, q = at, _U(0), 0, 0
    while at < end and 48 <= block[at] <= 57:
        w = w * _U(10) + _U(block[at] - 48)
        digits += digits > 0 or block[at] != 48
        at += 1
    if at == first or (block[first] == 48 and at - first > 1):
        return 0, _U(0), none
    whole = at
    if at < end and block[at] == 46:
        at += 1
        while at < end and 48 <= block[at] <= 57:
            w = w * _U(10) + _U(block[at] - 48)
            digits += digits > 0 or block[at] != 48
            q -= 1
            at += 1
        if at == whole + 1:
            return 0, _U(0), none
    if at < end and block[at] | 32 == 101:
        at += 1
        down = at < end and block[at] == 45
        at += at < end and (block[at] == 45 or block[at] == 43)
        power, start = 0, at
        while at < end and 48 <= block[at] <= 57:
            power = min(power * 10 + int(block[at]) - 48, 9999)
            at += 1
        if at == start:
            return 0, _U(0), none
        q += -power if down else power
    if digits > 19 or (w == _U(0) and negative and at == whole):
        return 0, _U(0), none
    bits = _U(0) if w == _U(0) else nearest(w, q, powers)
    if bits == _ONES or at - begin > 64:
        return 0, _U(0), none
    integer = none
    if at == whole and digits <= 18:
        integer = -int(w) if negative else int(w)
    return at, bits | (_U(negative) << _U(63)), integer


@kernel
def match(
    block: NDArray[np.uint8],
    begin: NDArray[np.int64],
    length: NDArray[np.int64],
    text: NDArray[np.uint8],
    edges: NDArray[np.int64],
    slot: NDArray[np.int64],
    values: NDArray[np.uint64],
    integers: NDArray[np.int64],
    powers: NDArray[np.uint64],
    same: NDArray[np.bool_],
) -> None:
    """For each message at `begin` (n,), whether it is the `text` with other numbers, and those wanted.

    The text between numbers k - 1 and k is `text[edges[k]:edges[k + 1]]`; number k goes to row `slot[k]` of
    `values` (s, n), as bits, and of `integers` (s, n), if that is not negative.
    """
    for row in range(begin.size):
        at, end = begin[row], begin[row] + length[row]
        same[row] = False
        for k in range(edges.size - 1):
            size = edges[k + 1] - edges[k]
            if size > end - at:
                at = -1
                break
            differs = np.uint8(0)
            for j in range(size):
                differs |= block[at + j] ^ text[edges[k] + j]
            at += size
            if differs:
                at = -1
                break
            if k < slot.size:
                at, bits, integer = _number(block, at, end, powers)
                if at == 0:
                    break
                if slot[k] >= 0:
                    values[slot[k], row] = bits
                    integers[slot[k], row] = integer
        same[row] = at == end

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

from data.compiled import lean_kernel, word

Word: TypeAlias = Any  # np.uint64: every operand is one, or numba would make floats of them
_FIRST, _LAST = -342, 308  # powers of ten that a double may need
_ONES = np.uint64(0xFFFFFFFFFFFFFFFF)
_LOW = np.uint64(0xFFFFFFFF)
_HIGH_HALVES = np.uint64(0xF0F0F0F0F0F0F0F0)
_SIXES = np.uint64(0x0606060606060606)
_THREES = np.uint64(0x3333333333333333)
_ZEROS = np.uint64(0x3030303030303030)
_PAIRS = np.uint64(0x000000FF000000FF)
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


@lean_kernel
def _product(a: Word, b: Word) -> tuple[Word, Word]:
    """The 128 bits of a product of two words: high, low."""
    a0, a1, b0, b1 = a & _LOW, a >> _U(32), b & _LOW, b >> _U(32)
    low, cross, other, high = a0 * b0, a1 * b0, a0 * b1, a1 * b1
    middle = (low >> _U(32)) + (cross & _LOW) + (other & _LOW)
    return (
        high + (cross >> _U(32)) + (other >> _U(32)) + (middle >> _U(32)),
        (middle << _U(32)) | (low & _LOW),
    )


@lean_kernel
def nearest(w: Word, q: int, powers: NDArray[np.uint64]) -> Word:
    """The bits of the double nearest to w 10^q, w > 0; all ones where one product does not tell."""
    if q < -342 or q > 308:
        return _ONES
    zeros: Word = 0
    for shift in (32, 16, 8, 4, 2, 1):
        if w >> _U(64 - shift) == _U(0):
            w = w << _U(shift)
            zeros += shift
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
    exponent: Word = ((217706 * q) >> 16) + 63 + np.int64(upper) - zeros + 1023
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


@lean_kernel
def _digits(block: NDArray[np.uint8], at: Word, end: Word, w: Word) -> tuple[Word, Word]:
    """Where the digits at a place end, and w with them behind its own; eight at once while they last."""
    while at + _U(8) <= end:
        v = word(block, at)
        tens = (v & _HIGH_HALVES) | (((v + _SIXES) & _HIGH_HALVES) >> _U(4))
        if tens != _THREES:  # not all of them are 0 to 9
            break
        v = v - _ZEROS
        v = v * _U(10) + (v >> _U(8))
        v = (v & _PAIRS) * _U(0x000F424000000064) + ((v >> _U(16)) & _PAIRS) * _U(0x0000271000000001)
        v = v >> _U(32)
        w = w * _U(100_000_000) + v
        at += _U(8)
    while at < end and 48 <= block[at] <= 57:
        w = w * _U(10) + _U(block[at] - 48)
        at += _U(1)
    return at, w


@lean_kernel
def _significant(block: NDArray[np.uint8], at: Word, end: Word) -> Word:
    """How many of the digits in a stretch stand behind its zeros in front."""
    count: Word = 0
    while at < end:
        count += 48 <= block[at] <= 57 and (count > 0 or block[at] != 48)
        at += _U(1)
    return count


@lean_kernel
def _number(
    block: NDArray[np.uint8], at: Word, end: Word, powers: NDArray[np.uint64]
) -> tuple[Word, Word, Word]:
    """The number at a place: where it ends (0: none that is told), its bits, and itself if it is an integer.

    No integer, or one of more than 18 digits: the least of all.
    """
    none: Word = np.int64(-(2**63))
    nothing = (_U(0), _U(0), none)
    begin = at
    negative = at < end and block[at] == 45
    at += _U(negative)
    first = at
    at, w = _digits(block, first, end, _U(0))
    whole = at
    if at == first or (block[first] == 48 and at - first > _U(1)):
        return nothing
    q: Word = 0
    if at < end and block[at] == 46:
        at, w = _digits(block, whole + _U(1), end, w)
        q = -np.int64(at - whole - _U(1))
        if q == 0:
            return nothing
    if at - begin > _U(64):
        return nothing
    digits: Word = np.int64(at - first) - (q < 0)
    if digits > 19:
        digits = _significant(block, first, at)
    exponent = at
    if at < end and block[at] | 32 == 101:
        at += _U(1)
        down = at < end and block[at] == 45
        at += _U(at < end and (block[at] == 45 or block[at] == 43))
        power: Word = 0
        start = at
        while at < end and 48 <= block[at] <= 57:
            power = min(power * 10 + np.int64(block[at]) - 48, 9999)
            at += _U(1)
        if at == start or at - begin > _U(64):
            return nothing
        q += -power if down else power
    if digits > 19 or (w == _U(0) and negative and at == whole):
        return nothing
    if w == _U(0) or (q == 0 and w >> _U(53) == _U(0)):
        bits = np.float64(w).view(np.uint64)
    else:
        bits = nearest(w, q, powers)
        if bits == _ONES:
            return nothing
    integer = none
    if exponent == whole == at and digits <= 18:
        integer = -np.int64(w) if negative else np.int64(w)
    return at, bits | (_U(negative) << _U(63)), integer


@lean_kernel
def _same(block: NDArray[np.uint8], at: Word, text: NDArray[np.uint8], begin: Word, size: Word) -> bool:
    """Whether a stretch of the block is a stretch of the text."""
    if size < _U(8):
        for j in range(size):  # noqa: SIM110  # compiled
            if block[at + _U(j)] != text[begin + _U(j)]:
                return False
        return True
    k: Word = _U(0)
    while k + _U(8) < size:
        if word(block, at + k) != word(text, begin + k):
            return False
        k += _U(8)
    return bool(word(block, at + size - _U(8)) == word(text, begin + size - _U(8)))


@lean_kernel
def take(
    block: NDArray[np.uint8],
    begin: NDArray[np.int64],
    length: NDArray[np.int64],
    text: NDArray[np.uint8],
    edges: NDArray[np.uint64],
    slot: NDArray[np.int64],
    rows: NDArray[np.int64],
    stamp: NDArray[np.int64],
    latest: int,
    kept: NDArray[np.uint64],
    whole: NDArray[np.int64],
    powers: NDArray[np.uint64],
    left: NDArray[np.bool_],
    values: NDArray[np.float64],
    header: NDArray[np.int64],
) -> None:
    """Take the messages at `begin` (n,) that are `left` and are the `text` with other numbers.

    The text between numbers k - 1 and k is `text[edges[k]:edges[k + 1]]`. Number k is kept as `slot[k]`, if
    that is not negative; those kept as `rows` (p,) go to `values` (p, n), and stamps, kept as `stamp`
    (2 or 0,), of up to `latest` seconds and nanoseconds to `header` (n,). `kept`, `whole` (k,) are scratch.
    """
    bits = values.view(np.uint64)
    for row in range(begin.size):
        if not left[row]:
            continue
        at = _U(begin[row])
        end = _U(begin[row] + length[row])
        alike = True
        for k in range(slot.size + 1):
            size = edges[k + 1] - edges[k]
            if size > end - at or not _same(block, at, text, edges[k], size):
                alike = False
                break
            at += size
            if k < slot.size:
                at, number, integer = _number(block, at, end, powers)
                if at == _U(0):
                    alike = False
                    break
                if slot[k] >= 0:
                    kept[slot[k]], whole[slot[k]] = number, integer
        if not alike or at != end:
            continue
        left[row] = False
        for k in range(rows.size):
            bits[k, row] = kept[rows[k]]
        if stamp.size:
            seconds, rest = whole[stamp[0]], whole[stamp[1]]
            if -latest <= seconds <= latest and -latest <= rest <= latest:
                header[row] = seconds * 1_000_000_000 + rest

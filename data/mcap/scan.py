"""Loops over the bytes of large files, compiled: numba takes longer to load than a small file to read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data.compiled import kernel

HEADER_SIZE = 9  # opcode u8, length u64


@kernel
def scan(
    block: NDArray[np.uint8],
    begin: int,
    among: NDArray[np.bool_],
    most: int,
    opcode: NDArray[np.uint8],
    start: NDArray[np.int64],
    length: NDArray[np.int64],
) -> tuple[int, int]:
    """Step through records from `begin` until one does not fit, is not `among` (256,), or there are `most`.

    Returns how many there were and where it stopped; `opcode`, `start` and `length` take the first of them,
    as many as they hold.
    """
    here, count = begin, 0
    while here + HEADER_SIZE <= block.size and count < most:
        code = block[here]
        size = np.uint64(0)
        for k in range(8):
            size |= np.uint64(block[here + 1 + k]) << np.uint64(8 * k)
        if not among[code] or size > np.uint64(block.size - here - HEADER_SIZE):
            break
        if count < opcode.size:
            opcode[count], start[count], length[count] = code, here + HEADER_SIZE, np.int64(size)
        count += 1
        here += HEADER_SIZE + int(size)
    return count, here


@kernel
def prove(
    block: NDArray[np.uint8],
    begin: NDArray[np.int64],
    template: NDArray[np.uint8],
    mask: NDArray[np.uint8],
    same: NDArray[np.bool_],
) -> None:
    """For each message at `begin` (n,), all of which lie in the block, whether its masked bits agree."""
    for k in range(begin.size):
        row = block[begin[k] : begin[k] + template.size]
        differs = np.uint8(0)
        for j in range(template.size):
            differs |= (row[j] ^ template[j]) & mask[j]
        same[k] = differs == 0

"""The messages of one block, each that can be read, and what is to be said of the others.

A block is a chunk's content, or a stretch of a file outside chunks. One message in it that cannot be read
(its channel is nowhere declared, its stamp is past the year 2262, it is shorter than its own prefix) costs
that message, not the block: the others are where they were.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from data.mcap.declarations import Declarations
from data.mcap.limits import MOST_LOSSES
from data.mcap.records import HEADER, MESSAGE_PREFIX, ByteArray, Damage, Messages, Tiling, gather, messages

BLOCK_OPCODES: Final = frozenset({int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE)})
_STAMPS: Final = slice(6, MESSAGE_PREFIX)  # of a message's prefix: log and publish time
_FEW: Final = 16  # messages on an undeclared channel; with more in a block it is a channel of its own
_FOREIGN: Final = np.array([opcode < 16 and opcode not in BLOCK_OPCODES for opcode in range(256)])  # of ours


@dataclass(frozen=True)
class Dropped:
    """Records of a block that are not read."""

    begin: int  # first byte, in the block
    end: int
    why: str
    before: int | None = None  # [ns] log times of the readable messages around it, within the block
    behind: int | None = None
    gap: bool = True  # whether what is missing may be missed between those two
    time_range: tuple[int, int] | None = None  # [ns] its own log times


def readable(
    data: ByteArray,
    tiling: Tiling,
    listed: list[Dropped],
    declared: Declarations,
    stand_in: Callable[[], None],
    *,
    compiled: bool,
) -> tuple[Messages, list[Dropped]]:
    """A block's messages on the declared channels, and what else was in it.

    `listed` are the declarations that were refused; `stand_in` seeks further ones where some are missing.

    Raises
    ------
    Damage
        When too many places in it cannot be read.
    """
    dropped = _foreign(tiling)
    try:
        found = messages(data, tiling, compiled=compiled)
    except Damage as damage:
        odd = _odd(data, tiling)
        dropped += [_stretch(tiling, run, damage.why) for run in _runs(odd)]
        found = messages(data, _without(tiling, odd), compiled=compiled)
    known = declared.declared[found.channel]
    if not known.all():
        stand_in()
        known = declared.declared[found.channel]
    if not known.all():
        dropped += _undeclared(found, known, declared)
        found = found.where(known)
    return found, [_placed(one, found) for one in (*listed, *dropped)]


def refused(tiling: Tiling, first: int, count: int, why: str, gap: bool) -> Dropped:
    """Declarations that were not taken, the first of them a record of the tiling.

    `gap`: they contradict themselves, and may have been messages.
    """
    one = _stretch(tiling, (first, first + 1), why if count == 1 else f"{why} ({count} of them)")
    return Dropped(one.begin, one.end, one.why, gap=gap)


def _foreign(tiling: Tiling) -> list[Dropped]:
    """Records that have no place among messages, such as a chunk within a chunk."""
    odd = _FOREIGN[tiling.opcode]
    if not odd.any():
        return []
    return [
        _stretch(tiling, run, f"a {Opcode(int(tiling.opcode[run[0]])).name.lower()} record among messages")
        for run in _runs(odd)
    ]


def _odd(data: ByteArray, tiling: Tiling) -> NDArray[np.bool_]:
    """Which records (n,) are messages too short for their prefix, or stamped past the year 2262."""
    mine = tiling.opcode == Opcode.MESSAGE
    odd: NDArray[np.bool_] = mine & (tiling.length < MESSAGE_PREFIX)
    rest = np.flatnonzero(mine & ~odd)
    prefix = gather(data, tiling.begin[rest], MESSAGE_PREFIX)
    stamps = np.ascontiguousarray(prefix[:, _STAMPS]).view("<u8")
    odd[rest] = (stamps > np.iinfo(np.int64).max).any(axis=1)
    return odd


def _undeclared(found: Messages, known: NDArray[np.bool_], declared: Declarations) -> list[Dropped]:
    """Messages on channels of which nothing is known.

    A few in a block may be anyone's, with a number that was damaged; many are a channel of their own, and
    nothing is missing from the others.
    """
    counts = np.bincount(found.channel[~known], minlength=1)
    many = np.flatnonzero(counts > _FEW)
    few = ~known & ~np.isin(found.channel, many)
    dropped = []
    for begin, end in _runs(few):
        numbers = np.unique(found.channel[begin:end])
        count = f"{end - begin} message{'s' * (end - begin > 1)}"
        dropped.append(
            _span(found, np.arange(begin, end), f"{count} on {declared.missing(numbers)}", gap=True)
        )
    if many.size:
        mine = np.flatnonzero(~known & ~few)
        why = f"{mine.size} messages among others, on {declared.missing(many.astype(np.uint16))}"
        dropped.append(_span(found, mine, why, gap=False))
    return dropped


def _span(found: Messages, mine: NDArray[np.intp], why: str, *, gap: bool) -> Dropped:
    first, last = mine[0], mine[-1]
    begin = int(found.begin[first]) - MESSAGE_PREFIX - HEADER.size
    log = found.log_time[mine]
    times = (int(log.min()), int(log.max()))
    return Dropped(begin, int(found.begin[last] + found.length[last]), why, gap=gap, time_range=times)


def _stretch(tiling: Tiling, run: tuple[int, int], why: str) -> Dropped:
    first, last = run[0], run[1] - 1
    count = f" ({run[1] - run[0]} of them)" if last > first else ""
    end = int(tiling.begin[last] + tiling.length[last])
    return Dropped(int(tiling.begin[first]) - HEADER.size, end, why + count)


def _placed(one: Dropped, found: Messages) -> Dropped:
    """With the log times of the messages around it."""
    if not one.gap:
        return one
    k = int(np.searchsorted(found.begin, one.begin))
    before = int(found.log_time[k - 1]) if k else None
    behind = int(found.log_time[k]) if k < found.begin.size else None
    return Dropped(one.begin, one.end, one.why, before, behind, True, one.time_range)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last of each stretch of true values; Damage when there are too many."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    if edges.size > 2 * MOST_LOSSES:
        raise Damage(0, f"more than {MOST_LOSSES} places among its messages cannot be read")
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def _without(tiling: Tiling, odd: NDArray[np.bool_]) -> Tiling:
    kept = ~odd
    return Tiling(tiling.opcode[kept], tiling.begin[kept], tiling.length[kept], tiling.end)

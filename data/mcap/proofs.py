"""What a walk has proved so far, and what it has lost: the making of an `Integrity`.

A loss is told with the log times around it: the latest one in the block before it, and the earliest one in
the next block behind it, which is not known yet when it is found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from data.integrity import Checksums, Integrity, Loss
from data.mcap.limits import MOST_LOSSES
from data.mcap.records import Messages

Times = tuple[int, int]  # first and last [ns]


class Proofs:
    """Gathers what one walk finds."""

    def __init__(self) -> None:
        self.chunks = 0  # intact ones
        self.messages = 0  # readable ones
        self.promised: int | None = None  # messages, by the file's own statistics
        self.notes: list[str] = []
        self.log: Times | None = None  # of the readable messages that have a time
        self.publish: Times | None = None
        self._latest: int | None = None  # log time of the last block [ns]
        self._losses: list[Loss] = []
        self._waiting: list[int] = []  # losses behind which nothing has been read yet
        self._unproved = 0  # messages without a checksum
        self._proved = False  # whether anything has one

    @property
    def integrity(self) -> Integrity:
        """What is proved."""
        checksums: Checksums = "verified" if self._proved and not self._unproved else "absent"
        return Integrity(
            checksums="failed" if self._losses else checksums,
            losses=tuple(self._losses),
            chunks=self.chunks,
            messages=self.messages,
            time_range=self.log,
            notes=tuple(self.notes),
            promised=self.promised,
            unproved=self._unproved,
        )

    @property
    def whole(self) -> bool:
        """Whether nothing is lost."""
        return not self._losses

    @property
    def full(self) -> bool:
        """Whether so much is lost that no more is sought."""
        return len(self._losses) >= MOST_LOSSES

    def lost_to(self, end: int) -> bool:
        """Whether the last loss reaches to there."""
        return bool(self._losses) and self._losses[-1].end == end

    def lose(
        self, begin: int, end: int, why: str, *, time_range: Times | None = None, gap: bool = True
    ) -> None:
        """Note that bytes are lost; with `gap`, messages may be missing at that place."""
        if gap:
            self._waiting.append(len(self._losses))
        self._losses.append(Loss(begin, end, why, time_range, self._latest if gap else None))

    def count(self, found: Messages, losses: list[tuple[Loss, bool]], *, checked: bool) -> None:
        """Take in a block's messages, and the losses among them with whether each leaves a gap."""
        before = self._latest
        timed = _set(found.log_time)
        if timed.size:
            for k in self._waiting:
                self._losses[k] = replace(self._losses[k], behind=int(timed.min()))
            self._waiting.clear()
            self._latest = int(timed.max())
            self.log = _wider(self.log, (int(timed.min()), self._latest))
        published = _set(found.publish_time)
        if published.size:
            self.publish = _wider(self.publish, (int(published.min()), int(published.max())))
        for loss, gap in losses:
            if gap and loss.behind is None:
                self._waiting.append(len(self._losses))
            own = before if loss.before is None else loss.before
            self._losses.append(replace(loss, before=own) if gap else loss)
        self.messages += found.channel.size
        self._proved |= checked
        self._unproved += 0 if checked else found.channel.size

    def prove_all(self) -> None:
        """A checksum holds for everything that came before."""
        self._proved, self._unproved = True, 0


def _set(times: NDArray[np.int64]) -> NDArray[np.int64]:
    """The times that were set: those that are not 0."""
    return times if times.size and times.min() > 0 else times[times > 0]


def _wider(times: Times | None, more: Times) -> Times:
    return more if times is None else (min(times[0], more[0]), max(times[1], more[1]))

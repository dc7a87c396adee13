"""What can be proved of a file: verified, absent or failed; and what is lost.

A container with checksums can prove its content; one without can only be found free of contradictions. What
is damaged is named as a `Loss`: which bytes, which stretch of time where the file says so, and why. A log
with a loss is refused unless the user asked for what is left, and nothing is ever interpolated across one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, LogError, Severity

_MOST_NAMED: Final = 8  # losses in one sentence
_MOST_SPANS: Final = 4  # stretches of time in one sentence
_DISORDER: Final = 10**9  # [ns] by which a recorder may write messages out of order
Checksums = Literal["verified", "absent", "failed"]


@dataclass(frozen=True)
class Loss:
    """A part of the file that cannot be read."""

    begin: int  # first byte
    end: int  # one past the last byte
    why: str
    time_range: tuple[int, int] | None = None  # [ns] its own log times, where the file tells them
    before: int | None = None  # [ns] the latest log time read before it
    behind: int | None = None  # [ns] the earliest one read next behind it

    @property
    def text(self) -> str:
        """One clause: the bytes, the time where known, and why."""
        where = f"bytes {self.begin} to {self.end}" if self.end > self.begin else f"byte {self.begin}"
        return f"{where}{self._when}: {self.why}"

    @property
    def _when(self) -> str:
        if self.time_range is not None:
            return f", log time {_seconds(self.time_range[0])} to {_seconds(self.time_range[1])} s"
        if self.before is not None and self.behind is not None:
            return f", between log times {_seconds(self.before)} and {_seconds(self.behind)} s"
        if self.before is not None:
            return f", behind log time {_seconds(self.before)} s"
        if self.behind is not None:
            return f", before log time {_seconds(self.behind)} s"
        return ""


@dataclass(frozen=True)
class Integrity:
    """What the walk through a file has proved."""

    checksums: Checksums
    losses: tuple[Loss, ...] = ()
    chunks: int = 0  # intact ones
    messages: int = 0  # readable ones
    time_range: tuple[int, int] | None = None  # [ns] of the readable messages
    notes: tuple[str, ...] = ()  # oddities that cost nothing
    counted: str = "messages"  # what `messages` are called: rows in a table
    promised: int | None = None  # messages, by the file's own count
    unproved: int = 0  # readable messages that no checksum vouches for

    @property
    def whole(self) -> bool:
        """Whether nothing is lost."""
        return not self.losses

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Log times [ns] between which something is lost, in order, those that overlap as one."""
        merged: list[tuple[int, int]] = []
        known = [(loss.before, loss.behind) for loss in self.losses]
        ordered = sorted((a, b) for a, b in known if a is not None and b is not None and a < b)
        for before, behind in ordered:
            if merged and before < merged[-1][1]:
                merged[-1] = (merged[-1][0], max(behind, merged[-1][1]))
            else:
                merged.append((before, behind))
        return tuple(merged)

    @property
    def kept(self) -> tuple[tuple[int, int], ...]:
        """The stretches of log time [ns] of which nothing is known to be lost, in order."""
        if self.time_range is None:
            return ()
        first, last = self.time_range
        begins = [first, *(behind for _, behind in self.gaps)]
        ends = [*(before for before, _ in self.gaps), last]
        return tuple((begin, end) for begin, end in zip(begins, ends, strict=True) if begin <= end)

    def breaks(self, log_time: NDArray[np.int64]) -> tuple[int, ...]:
        """Before which of a topic's messages (n,) something of the file is lost.

        Nothing may be interpolated between such a message and the one before it.

        Parameters
        ----------
        log_time
            (n,) [ns], in the order of the file.

        Returns
        -------
        tuple of int
            Ascending, each from 1 to n - 1. Where the recorder's order leaves it open between which two
            messages the loss lies, all that it may be are given.
        """
        anew = np.flatnonzero(np.diff(log_time) < -_DISORDER) + 1  # where the clock began anew
        edges = [0, *anew.tolist(), log_time.size]
        known = [(loss.before, loss.behind) for loss in self.losses]
        places: set[int] = set()
        for before, behind in known:
            if before is None or behind is None:
                continue
            if behind < before - _DISORDER:
                places.update(k for k in anew.tolist() if log_time[k - 1] <= before and log_time[k] >= behind)
                continue
            for begin, end in pairwise(edges):
                latest = np.maximum.accumulate(log_time[begin:end])
                first = int(np.searchsorted(latest, min(behind, before + 1), "left"))
                last = int(np.searchsorted(latest, before, "right"))
                places.update(begin + k for k in range(first, last + 1) if 0 < k < end - begin)
        return tuple(sorted(places))

    @property
    def left(self) -> str:
        """What a salvage keeps, as a clause."""
        if not self.messages:
            return "nothing"
        parts = f"{self.messages} "
        if self.promised is not None and self.promised > self.messages:
            parts += f"of {self.promised} "
        parts += self.counted
        if self.chunks:
            parts += f" in {self.chunks} intact chunk" + "s" * (self.chunks != 1)
        if self.unproved:
            whose = "" if self.unproved == self.messages else f"{self.unproved} of them "
            parts += f" ({whose}without a checksum)"
        return parts + self._time_left()

    def _time_left(self) -> str:
        if self.time_range is None:
            return ""
        first, last = self.time_range
        if not self.gaps:
            return f", {_seconds(last - first)} s of log time from {_seconds(first)} s"
        total = sum(end - begin for begin, end in self.kept)
        spans = [f"{_seconds(begin)} to {_seconds(end)}" for begin, end in self.kept[:_MOST_SPANS]]
        more = f" and {len(self.kept) - _MOST_SPANS} more stretches" if len(self.kept) > _MOST_SPANS else ""
        return f", {_seconds(total)} of {_seconds(last - first)} s of log time: {', '.join(spans)} s{more}"

    def require(self, log: str, *, salvage: bool) -> tuple[Finding, ...]:
        """What is to be said of the file: its oddities, and what is lost if the user goes on with the rest.

        Raises
        ------
        LogError
            When something is lost and `salvage` is False, or nothing is left.
        """
        noted = tuple(Finding("E-FILE", Severity.WARN, note, log) for note in self.notes)
        if self.whole:
            return noted
        if not self.messages or not salvage:
            first = self.losses[0]
            others = f" (and {len(self.losses) - 1} more places)" if len(self.losses) > 1 else ""
            remedy = (
                f"`--salvage` would keep {self.left}, and interpolate nothing across what is lost."
                if self.messages
                else "Nothing in it can be saved; record it again or exclude it."
            )
            raise LogError(f"{log} is damaged at {first.text}{others}. {remedy}")
        lost = "; ".join(loss.text for loss in self.losses[:_MOST_NAMED])
        if len(self.losses) > _MOST_NAMED:
            lost += f"; and {len(self.losses) - _MOST_NAMED} more places"
        text = f"salvaged: lost {lost}. Kept {self.left}; no estimate uses what is lost"
        return (Finding("E-DAMAGE", Severity.WITHHOLD, text, log), *noted)


def _seconds(nanoseconds: int) -> str:
    return f"{nanoseconds * 1e-9:.3f}"

"""What can be proved of a file: verified, absent or failed; and what is lost.

A container with checksums can prove its content; one without can only be found free of contradictions. What
is damaged is named as a `Loss`: which bytes, which stretch of time where the file says so, and why. A log
with a loss is refused unless the user asked for what is left, and nothing is ever interpolated across one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from data.findings import Finding, LogError, Severity

_MOST_NAMED: Final = 8  # losses in one sentence
Checksums = Literal["verified", "absent", "failed"]


@dataclass(frozen=True)
class Loss:
    """A part of the file that cannot be read."""

    begin: int  # first byte
    end: int  # one past the last byte
    why: str
    time_range: tuple[int, int] | None = None  # [ns] log times, where the file tells them
    behind: int | None = None  # [ns] the latest log time read before it, where it has no times of its own

    @property
    def text(self) -> str:
        """One clause: the bytes, the time where known, and why."""
        when = ""
        if self.time_range is not None:
            first, last = self.time_range
            when = f", log time {first * 1e-9:.3f} to {last * 1e-9:.3f} s"
        elif self.behind is not None:
            when = f", behind log time {self.behind * 1e-9:.3f} s"
        return f"bytes {self.begin} to {self.end}{when}: {self.why}"


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

    @property
    def whole(self) -> bool:
        """Whether nothing is lost."""
        return not self.losses

    @property
    def left(self) -> str:
        """What a salvage keeps, as a clause."""
        if not self.messages:
            return "nothing"
        parts = f"{self.messages} {self.counted}"
        if self.chunks:
            parts += f" in {self.chunks} intact chunk" + "s" * (self.chunks != 1)
        if self.time_range is not None:
            first, last = self.time_range
            parts += f", {(last - first) * 1e-9:.3f} s of log time from {first * 1e-9:.3f} s"
        return parts

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

"""A file of typed columns, whatever its format: which there are, and their numbers exactly as stored.

A file that declares its types leaves nothing to be found out: a column is numbers or it is refused by name.
Integers are kept as integers until the first of them has been taken off, so that stamps since 1970 give
exact times; as a signal, an integer that no float holds is refused rather than rounded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from data import columns
from data.findings import LogError
from data.integrity import Integrity
from data.names import shown

FloatArray = NDArray[np.float64]
TIME_NAMES: Final = (*columns.TIME_NAMES, "tout")  # Simulink's too
_WHOLE: Final = 2**53  # up to which every integer is a float


@dataclass(frozen=True)
class Column:
    """One column as the file declares it."""

    name: str
    rows: int
    unit: str | None = None  # None: it declares none
    refused: str | None = None  # why it is no column of numbers


@dataclass(frozen=True)
class Values:
    """A column's numbers, in the type that they are stored in."""

    stored: NDArray[np.generic]  # (n,) integers or floats
    known: NDArray[np.bool_] | None = None  # (n,) False where there is no number; None: everywhere
    ticks: int = 1  # in one unit of the column; over 1 for stamps

    def floats(self) -> FloatArray:
        """(n,), NaN where there is no number [as declared]; raises LogError for what no float holds."""
        with np.errstate(invalid="ignore"):  # NaN of any kind
            found: FloatArray = self.stored.astype(np.float64)
        if self.ticks > 1:
            found /= self.ticks
        elif self.stored.dtype.kind in "iu" and self.stored.size:
            back = np.where(np.abs(found) < 2.0**63, found, 0.0).astype(self.stored.dtype)
            wrong = (back != self.stored) & (True if self.known is None else self.known)
            if wrong.any():
                row = int(np.argmax(wrong))
                raise LogError(
                    f"holds the integer {self.stored[row]} in row {row + 1}, which no float of 64 bits holds "
                    f"(beyond {_WHOLE} only some are); it would be another number. Store it as a float, "
                    "or less an offset"
                )
        return self._only_known(found)

    def since_first(self, begin: int) -> FloatArray:
        """From row `begin` on, minus the first number there, taken before rounding [as declared]."""
        stored = self.stored[begin:]
        known = np.isfinite(stored) if stored.dtype.kind == "f" else np.ones(stored.size, np.bool_)
        if self.known is not None:
            known &= self.known[begin:]
        if not known.any():
            return np.full(stored.size, np.nan)
        first = stored[int(np.argmax(known))]
        if stored.dtype.kind == "f":
            with np.errstate(invalid="ignore"):  # NaN of any kind, infinities
                steps: FloatArray = stored.astype(np.float64) - float(first)
        else:  # modulo 2^64, which is right for any two that are less than 2^63 apart
            steps = (stored.astype(np.uint64) - np.uint64(int(first) % 2**64)).astype(np.int64) / self.ticks
        return np.where(known, steps, np.nan)

    def _only_known(self, found: FloatArray) -> FloatArray:
        if self.known is None:
            return found
        return np.where(self.known, found, np.nan)


@dataclass(frozen=True)
class TableRead:
    """What was asked of one file."""

    values: Mapping[int, Values]  # by the column's place among the file's columns
    integrity: Integrity


class TableFile(Protocol):
    """An opened file of columns."""

    @property
    def columns(self) -> Sequence[Column]:
        """Every column, those included that hold no numbers."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """What the file says of the run, as text."""

    def find(self, source: str | int) -> int:
        """The place of the column that a campaign's name means; raises LogError."""

    def plain_time(self, beside: str | int) -> int | None:
        """The place of the column that is plainly the time of the one named `beside`; None: none is."""

    def read(self, wanted: Sequence[int]) -> TableRead:
        """The numbers of some columns; raises LogError where one holds none, or nothing can be read."""


def require_numbers(column: Column) -> None:
    """Raise LogError for a column that is none of numbers."""
    if column.refused is not None:
        raise LogError(f"{shown(column.name)!r} is no column of numbers: it holds {column.refused}")

"""How a rig's logs name things, and what turns a logged number into SI.

A `Signal` says where one quantity stands in one file format and how to convert it:

    SI value = logged value x (unit's factor) x scale x sign + offset

with the offset in SI. `Signals` collects the quantities of one format, `RigSignals` all formats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from data.findings import LogError
from data.recording import Axis
from data.units import Quantity, factor_to_si, parse_unit

FloatArray = NDArray[np.float64]
Format = Literal["csv", "mcap", "parquet", "mat", "bag"]
FORMATS: Final[tuple[Format, ...]] = get_args(Format)
Clock = Literal["header", "log", "publish"]
SUFFIXES: Final[dict[str, Format]] = {
    ".mcap": "mcap",
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".parquet": "parquet",
    ".mat": "mat",
    ".bag": "bag",
    ".db3": "bag",
    ".lvm": "csv",
}


@dataclass(frozen=True)
class Signal:
    """Where one quantity stands in one format, and its conversion.

    Raises LogError when the unit word is unknown, or scale, sign or offset cannot be.
    """

    source: str | int  # CSV, Parquet: header, or number from 0; MCAP, bag: topic:field[i]; MATLAB: data.q
    unit: str | None = None  # None: SI
    scale: float | None = None  # [-], for A or V [N m/A] or [N m/V]; None: 1
    sign: int = 1  # +1 or -1
    offset: float = 0.0  # [SI]

    def __post_init__(self) -> None:
        if self.unit is not None:
            parse_unit(self.unit)
        if self.sign not in (1, -1):
            raise LogError(f"the sign of {self.source!r} is {self.sign}; it must be 1 or -1")
        if self.scale is not None and (self.scale == 0.0 or not math.isfinite(self.scale)):
            raise LogError(f"the scale of {self.source!r} is {self.scale}; it must be finite and not 0")
        if not math.isfinite(self.offset):
            raise LogError(f"the offset of {self.source!r} is {self.offset}; it must be finite")

    def to_si(
        self, values: FloatArray, *, quantity: Quantity, axis: Axis, encoder_counts: float | None
    ) -> FloatArray:
        """Logged values (n,) in SI (n,).

        Raises
        ------
        LogError
            When the unit does not fit the quantity, or lacks the constant it needs.
        """
        factor = factor_to_si(
            self.unit,
            quantity=quantity,
            axis=axis,
            encoder_counts=encoder_counts,
            scaled=self.scale is not None,
        )
        total = factor * (1.0 if self.scale is None else self.scale) * self.sign
        if total == 1.0 and self.offset == 0.0:
            return values
        return values * total + self.offset


@dataclass(frozen=True)
class CsvDialect:
    """How a CSV file is written. What is None is found out by looking."""

    delimiter: str | None = None  # one character, or "whitespace"
    decimal: Literal[".", ","] | None = None
    encoding: str | None = None
    header: bool | None = None  # whether a row of names stands above the numbers
    units_row: bool | None = None  # whether a row of units stands between names and numbers
    comment: str | None = None  # what a line of comment begins with; empty: there are none
    quote: str | None = None  # one character around cells; empty: a quotation mark is like any other
    lines_before_numbers: int | None = None

    def __post_init__(self) -> None:
        delimiter, quote = self.delimiter, self.quote
        if delimiter not in {None, "whitespace"} and not _is_mark(delimiter or ""):
            raise LogError(f'the delimiter {delimiter!r} is not one ASCII character, nor "whitespace"')
        if quote and (not _is_mark(quote) or quote == delimiter):
            raise LogError(f"the quote {quote!r} is not one ASCII character other than the delimiter")


def _is_mark(text: str) -> bool:
    """Whether a text is one character that can stand between cells or around them."""
    return len(text) == 1 and text.isascii() and not text.isalnum() and text not in "\r\n\0.+-"


@dataclass(frozen=True)
class Signals:
    """The quantities of one format; those that a format does not name are None."""

    position: Signal | None = None
    torque: Signal | None = None
    time: Signal | None = None  # needed unless a column is plainly the time; messages: None is the stamp
    velocity: Signal | None = None
    reference: Signal | None = None
    clock: Clock | None = None  # messages: which stamp; None: the header's where sane, else the log's
    dialect: CsvDialect | None = None  # CSV: how the file is written, where it shall not be sniffed


@dataclass(frozen=True)
class RigSignals:
    """What a rig's logs call things, in each format it writes."""

    csv: Signals | None = None
    mcap: Signals | None = None
    parquet: Signals | None = None
    mat: Signals | None = None
    bag: Signals | None = None

    def of(self, file_format: Format) -> Signals:
        """The names in one format.

        Raises
        ------
        LogError
            When the campaign names nothing in that format.
        """
        found: Signals | None = getattr(self, file_format)
        if found is None:
            raise LogError(
                f'the campaign\'s [signals] names nothing for {file_format} logs; add {file_format} = "..." '
                "to position and torque"
            )
        return found


def log_format(path: Path) -> Format:
    """The format that a file's name promises, by its ending (`SUFFIXES`).

    Raises
    ------
    LogError
        When the ending is none of these.
    """
    found = SUFFIXES.get(path.suffix.lower())
    if found is None:
        raise LogError(f"{path.name}: logs are read by their ending, one of {', '.join(SUFFIXES)}; rename it")
    return found

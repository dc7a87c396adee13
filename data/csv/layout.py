"""How a CSV file is written: a value that can be shown, and frozen in the campaign."""

from __future__ import annotations

from dataclasses import dataclass

from data.csv.cells import Decimal
from data.signals import CsvDialect


@dataclass(frozen=True)
class CsvLayout:
    """What was found of one file."""

    delimiter: str  # one character, or "whitespace"
    decimal: Decimal
    encoding: str
    headers: tuple[str, ...]  # as they stand, empty where there is no header
    units: tuple[str | None, ...]  # what header, units row or name declare; None: nothing
    columns: int
    first_row: int  # lines before the first row of numbers
    comment: str | None
    metadata: dict[str, str]
    quote: str = '"'  # around cells; empty where a quotation mark is a character like any other
    units_row: bool = False

    @property
    def described(self) -> str:
        """One clause for a person."""
        names = {",": "comma", ";": "semicolon", "\t": "tab", "whitespace": "blanks"}
        parts = [
            f"{names.get(self.delimiter, self.delimiter)} between cells",
            f"decimal {'comma' if self.decimal == ',' else 'point'}",
            self.encoding,
            "a header" if self.headers else "no header",
            *(["a row of units"] if self.units_row else []),
            *([f"comments behind {self.comment}"] if self.comment else []),
        ]
        return ", ".join(parts)

    @property
    def frozen(self) -> CsvDialect:
        """The dialect that reads the file as it was read, with nothing left to find out."""
        return CsvDialect(
            delimiter=self.delimiter,
            decimal=self.decimal,
            encoding=self.encoding,
            header=bool(self.headers),
            units_row=self.units_row,
            comment=self.comment or "",
            quote=self.quote,
            lines_before_numbers=self.first_row,
        )

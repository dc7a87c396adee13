"""What stands above the numbers: names, units, settings.

Names are the nearest row above the numbers that is no row of units and no setting; it must have a name for
each column, or the numbers would go by the wrong names. Everything else above it is kept as metadata, under
its own key where it has one (`# r: 0.9`, `Date;2024-05-01`) and under its line number where not.

Simulink writes units and types between names and numbers, as `Unit: m/s` in each column. TwinCAT writes a
block of settings twice over for each channel, a label above its times and the value above its samples.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from data.columns import NO_UNIT
from data.csv.cells import is_number
from data.csv.records import Record
from data.findings import LogError
from data.names import shown
from data.units import known_unit

_SETTING: Final = re.compile(r"((?:[\w.\-/ ]{1,60}(?=:))|(?:[\w.\-]{1,60}(?= ?=))) ?[:=] *(.*)", re.DOTALL)
_UNITS_ROW: Final = re.compile(r"units?:?$|einheit(?:en)?:?$", re.IGNORECASE)
_COLUMN_SETTING: Final = re.compile(
    r"(units?|type|interp|blockpath|blkpath|portindex|busobject|complexity|sampletime|name|einheit): *(.*)",
    re.IGNORECASE,
)
_MOST_SETTINGS: Final = 1000
_NO_NAME: Final = re.compile(  # what stands between names and numbers and is neither a name nor a unit
    r"(l?real|float(ieee)?|double|single|u?d?int|bool)\d*|[iu](8|16|32|64)|f(4|8|32|64)|smp|avg|tot|abs|rel|raw"
    r"|[\d.,]+ [a-z]+|-",
    re.IGNORECASE,
)
_LABVIEW_UNITS: Final = "Y_Unit_Label"
LABVIEW_END: Final = "***End_of_Header***"


@dataclass
class Above:
    """What was found above the numbers."""

    names: tuple[str, ...] = ()
    units: list[str | None] | None = None
    units_row: bool = False
    paired: bool = False  # TwinCAT's block
    settings: list[tuple[str, str]] = field(default_factory=list)  # from the numbers upwards

    def note(self, key: str, value: str) -> None:
        """Keep a setting."""
        self.settings.append((" ".join(key.split()), " ".join(value.split())))

    def of_column(self, number: int) -> str:
        """What a column is called."""
        return (self.names[number] if self.names else "") or f"column {number}"

    @property
    def metadata(self) -> dict[str, str]:
        """Settings by key; the first in the file counts."""
        found: dict[str, str] = {}
        for key, value in reversed(self.settings):
            if len(found) < _MOST_SETTINGS:
                found.setdefault(key, value)
        return found


def read_above(
    above: Sequence[Record],
    rows: Sequence[list[str]],
    *,
    columns: int,
    marks: tuple[str, ...],
    header: bool | None,
    units_row: bool | None,
    open_end: bool = False,
) -> Above:
    """Names, units and settings from the records above the numbers, whose cells are `rows`.

    Parameters
    ----------
    columns
        Of the numbers.
    marks
        What a comment begins with.
    header, units_row
        Whether there is a row of names, of units; None: found out.
    open_end
        Whether every row of numbers ends with a delimiter, so that its last cell is empty.

    Raises
    ------
    LogError
        When the row of names has not one for each column.
    """
    found = Above()
    unnamed: list[list[str]] = []
    paired = next((k for k, row in enumerate(rows) if names_pairs(row, columns)), None)
    if header is not False and paired is not None:
        _read_pairs(found, rows[paired:])
        above, rows = above[:paired], rows[:paired]
    rows = [_trimmed(row, columns, open_end=open_end) for row in rows]
    nearest = len(above) - 1  # where names may be commented out
    for k in range(len(above) - 1, -1, -1):
        record, row = above[k], rows[k]
        if not any(row) or record.text.startswith((LABVIEW_END, "sep=")):
            continue
        if record.commented(marks):
            names = _commented_names(record, row, columns, marks)
            fresh = not (found.units or found.names) and units_row is not False
            if names and fresh and is_units_row(names, columns):
                _take_units(found, names, columns)
                nearest = k - 1
            elif names and k == nearest and header is not False and not found.names:
                found.names = names
            else:
                _read_comment(found, record, marks)
        elif found.names or header is False:
            if not (found.names or found.units) and units_row is True:
                _take_units(found, row, columns)
            else:
                _read_setting(found, record, row)
        elif _is_column_settings(row):
            unnamed.append(row)
        elif found.units is None and _is_units(row, rows[:k], columns, units_row=units_row):
            _take_units(found, row, columns)
        elif _is_one_setting(row, columns) or (header is not True and _names_nothing(row)):
            _read_setting(found, record, row)
        else:
            _take_names(found, record, row, columns)
    for row in unnamed:
        _read_column_settings(found, row, columns)
    return found


def _trimmed(row: Sequence[str], columns: int, *, open_end: bool = False) -> list[str]:
    """A row without the empty cells behind its last column, and without LabVIEW's column of comments.

    With `open_end`, the empty cell that the rows of numbers end with is added where it is missing.
    """
    cells = list(row)
    while len(cells) > columns and cells[-1].lower() in {"", "comment"}:
        cells.pop()
    return [*cells, ""] if open_end and len(cells) == columns - 1 else cells


def _is_units(
    row: Sequence[str], above: Sequence[list[str]], columns: int, *, units_row: bool | None
) -> bool:
    """Whether a row holds units; some words of it may be unknown here, if names stand above it."""
    if units_row is not None:
        return units_row
    if is_units_row(row, columns):
        return True
    words = [word for word in map(_unit_word, row) if word.lower() not in NO_UNIT]
    known = sum(known_unit(word) is not None for word in words)
    if len(row) != columns or known < 2 or 2 * known < len(words) or not above:
        return False
    names = [name for name in above[-1] if name]
    return (
        len(above[-1]) == columns
        and len(names) >= len(words)
        and not any(is_number(name, ".") or is_number(name, ",") for name in names)
        and not any(known_unit(name) for name in names if len(name) > 1)
    )


def _names_nothing(row: Sequence[str]) -> bool:
    """Whether a row holds types, rates and the like, which are neither names nor units."""
    return all(not cell or _NO_NAME.fullmatch(cell) for cell in row)


def _take_names(found: Above, record: Record, row: list[str], columns: int) -> None:
    filled = [cell for cell in row if cell]
    if len(filled) == 1 and columns > min(len(row), 2):
        _read_setting(found, record, row)  # a title
        return
    names = row if len(row) == columns else _joined_units(row)
    if len(names) != columns:
        raise LogError(
            f"line {record.first + 1} names {len(names)} columns ({shown(', '.join(filled), 60)}), but the "
            f"rows of numbers have {columns} cells: the numbers would go by wrong names. Is a decimal comma "
            "taken for one between cells? Freeze `delimiter` and `decimal` under `dialect` in campaign.toml, "
            "or `header = false` if that line holds no names"
        )
    found.names = tuple(" ".join(name.split()) for name in names)


def _joined_units(row: Sequence[str]) -> list[str]:
    """Names between blanks with the units that stand behind them: `u`, `[N`, `m]` is one."""
    names: list[str] = []
    for cell in row:
        last = names[-1] if names else ""
        opened = last.count("[") + last.count("(") > last.count("]") + last.count(")")
        if names and (opened or cell[:1] in {"[", "("}):
            names[-1] = f"{last} {cell}"
        else:
            names.append(cell)
    return names


def _take_units(found: Above, row: Sequence[str], columns: int) -> None:
    words = [_unit_word(word) for word in (*row, *[""] * (columns - len(row)))][:columns]
    found.units = [word if _is_unit(word) else None for word in words]
    found.units_row = True
    strange = [word for word in words if word.lower() not in NO_UNIT and not known_unit(word)]
    if strange and not (len(strange) == 1 and _UNITS_ROW.match(strange[0])):
        found.note("units", ", ".join(words))


def _unit_word(cell: str) -> str:
    """A unit without its brackets; oscilloscopes write `in V`."""
    return cell.strip("[]() ").removeprefix("in ")


def _is_unit(word: str) -> bool:
    """Whether a word in a unit's place is meant as one, be it known here or not."""
    return word.lower() not in NO_UNIT and not _UNITS_ROW.match(word) and not is_number(word, ".")


def is_units_row(row: Sequence[str], columns: int) -> bool:
    """Whether a row holds the units of the columns."""
    if len(row) != columns:
        return False
    first = row[0]
    if _UNITS_ROW.match(first):
        return True
    words = [_unit_word(word) for word in row]
    known = [known_unit(word) is not None for word in words if word.lower() not in NO_UNIT]
    # A header of single letters (`t`, `s`, `A`) is rarely all units; two known words, or a 1, make a row.
    enough = min(2, columns) - any(word in {"-", "1"} for word in words)
    return len(known) >= max(enough, 1) and all(known)


def _is_column_settings(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return bool(filled) and all(_COLUMN_SETTING.fullmatch(cell) for cell in filled)


def _read_column_settings(found: Above, row: Sequence[str], columns: int) -> None:
    """`Unit: m/s`, `Type: double` and the like in single columns."""
    for k, cell in enumerate(row[:columns]):
        setting = _COLUMN_SETTING.fullmatch(cell)
        if setting is None:
            continue
        word = setting[2].strip("[]() ")
        if setting[1].lower() in {"unit", "units", "einheit"} and _is_unit(word):
            found.units = found.units or [None] * columns
            found.units[k] = word
        found.note(f"{found.of_column(k)} {setting[1]}", setting[2])


def _is_one_setting(row: Sequence[str], columns: int) -> bool:
    """`Key: value` in one cell, or `Key:` with values behind it."""
    filled = [cell for cell in row if cell]
    if len(filled) == 1 and columns > 1:
        return _SETTING.fullmatch(filled[0]) is not None
    return len(filled) > 1 and row[0].endswith(":")


def _read_setting(found: Above, record: Record, row: Sequence[str]) -> None:
    filled = [cell for cell in row if cell]
    if not filled:
        return
    setting = _SETTING.fullmatch(filled[0]) if len(filled) == 1 else None
    if setting is not None:
        found.note(setting[1], setting[2])
    elif len(filled) > 1 and row[0]:
        found.note(filled[0].rstrip(":"), ", ".join(filled[1:]))
        if row[0] == _LABVIEW_UNITS and found.names and not found.units:
            cells = [*row, *[""] * len(found.names)][: len(found.names)]
            found.units = [None, *(word if _is_unit(word) else None for word in cells[1:])]
    else:
        found.note(f"line {record.first + 1}", ", ".join(filled))


def _read_comment(found: Above, record: Record, marks: tuple[str, ...]) -> None:
    text = record.text.lstrip().lstrip("".join(marks)).strip()
    setting = _SETTING.fullmatch(text)
    if setting is not None:
        found.note(setting[1].strip(), setting[2].strip())
    elif text:
        found.note(f"line {record.first + 1}", text)


def _commented_names(
    record: Record, row: Sequence[str], columns: int, marks: tuple[str, ...]
) -> tuple[str, ...]:
    """Names behind a comment mark, as numpy writes them; empty when the line is something else."""
    if re.match(r"^\W+[^:,;\t]+:", record.text) or not row:
        return ()
    mark = next(mark for mark in marks if record.text.lstrip().startswith(mark))
    cells = [cell for cell in (row[0].lstrip().removeprefix(mark).strip(), *row[1:]) if cell]
    names = cells if len(cells) == columns else _joined_units(cells)
    numeric = any(is_number(name, ".") or is_number(name, ",") for name in names)
    return tuple(names) if len(names) == columns and not numeric else ()


def names_pairs(row: Sequence[str], columns: int) -> bool:
    """Whether a row is TwinCAT's: `Name`, a channel, `Name`, a channel."""
    cells = _trimmed(row, columns)
    return columns % 2 == 0 and len(cells) == columns and {cell.lower() for cell in cells[0::2]} == {"name"}


def _read_pairs(found: Above, rows: Sequence[list[str]]) -> None:
    """TwinCAT's block: a label above each channel's times, its value above its samples."""
    channels = rows[0][1::2]
    found.names = tuple(name for channel in channels for name in ("time", channel))
    found.paired = True
    found.units = [None] * len(found.names)
    found.units[0::2] = ["ms"] * len(channels)
    for row in rows[1:]:
        for k, (label, value) in enumerate(zip(row[0::2], row[1::2], strict=False)):
            if k < len(channels) and _UNITS_ROW.match(label):
                word = value.strip("[]() ")
                found.units[2 * k + 1] = word if _is_unit(word) else None
            if k < len(channels) and label and value:
                found.note(f"{channels[k]} {label}", value)

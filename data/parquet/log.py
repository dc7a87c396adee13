"""A rig log as Parquet, read: flat columns of integers, floats and stamps, exactly as stored.

The footer tells what there is; the pages are looked through (`pages`) before pyarrow unpacks them, one row
group at a time. A row group with a page that cannot be right is lost, the others stand. Without its footer,
which is written last, a file tells nothing of itself.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from itertools import chain
from typing import Final, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from data.columns import called, declared_unit, is_time
from data.findings import LogError
from data.integrity import Checksums, Integrity, Loss
from data.mcap.records import ByteArray
from data.names import nearest, shown
from data.parquet.footer import RowGroup, read_footer
from data.parquet.pages import PageError, Pages, look_through
from data.tables.table import TIME_NAMES, Column, TableRead, Values, require_numbers

_FEW_ROWS: Final = 1 << 20  # that any file may hold
_MOST_ROWS_A_BYTE: Final = 64
_TICKS: Final = {"s": 1, "ms": 1000, "us": 1_000_000, "ns": 1_000_000_000}
_FAILURES: Final = (
    pa.ArrowException,
    OSError,
    ValueError,
    LookupError,
    TypeError,
    OverflowError,
    MemoryError,
    NotImplementedError,
)
_OUR_OWN: Final = frozenset({b"ARROW:schema", b"pandas", b"PANDAS_ATTRS"})  # keys that say nothing of the run
Result = TypeVar("Result")


class ParquetLog:
    """An opened Parquet file; raises LogError where it has no footer, or one that cannot be right."""

    def __init__(self, content: ByteArray) -> None:
        self._content = content
        self._footer = read_footer(content.data)
        self._file: pq.ParquetFile = _guarded(self._open, "its footer cannot be right")
        self._schema: pa.Schema = _guarded(lambda: self._file.schema_arrow, "its schema cannot be right")
        rows = self._footer.rows
        if rows > max(_FEW_ROWS, _MOST_ROWS_A_BYTE * content.size):
            raise LogError(f"its footer claims {rows} rows in {content.size} bytes: no log has")
        names = Counter(field.name for field in self._schema)
        self.columns: tuple[Column, ...] = tuple(
            _column(field, rows, alone=names[field.name] == 1) for field in self._schema
        )

    def _open(self) -> pq.ParquetFile:
        return pq.ParquetFile(
            pa.BufferReader(pa.py_buffer(self._content.data)),
            page_checksum_verification=True,
            thrift_string_size_limit=1 << 24,
            thrift_container_size_limit=1 << 20,
            arrow_extensions_enabled=False,
        )

    @property
    def groups(self) -> tuple[RowGroup, ...]:
        """Its row groups."""
        return self._footer.groups

    @property
    def writer(self) -> str:
        """What wrote it, as it says."""
        return self._footer.writer

    @cached_property
    def metadata(self) -> Mapping[str, str]:
        """Key and value pairs of the footer, and the attributes of a pandas frame."""
        stored: dict[bytes, bytes] = dict(self._schema.metadata or {})
        attributes = _attributes(stored.get(b"PANDAS_ATTRS", b""))
        own = {
            key.decode(errors="replace"): value.decode(errors="replace")
            for key, value in stored.items()
            if key not in _OUR_OWN
        }
        return attributes | own

    def find(self, source: str | int) -> int:
        """A column by its exact name, its name without the unit, or its number from 0; raises LogError."""
        names = [column.name.strip() for column in self.columns]
        if isinstance(source, str):
            matching = called(names, source)
            if len(matching) > 1:
                raise LogError(f"{len(matching)} columns are called {shown(source)!r}; rename them")
            if matching:
                return matching[0]
            raise LogError(f"no column {shown(source)!r}; the log has {nearest(source, names)}")
        if not 0 <= source < len(names):
            raise LogError(f"no column number {source}; the log has {len(names)}, counted from 0")
        if names.count(names[source]) > 1:
            raise LogError(f"several columns are called {shown(names[source])!r}; rename them")
        return source

    def plain_time(self, beside: str | int) -> int | None:
        """The column with a plain name for it, else the only one of stamps."""
        for k, column in enumerate(self.columns):
            if is_time(column.name, TIME_NAMES) and column.refused is None:
                return k
        stamps = [k for k, field in enumerate(self._schema) if pa.types.is_timestamp(field.type)]
        return stamps[0] if len(stamps) == 1 else None

    def read(self, wanted: Sequence[int]) -> TableRead:
        """The numbers of some columns, of the row groups that are whole; raises LogError."""
        for place in wanted:
            require_numbers(self.columns[place])
        names = [self._schema[place].name for place in wanted]
        losses, rows, intact = list(self._losses), 0, 0
        parts: list[list[Values]] = [[] for _ in wanted]
        for group, own in enumerate(self.groups):
            if group in self._lost:
                continue
            try:
                found = _guarded(partial(self._group, group, names), "a row group cannot be unpacked")
            except LogError as error:
                losses.append(Loss(*own.span(self._content.size), str(error)))
                continue
            rows += own.rows
            intact += 1
            for part, values in zip(parts, found, strict=True):
                part.append(values)
        integrity = Integrity(
            "failed" if losses else self._checksums,
            losses=tuple(losses),
            chunks=intact,
            messages=rows,
            counted="rows",
        )
        return TableRead({p: _joined(part) for p, part in zip(wanted, parts, strict=True)}, integrity)

    def _group(self, group: int, names: Sequence[str]) -> list[Values]:
        table = self._file.read_row_group(group, columns=list(names), use_threads=False)
        return [_values(table.column(name)) for name in names]

    @cached_property
    def _looked(self) -> dict[int, list[Pages] | PageError]:
        """What the pages of each row group are, or why they cannot be right."""
        return {number: self._look(group) for number, group in enumerate(self.groups)}

    def _look(self, group: RowGroup) -> list[Pages] | PageError:
        flat = {(field.name,) for field in self._schema if not pa.types.is_nested(field.type)}
        found = []
        try:
            for column in group.columns:
                pages = look_through(self._content.data, column.begin, column.size)
                if column.path in flat and pages.values != group.rows:
                    raise PageError(
                        column.begin,
                        f"a column holds {pages.values} values where the footer tells {group.rows} rows",
                    )
                found.append(pages)
        except PageError as error:
            return error
        return found

    @property
    def _lost(self) -> Mapping[int, PageError]:
        return {group: why for group, why in self._looked.items() if isinstance(why, PageError)}

    @property
    def _losses(self) -> list[Loss]:
        return [
            Loss(
                *self.groups[group].span(self._content.size),
                f"{why}, at byte {why.place} in row group {group + 1} of {len(self.groups)}",
            )
            for group, why in self._lost.items()
        ]

    @property
    def _checksums(self) -> Checksums:
        pages = list(chain.from_iterable(found for found in self._looked.values() if isinstance(found, list)))
        whole = pages and all(column.checked and not column.unchecked for column in pages)
        return "verified" if whole else "absent"


def _guarded(act: Callable[[], Result], what: str) -> Result:
    """What pyarrow gives, its many exceptions being one of ours."""
    try:
        return act()
    except _FAILURES as error:
        raise LogError(f"{what} ({shown(str(error).strip() or type(error).__name__)})") from error


def _column(field: pa.Field, rows: int, *, alone: bool) -> Column:
    name = field.name
    if not alone:
        return Column(name, rows, refused="one of several columns of that name; rename them")
    if _ticks(field.type) is not None:
        return Column(name, rows, unit="s")
    said = {key.lower(): value for key, value in (field.metadata or {}).items()}
    unit = said.get(b"unit") or said.get(b"units") or b""
    return Column(
        name,
        rows,
        unit=unit.decode(errors="replace").strip() or declared_unit(name),
        refused=_refused(field.type),
    )


def _ticks(kind: pa.DataType) -> int | None:
    """Ticks in a second of a type of stamps or durations."""
    return _TICKS[kind.unit] if pa.types.is_timestamp(kind) or pa.types.is_duration(kind) else None


def _refused(kind: pa.DataType) -> str | None:
    """What a type is where it is none of numbers."""
    types = pa.types
    if types.is_integer(kind) or types.is_floating(kind) or _ticks(kind) is not None:
        return None
    if types.is_boolean(kind):
        return "true and false"
    if types.is_nested(kind):
        return f"nested values ({shown(str(kind), 60)})"
    return f"values of type {shown(str(kind), 60)}"


def _values(column: pa.ChunkedArray) -> Values:
    ticks = _ticks(column.type)
    if ticks is not None:
        column = column.cast(pa.int64())
    elif pa.types.is_float16(column.type):
        column = column.cast(pa.float32())
    known = column.is_valid().to_numpy() if column.null_count else None
    if known is not None:
        column = column.fill_null(0)
    return Values(column.to_numpy(), known, ticks or 1)


def _joined(parts: Sequence[Values]) -> Values:
    """A column from its row groups."""
    if not parts:
        return Values(np.zeros(0))
    known = None
    if any(part.known is not None for part in parts):
        known = np.concatenate(
            [np.ones(part.stored.size, np.bool_) if part.known is None else part.known for part in parts]
        )
    return Values(np.concatenate([part.stored for part in parts]), known, parts[0].ticks)


def _attributes(text: bytes) -> dict[str, str]:
    """The attributes of a pandas frame, those that are words or numbers."""
    try:
        found = json.loads(text) if text else {}
    except (ValueError, RecursionError):
        return {}
    if not isinstance(found, dict):
        return {}
    return {
        key: value if isinstance(value, str) else json.dumps(value)
        for key, value in found.items()
        if isinstance(value, str | int | float)
    }

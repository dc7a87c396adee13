"""A rig log as a MAT-file of version 5, read: vectors and columns of matrices, exactly as stored.

Each variable stands for itself: one that is damaged is lost, the others stand. Only what is asked for is
kept; the variables around it are unpacked, looked at and dropped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from data.columns import is_time
from data.findings import LogError
from data.integrity import Checksums, Integrity, Loss
from data.mat.arrays import Leaf, Numbers, Refused, Setting, leaves, numbers
from data.mat.elements import COMPRESSED, ElementError, Place, byte_order, unpacked, variables
from data.mcap.records import ByteArray
from data.names import nearest, shown
from data.tables.table import TIME_NAMES, Column, TableRead, Values, require_numbers

_MOST_LEAVES: Final = 10_000
_MOST_UNPACKED: Final = 100  # times the file, of all its variables together, above what anything may take
_FREE: Final = 1 << 28  # [bytes]


class MatLog:
    """An opened MAT-file; raises LogError where it is none, or holds more than any log."""

    def __init__(self, content: ByteArray) -> None:
        self._content = content.data
        self._order = byte_order(self._content)
        self._leaves: list[tuple[Place, Leaf]] = []
        self._losses: list[Loss] = []
        self._kinds: set[int] = set()
        self._unpacked = 0
        for place in variables(self._content, self._order):
            if isinstance(place, Loss):
                self._losses.append(place)
            else:
                self._take(place)
        self.columns: tuple[Column, ...] = tuple(
            Column(leaf.path, leaf.rows if isinstance(leaf, Numbers) else 0, refused=_why(leaf))
            for _, leaf in self._leaves
            if not isinstance(leaf, Setting)
        )
        self._places = [(place, leaf) for place, leaf in self._leaves if not isinstance(leaf, Setting)]

    def _take(self, place: Place) -> None:
        try:
            block = unpacked(self._content, place, self._order)
            self._unpacked += len(block)
            if self._unpacked > max(_FREE, _MOST_UNPACKED * len(self._content)):
                raise LogError("its variables unpack to far more than any log: it is refused")
            found = list(leaves(block, self._order))
        except ElementError as error:
            self._losses.append(Loss(place.begin, place.end, str(error)))
            return
        self._kinds.add(place.kind)
        self._leaves += [(place, leaf) for leaf in found]
        if len(self._leaves) > _MOST_LEAVES:
            raise LogError(f"it holds more than {_MOST_LEAVES} arrays: it is refused")

    @property
    def variables(self) -> int:
        """How many could be read."""
        return len({place for place, _ in self._leaves})

    @property
    def metadata(self) -> Mapping[str, str]:
        """Single numbers and lines of characters, by path; by their last name too, where only one has it."""
        whole = {leaf.path: leaf.text for _, leaf in self._leaves if isinstance(leaf, Setting)}
        last: dict[str, list[str]] = {}
        for path, text in whole.items():
            last.setdefault(path.rpartition(".")[2], []).append(text)
        return {name: texts[0] for name, texts in last.items() if len(texts) == 1} | whole

    @property
    def integrity(self) -> Integrity:
        """What is proved: compressed variables carry a checksum, others none."""
        checksums: Checksums = "verified" if self._kinds == {COMPRESSED} else "absent"
        return Integrity(
            "failed" if self._losses else checksums,
            losses=tuple(self._losses),
            messages=sum(isinstance(leaf, Numbers) for _, leaf in self._leaves),
            counted="arrays",
        )

    def find(self, source: str | int) -> int:
        """A column by its dotted path; raises LogError."""
        names = [column.name for column in self.columns]
        wanted = str(source).strip()
        matching = [k for k, name in enumerate(names) if name == wanted]
        if len(matching) > 1:
            raise LogError(f"{len(matching)} arrays are called {shown(wanted)!r}: save one of them")
        if matching:
            return matching[0]
        columns = [name for name in names if name.startswith(f"{wanted}[")]
        if columns:
            raise LogError(
                f"{shown(wanted)!r} is an array of {len(columns)} columns; say which, by [k] counted from 0: "
                f"{nearest(columns[0], columns)}"
            )
        if wanted in self.metadata:
            raise LogError(f"{shown(wanted)!r} is one value, no signal")
        raise LogError(f"no array {shown(wanted)!r}; the log has {nearest(wanted, names)}")

    def plain_time(self, beside: str | int) -> int | None:
        """A time beside the position in its struct, else in the structs around it."""
        around = str(beside).strip()
        while around:
            around = around.rpartition(".")[0]
            prefix = f"{around}." if around else ""
            for k, column in enumerate(self.columns):
                name = column.name.removeprefix(prefix)
                if column.name.startswith(prefix) and is_time(name, TIME_NAMES) and column.refused is None:
                    return k
        return None

    def read(self, wanted: Sequence[int]) -> TableRead:
        """The numbers of some columns; raises LogError where one holds none."""
        values: dict[int, Values] = {}
        by_variable: dict[Place, list[int]] = {}
        for k in wanted:
            require_numbers(self.columns[k])
            by_variable.setdefault(self._places[k][0], []).append(k)
        for place, mine in by_variable.items():
            block = unpacked(self._content, place, self._order)
            for k in mine:
                leaf = self._places[k][1]
                if isinstance(leaf, Numbers):
                    values[k] = Values(numbers(block, leaf, self._order))
        return TableRead(values, self.integrity)


def _why(leaf: Leaf) -> str | None:
    return leaf.why if isinstance(leaf, Refused) else None

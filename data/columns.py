"""Columns of numbers, whatever the format of the file: what their names say, what they range over."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.findings import LogError
from data.units import known_unit

FloatArray = NDArray[np.float64]
TIME_NAMES: Final = ("t", "time", "__time", "timestamp")  # plainly the time; formats have names of their own
NO_UNIT: Final = ("", "-", "1", "(none)", "none", "n/a")
_UNIT_SIGNS: Final = re.compile(r"[/·⋅*^°%²³⁻]")
_BRACKETED: Final = re.compile(r"^(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))$")
_SUFFIXED: Final = re.compile(r"^.+_(deg|rad|mrad|rpm)$")  # the only endings that cannot mean anything else


def bare(header: str) -> str:
    """A header without its unit: `q` for `q [deg]`."""
    found = _BRACKETED.match(header.strip())
    return (found[1] if found else header).strip()


def declared_unit(header: str) -> str | None:
    """The unit that a header declares, in brackets or by an ending that can mean nothing else; None: none.

    It may be one that is not known here. `q[0]` and `q (filtered)` declare none.
    """
    found = _BRACKETED.match(header.strip())
    if found is None:
        ending = _SUFFIXED.match(header.strip())
        return ending[1] if ending else None
    word = (found[2] or found[3] or "").strip()
    if known_unit(word):
        return word
    if not found[1] or word.lower() in NO_UNIT or word.isdecimal():
        return None
    unlike = found[2] is None and not known_unit(word.lower()) and not _UNIT_SIGNS.search(word)
    return None if unlike else word


def is_time(header: str, names: Sequence[str] = TIME_NAMES) -> bool:
    """Whether a column is plainly the time by its name; `T` is a temperature, a torque or a period."""
    plain = bare(header)
    return plain != "T" and plain.lower() in names


def called(names: Sequence[str], wanted: str) -> list[int]:
    """The places of the names that are the wanted one to the letter; where none is, without their units."""
    wanted = wanted.strip()
    exact = [k for k, name in enumerate(names) if name == wanted]
    return exact or [k for k, name in enumerate(names) if bare(name) == wanted]


def value_range(values: FloatArray) -> tuple[float | None, float | None, int]:
    """The smallest and the largest number of (n,), None where there is none, and how many are not finite."""
    finite = values[np.isfinite(values)]
    missing = int(values.size - finite.size)
    return (float(finite.min()), float(finite.max()), missing) if finite.size else (None, None, missing)


def require_one_length(path: Path, columns: Mapping[str, FloatArray]) -> None:
    """Raise LogError for columns that are to be written to a file and are not all (n,)."""
    lengths = {name: array.shape for name, array in columns.items()}
    if len(set(lengths.values())) > 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise LogError(f"{path.name}: the columns to write differ in shape: {lengths}")

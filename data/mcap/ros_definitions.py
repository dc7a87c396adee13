"""ROS message definitions as trees: what stands in a message, field by field.

A `ros1msg` or `ros2msg` schema is the text of a definition, and behind lines of "=" those of the types that
it uses, each headed "MSG: package/Type". Constants stand in no message; a bound on a length changes nothing.

Sources: wiki.ros.org/msg; ROS 2 design, "Interface definition using .msg files"; mcap.dev/spec/registry.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from data.findings import LogError
from data.names import shown

Dialect = Literal["ros1", "ros2"]
NUMBERS: Final = {  # and bytes of each
    "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4, "int64": 8, "uint64": 8,
    "float32": 4, "float64": 8,
}  # fmt: skip
OTHERS: Final = frozenset({"bool", "byte", "char", "string", "wstring", "time", "duration"})
_FIELD: Final = re.compile(r"^([\w/]+)(?:<=\d+)?(\[(<=)?(\d*)\])?\s+(\w+)\s*(=?)")
_SEPARATOR: Final = re.compile(r"^={3,}\s*$", re.MULTILINE)
_DEEPEST: Final = 16
_MOST_FIELDS: Final = 1024
_MOST_TEXT: Final = 1 << 20  # characters


@dataclass(frozen=True)
class Field:
    """A field: a primitive's kind, or "message" with the fields inside."""

    name: str
    kind: str
    length: int | None = None  # None: single; -1: an array of any length; else of exactly so many
    fields: tuple[Field, ...] = ()


def parse_definition(name: str, text: str, dialect: Dialect) -> tuple[Field, ...]:
    """The fields of a message type `name` ("package/Type" or "package/msg/Type").

    Raises
    ------
    LogError
        When the text cannot be read as definitions, lacks a type, or nests without end.
    """
    if len(text) > _MOST_TEXT:
        raise LogError(f"the definition of {shown(name)} has {len(text)} characters, over {_MOST_TEXT}")
    first, *others = _SEPARATOR.split(text)
    known = {_short(name): first}
    for other in others:
        head, _, body = other.strip().partition("\n")
        known.setdefault(_short(head.removeprefix("MSG:").strip()), body)
    return _fields(_short(name), known, dialect, budget=[_MOST_FIELDS], depth=0)


def _short(name: str) -> str:
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"


def _fields(
    name: str, known: Mapping[str, str], dialect: Dialect, *, budget: list[int], depth: int
) -> tuple[Field, ...]:
    if depth > _DEEPEST:
        raise LogError(f"the definition of {shown(name)} nests more than {_DEEPEST} deep")
    found = []
    for line in known[name].splitlines():
        plain = line.strip()
        if not plain or plain.startswith("#"):
            continue
        matched = _FIELD.match(plain)
        if matched is None:
            raise LogError(f"the definition of {shown(name)} holds {shown(plain, 60)!r}, which is no field")
        word, array, bound, size, own, constant = matched.groups()
        if constant:
            continue
        budget[0] -= 1
        if budget[0] < 0:
            raise LogError(f"the definition of {shown(name)} has more than {_MOST_FIELDS} fields")
        length = None if not array else int(size) if size and not bound else -1
        if word in NUMBERS or word in OTHERS:
            found.append(Field(own, word, length))
            continue
        inside = _fields(
            _resolved(word, name, known, dialect), known, dialect, budget=budget, depth=depth + 1
        )
        found.append(Field(own, "message", length, inside))
    return tuple(found)


def _resolved(word: str, within: str, known: Mapping[str, str], dialect: Dialect) -> str:
    """The full name of a type: relative to the package that uses it, where it names none."""
    if dialect == "ros1" and word == "Header":
        word = "std_msgs/Header"
    full = _short(word if "/" in word else f"{within.partition('/')[0]}/{word}")
    if full not in known:
        raise LogError(
            f"the definition of {shown(within)} uses {shown(full)}, which the schema does not hold"
        )
    return full

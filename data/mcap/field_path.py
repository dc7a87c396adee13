"""Where a number stands in a message: `topic:field`, `[i]` for arrays, `.` for nesting, `{joint}` by name.

/joint_states:position[0]          the first element of an array
/joint_states:position{link}       the element whose place in `name` is that of "link"
/rig/state:motor.current           a field of a field
/command:position                  a number, or an array that has exactly one element
/joint_states#3:position[0]        of the topic's channel 3, where two publish it at once
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Final

import numpy as np

from data.findings import LogError
from data.names import nearest, shown

Number = int | float | Decimal | np.integer[Any] | np.floating[Any]
_STEP: Final = re.compile(r"([^.\[\]{}]+)(?:\[(\d{1,6})\]|\{([^{}]*)\})?(?:\.|$)")
_DEEPEST: Final = 12  # nesting that is listed


@dataclass(frozen=True)
class Step:
    """One field, and which element of it."""

    name: str
    index: int | None = None
    joint: str | None = None


@dataclass(frozen=True)
class FieldPath:
    """A topic and the way to a number in its messages."""

    topic: str
    steps: tuple[Step, ...]
    text: str


def parse_path(text: str) -> FieldPath:
    """A field path from how it is written.

    Raises
    ------
    LogError
        When it is not of the form `topic:field`.
    """
    topic, colon, fields = text.partition(":")
    steps, at = [], 0
    while colon and (found := _STEP.match(fields, at)) and found.end() > at:
        index = None if found[2] is None else int(found[2])
        steps.append(Step(found[1], index, found[3]))
        at = found.end()
    if not topic or not steps or at < len(fields) or fields.endswith("."):
        raise LogError(
            f"{text!r} is no field path; write topic:field, like /joint_states:position[0], "
            "/joint_states:position{link} or /state:motor.current"
        )
    return FieldPath(topic, tuple(steps), text)


def resolve(message: object, path: FieldPath) -> float:
    """The number that the path leads to in a decoded message (attributes or mappings), as a float.

    Raises
    ------
    LogError
        When a field is missing, an element is not there, or the end is no number.
    """
    try:
        return float(_found(message, path))
    except OverflowError as error:
        raise LogError(f"{path.text} holds an integer too large for a float") from error


def resolve_exactly(message: object, path: FieldPath) -> Decimal:
    """The number that the path leads to, to its last digit.

    Raises
    ------
    LogError
        As `resolve`.
    """
    found = _found(message, path)
    return Decimal(found.item() if isinstance(found, np.integer | np.floating) else found)


def number(value: object, path: str) -> Number:
    """A number; the only element of an array of one.

    Raises
    ------
    LogError
        When it is no number (true and false are none), or an array of more.
    """
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes):
        if len(value) != 1:
            raise LogError(
                f"{path} is an array of {len(value)} elements; say which, by [i] from 0 or {{joint}}"
            )
        value = value[0]
    if isinstance(value, bool | np.bool_) or not isinstance(
        value, int | float | Decimal | np.integer | np.floating
    ):
        raise LogError(f"{path} is {_kind(value)}, not a number")
    return value


def leaves(message: object, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, object]]:
    """Every field path below a decoded message with its value; arrays of numbers stay whole."""
    for name, value in _fields(message).items():
        path = f"{prefix}{name}"
        if _fields(value) and depth < _DEEPEST:
            yield from leaves(value, f"{path}.", depth + 1)
        else:
            yield path, value


def _found(message: object, path: FieldPath) -> Number:
    here = message
    for step in path.steps:
        fields = _fields(here)
        if step.name not in fields:
            raise LogError(
                f"{path.text}: the messages have no field {step.name!r} there; they have "
                f"{nearest(step.name, fields)}"
            )
        inside = fields[step.name]
        here = inside if step.index is None and step.joint is None else _element(inside, fields, step, path)
    return number(here, path.text)


def _element(inside: object, fields: Mapping[str, object], step: Step, path: FieldPath) -> object:
    if not isinstance(inside, Sequence | np.ndarray) or isinstance(inside, str | bytes):
        raise LogError(f"{path.text}: {step.name} is {_kind(inside)}, not an array")
    index = step.index
    if index is None:
        names = fields.get("name")
        joints = [str(joint) for joint in names] if isinstance(names, Sequence) else []
        if step.joint not in joints:
            raise LogError(
                f"{path.text}: no joint {step.joint!r}; the log has {nearest(str(step.joint), joints)}"
            )
        index = joints.index(step.joint)
    if index >= len(inside):
        raise LogError(
            f"{path.text}: {shown(step.name)} has {len(inside)} elements, so there is no element {index}"
        )
    element: object = inside[index]
    return element


def _fields(value: object) -> Mapping[str, object]:
    if isinstance(value, Mapping):
        return value
    slots = getattr(type(value), "__slots__", ())
    return {name: getattr(value, name) for name in slots if hasattr(value, name)} if slots else {}


def _kind(value: object) -> str:
    if _fields(value):
        return "a group of fields (" + nearest("", _fields(value)) + ")"
    if isinstance(value, bool | np.bool_):
        return "true or false"
    return {"str": "text", "NoneType": "nothing", "bytes": "bytes"}.get(type(value).__name__, "an array")

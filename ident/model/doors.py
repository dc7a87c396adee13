"""The right kind of value at the door of a public function.

A function that takes a robot, a controller or a loop asks here first, so that a caller who hands over
something else is told which argument it is, and not of an attribute that is missing three calls below.
"""

from __future__ import annotations

from ident.model.friction import ModelError
from ident.model.numbers import shown


def expect(name: str, value: object, kind: type, source: str) -> None:
    """Raise `ModelError` unless the argument `name` is of a kind; `source` is the equation that needs it."""
    if not isinstance(value, kind):
        got = f"{shown(value)} (of type {type(value).__name__})"
        raise ModelError(f"{name} is {got}: a {kind.__name__} ({source})")

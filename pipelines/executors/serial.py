"""One after the other, in this process: the map that needs nothing and hides nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def serial_map(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Each result as soon as it is there, in the order of the items."""
    return map(function, items)

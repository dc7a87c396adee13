"""Binary messages of few layouts: each read by the first that can be proved of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from data.mcap.field_path import FieldPath
from data.mcap.layout import Layout, Place, Taken, place, take
from data.mcap.records import ByteArray

Recognise = Callable[[bytes], Layout | None]
S = TypeVar("S")
MOST_SHAPES: Final = 16  # of one channel's messages, before these are decoded one by one


def shapes(
    known: list[S],
    shown: Callable[[bytes], S | None],
    block: ByteArray,
    messages: tuple[NDArray[np.int64], NDArray[np.int64]],
    left: NDArray[np.bool_],
) -> Iterator[S]:
    """Shapes to read messages by while some are `left` (n,): those that are known, then those they show."""
    begin, length = messages
    for tried in range(MOST_SHAPES):
        if not left.any():
            return
        if tried == len(known):
            k = int(np.argmax(left))
            shape = shown(block[int(begin[k]) : int(begin[k] + length[k])].tobytes())
            if shape is None:
                return
            known.append(shape)
        yield known[tried]


class LayoutReader:
    """Reads the numbers at some paths out of blocks of binary messages, by `compiled` code or without."""

    def __init__(self, paths: Sequence[FieldPath], recognise: Recognise, *, compiled: bool) -> None:
        self._paths = paths
        self._recognise = recognise
        self._compiled = compiled
        self._layouts: list[tuple[Layout, list[Place]]] = []

    def read(self, block: ByteArray, begin: NDArray[np.int64], length: NDArray[np.int64]) -> Taken:
        """What can be read of the messages (n,) at `begin`."""
        taken = Taken.nothing(len(self._paths), begin.size)
        for layout, places in shapes(self._layouts, self._known, block, (begin, length), taken.left):
            if np.any(length == layout.size):
                take(layout, places, block, (begin, length), taken, compiled=self._compiled)
        return taken

    def _known(self, raw: bytes) -> tuple[Layout, list[Place]] | None:
        """The layout that a message shows, and where the paths lead; None where it has none with them all."""
        layout = self._recognise(raw)
        if layout is None:
            return None
        places = [own for path in self._paths if (own := place(layout, path)) is not None]
        return (layout, places) if len(places) == len(self._paths) else None

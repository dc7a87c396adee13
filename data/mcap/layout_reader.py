"""Binary messages of few layouts: each read by the first that can be proved of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.mcap.field_path import FieldPath
from data.mcap.layout import Layout, Place, Taken, place, take
from data.mcap.records import ByteArray

Recognise = Callable[[bytes], Layout | None]
_MOST_LAYOUTS: Final = 16  # of one channel, before its messages are decoded one by one


class LayoutReader:
    """Reads the numbers at some paths out of blocks of binary messages, by `compiled` code or without."""

    def __init__(self, paths: Sequence[FieldPath], recognise: Recognise, *, compiled: bool) -> None:
        self._paths = paths
        self._recognise = recognise
        self._compiled = compiled
        self._layouts: list[tuple[Layout, list[Place]]] = []

    def read(self, block: ByteArray, begin: NDArray[np.int64], length: NDArray[np.int64]) -> Taken:
        """What can be read of the messages (n,) at `begin`."""
        taken, tried = Taken.nothing(len(self._paths), begin.size), 0
        while taken.left.any() and tried < _MOST_LAYOUTS:
            if tried == len(self._layouts):
                k = int(np.argmax(taken.left))
                known = self._known(block[int(begin[k]) : int(begin[k] + length[k])].tobytes())
                if known is None:
                    break
                self._layouts.append(known)
            layout, places = self._layouts[tried]
            tried += 1
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

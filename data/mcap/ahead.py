"""Chunks unpacked one ahead: the next one already while the messages of the last one are read.

Unpacking and checksums hold no lock of the interpreter, so with a second core they cost no time of their own.
What was unpacked ahead is taken only where the walk comes to that very chunk; otherwise it is let go, so what
is read of a file does not depend on it.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Final, Self

from mcap.opcode import Opcode

from data.mcap.chunks import ChunkHead, extent, unpack
from data.mcap.records import HEADER, ByteArray, look

_MOST_BETWEEN: Final = 64  # records between two chunks, before the next is not sought
_LARGEST: Final = 16 << 20  # [bytes] of a chunk that is kept beside the one that is read


class Unpacking:
    """Unpacks the chunks of a file, one `ahead` if that is worth a thread; used in a `with` statement."""

    def __init__(self, content: ByteArray, *, ahead: bool) -> None:
        self._content = content
        self._unpacked = 0  # [bytes] so far
        self._next: tuple[ChunkHead, Future[ByteArray]] | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="unpacking") if ahead else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is not None:
            self._thread.shutdown(cancel_futures=True)

    def unpack(self, head: ChunkHead) -> ByteArray:
        """The content of a chunk; raises `Damage` as `chunks.unpack`."""
        begun, self._next = self._next, None
        if begun is not None and begun[0] == head:
            block = begun[1].result()
        else:
            block = unpack(self._content, head, unpacked_before=self._unpacked)
        self._unpacked += head.unpacked_size
        self._begin_next(head.end)
        return block

    def _begin_next(self, here: int) -> None:
        following = self._following(here) if self._thread is not None else None
        if self._thread is not None and following is not None and following.unpacked_size <= _LARGEST:
            begun = self._thread.submit(unpack, self._content, following, unpacked_before=self._unpacked)
            self._next = (following, begun)

    def _following(self, here: int) -> ChunkHead | None:
        """The next chunk, if only indexes stand before it."""
        for _ in range(_MOST_BETWEEN):
            why, opcode, length = look(self._content.data, here, self._content.size)
            if why or opcode != Opcode.MESSAGE_INDEX:
                return extent(self._content, here)
            here += HEADER.size + length
        return None

"""Spread over threads of this process: for compiled kernels, which let go of the interpreter."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class ThreadMap:
    """A map over the threads of an open pool."""

    pool: ThreadPoolExecutor

    def __call__(self, function: Callable[[Item], Result], items: Iterable[Item], /) -> Iterator[Result]:
        """Each result as soon as it and all before it are there."""
        return self.pool.map(function, items)


@contextmanager
def opened_threads(jobs: int | None = None) -> Iterator[ThreadMap]:
    """A map over `jobs` threads, by default one for each processor; ended on leaving."""
    pool = ThreadPoolExecutor(jobs or os.cpu_count() or 1)
    try:
        yield ThreadMap(pool)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)

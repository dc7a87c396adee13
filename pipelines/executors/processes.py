"""Spread over processes of this machine: the function and its items travel, so both must be picklable.

Processes are spawned, not forked: compiled kernels and threads do not survive a fork. Results come in the
order of the items; the first exception ends the map, and what has not begun is cancelled.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from pipelines.executors.serial import serial_map

Item = TypeVar("Item")
Result = TypeVar("Result")


class Spread(Protocol):
    """The one verb: apply a function to each item, results in order."""

    def __call__(self, function: Callable[[Item], Result], items: Iterable[Item], /) -> Iterator[Result]:
        """Each result as soon as it and all before it are there."""


@dataclass(frozen=True)
class ProcessMap:
    """A map over the processes of an open pool."""

    pool: ProcessPoolExecutor

    def __call__(self, function: Callable[[Item], Result], items: Iterable[Item], /) -> Iterator[Result]:
        """Each result as soon as it and all before it are there."""
        return self.pool.map(function, items)


@contextmanager
def opened_map(jobs: int) -> Iterator[Spread]:
    """A map over `jobs` processes, ended on leaving; with one job, no process is started."""
    if jobs <= 1:
        yield serial_map
        return
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield ProcessMap(pool)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)

"""Many damaged logs, read one after the other in a process whose memory and time are watched."""

from __future__ import annotations

import resource
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Final

import numpy as np

from benchmarks.fuzzing.memory import peak_memory
from benchmarks.fuzzing.mutations import mutate
from benchmarks.fuzzing.reading import Outcome, intact, read_mutant
from benchmarks.fuzzing.seeds import seeds

HANG: Final = 10.0  # [s]
MEMORY: Final = 512 << 20  # [bytes] resident
_ADDRESSES: Final = 8 << 30  # [bytes] of address space, after which an allocation fails
_EVERY: Final = 16  # mutants, of which one goes through the file door


class HangError(BaseException):
    """Reading took too long; no `except Exception` may hide it."""


@dataclass
class Tally:
    """What came of the mutants of one seed log."""

    mutants: int = 0
    refused: int = 0
    salvaged: int = 0
    strange: int = 0  # mutants with a sample that is none of the intact log's
    failures: list[tuple[int, str]] = field(default_factory=list)  # the mutant's number, and what was wrong

    def add(self, other: Tally) -> None:
        """Count another one in."""
        self.mutants += other.mutants
        self.refused += other.refused
        self.salvaged += other.salvaged
        self.strange += other.strange
        self.failures += other.failures


@dataclass
class Batch:
    """What came of a stretch of mutants."""

    tallies: dict[str, Tally] = field(default_factory=dict)  # by seed log
    slowest: float = 0.0  # [s]
    memory: int = 0  # resident at most [bytes]


def mutant(seed: int, number: int) -> tuple[int, str, bytes]:
    """Mutant `number` of a seed: which log it was, how it was damaged, its bytes."""
    rng = np.random.default_rng((seed, number))
    logs = seeds()
    which = number % len(logs)
    return which, *mutate(logs[which].content, rng)


def run_batch(seed: int, first: int, count: int) -> Batch:
    """Read mutants `first` to `first + count`."""
    batch = Batch()
    logs = seeds()
    for log in logs:
        if log.guard != "table":
            intact(log)
    with TemporaryDirectory() as folder:
        for number in range(first, first + count):
            which, how, content = mutant(seed, number)
            log = logs[which]
            tally = batch.tallies.setdefault(log.name, Tally())
            begun = time.perf_counter()
            try:
                with _watched():
                    found = read_mutant(log, content, Path(folder) if number % _EVERY == 0 else None)
            except HangError:
                found = Outcome(False, False, 0, f"hangs for over {HANG:g} s")
            except Exception as error:  # what may be raised is what is asked
                found = Outcome(False, False, 0, f"raises {type(error).__name__}: {str(error)[:200]}")
            batch.slowest = max(batch.slowest, time.perf_counter() - begun)
            tally.mutants += 1
            tally.refused += found.refused
            tally.salvaged += found.salvaged
            tally.strange += found.strange > 0
            if found.wrong:
                tally.failures.append((number, f"{how}: {found.wrong}"))
    batch.memory = peak_memory()
    return batch


def limit_memory() -> None:
    """Let allocations fail long before the machine's memory is used up; in a process of its own."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))


@contextmanager
def _watched() -> Iterator[None]:
    def stop(_number: int, _frame: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, HANG)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)

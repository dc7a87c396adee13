"""Damaged logs by the thousand: `python -m benchmarks.fuzz --mutants N --seed S [--jobs J] [--json]`.

Small logs are damaged at random and read, with salvage and without, and described. No exception but
`LogError` may come of it, no hang over 10 s, no more than 512 MB, and from logs with checksums no value that
was not in them; then bombs and lies are read, each in a process of its own with its time and memory taken.
Ends with 1 where anything failed. `--show K` writes mutant K to a file instead.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Final

from benchmarks.fuzzing.bombs import BOMBS, MOST_MEMORY, MOST_TIME, read_bomb
from benchmarks.fuzzing.trials import MEMORY, Batch, Tally, limit_memory, mutant, run_batch
from benchmarks.rows import Row, figure, show

_BATCH: Final = 500
_LONGEST_WAIT: Final = 600.0  # [s] for one batch: a hang that no signal ends


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--mutants", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--show", type=int, metavar="K")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--quick", action="store_true", help="2000 mutants")
    asked = parser.parse_args()
    if asked.show is not None:
        which, how, content = mutant(asked.seed, asked.show)
        path = Path(f"mutant-{asked.seed}-{asked.show}")
        path.write_bytes(content)
        print(f"{path}: seed log {which}, {how}, {len(content)} bytes")
        return
    count = 2000 if asked.quick else asked.mutants
    begun = time.perf_counter()
    whole, lost = _gather(asked.seed, count, asked.jobs)
    taken = time.perf_counter() - begun
    rows, failed = _mutant_rows(whole, lost, count=count, taken=taken)
    bombs, burst = _bomb_rows()
    if not asked.json:
        _print_table(whole)
    show([*rows, *bombs], as_json=asked.json)
    sys.exit(1 if failed or burst else 0)


def _gather(seed: int, count: int, jobs: int) -> tuple[Batch, list[str]]:
    """All batches as one, and the batches whose process died or never ended."""
    whole, lost = Batch(), []
    with ProcessPoolExecutor(jobs, initializer=limit_memory) as pool:
        starts = range(0, count, _BATCH)
        waiting = [
            (first, pool.submit(run_batch, seed, first, min(_BATCH, count - first))) for first in starts
        ]
        for first, future in waiting:
            try:
                batch = future.result(timeout=_LONGEST_WAIT)
            except (BrokenProcessPool, TimeoutError) as error:
                lost.append(f"mutants {first} to {first + _BATCH}: {type(error).__name__}")
                continue
            for name, tally in batch.tallies.items():
                whole.tallies.setdefault(name, Tally()).add(tally)
            whole.slowest = max(whole.slowest, batch.slowest)
            whole.memory = max(whole.memory, batch.memory)
            if sys.stderr.isatty():
                print(f"\r{min(first + _BATCH, count)} of {count}", end="", file=sys.stderr)
    return whole, lost


def _mutant_rows(whole: Batch, lost: list[str], *, count: int, taken: float) -> tuple[list[Row], bool]:
    failures = [text for _, text in _failures(whole)]
    rows = [
        figure("mutants", count, None, "logs"),
        figure("mutants: rate", count / taken, None, "logs/s"),
        figure("mutants: exceptions but LogError", _count(failures, "raises"), 0, "logs"),
        figure("mutants: hangs over 10 s", _count(failures, "hangs"), 0, "logs"),
        figure("mutants: samples invented, or lost in silence", _count(failures, "samples"), 0, "logs"),
        figure("mutants: integrity told in two ways", _count(failures, "disagree"), 0, "logs"),
        figure("mutants: processes that died", len(lost), 0, "batches"),
        figure("mutants: slowest", whole.slowest, 10.0, "s"),
        figure("mutants: memory", whole.memory / 2**20, MEMORY / 2**20, "MB"),
    ]
    for number, text in _failures(whole):
        print(f"mutant {number}: {text}", file=sys.stderr)
    for text in lost:
        print(text, file=sys.stderr)
    return rows, bool(failures or lost or whole.memory > MEMORY)


def _count(failures: list[str], word: str) -> int:
    return sum(f": {word}" in text or word in text.rpartition(": ")[2] for text in failures)


def _failures(whole: Batch) -> Iterator[tuple[int, str]]:
    for name, tally in whole.tallies.items():
        for number, text in tally.failures:
            yield number, f"{name}: {text}"


def _bomb_rows() -> tuple[list[Row], bool]:
    rows, failed = [], False
    for name in BOMBS:
        result = read_bomb(name)
        failed |= bool(result.wrong)
        rows.append(figure(f"bomb: {name}", result.seconds, MOST_TIME, "s"))
        rows.append(figure(f"bomb: {name}, memory", result.memory / 2**20, MOST_MEMORY / 2**20, "MB"))
        if result.wrong:
            print(f"bomb {name}: {result.wrong}", file=sys.stderr)
    return rows, failed


def _print_table(whole: Batch) -> None:
    print(f"{'seed log':36s} {'mutants':>8s} {'refused':>8s} {'salvaged':>8s} {'altered':>8s} {'failed':>8s}")
    for name, tally in whole.tallies.items():
        counts = (tally.mutants, tally.refused, tally.salvaged, tally.strange, len(tally.failures))
        print(f"{name:36s} " + " ".join(f"{count:8d}" for count in counts))


if __name__ == "__main__":
    main()

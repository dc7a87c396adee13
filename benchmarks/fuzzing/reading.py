"""Reading one damaged log in every way, and what must be true of it.

Nothing but `LogError` may be raised. Where each chunk has a checksum, every sample that is read, with or
without salvage, is one of the intact log, and a log that passes for whole holds all of them. Where one
checksum covers the whole, a log that passes for whole does. Without checksums a changed number leaves no
trace; how often that happened is counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.fuzzing.seeds import TOPIC, Seed
from data.csv.description import describe as describe_csv
from data.csv.dialect import sniff
from data.csv.log import read_csv, table_integrity
from data.findings import LogError
from data.ingest import read_recording
from data.integrity import Integrity
from data.mcap.columns import Topic, read_columns
from data.mcap.description import describe as describe_mcap
from data.mcap.field_path import parse_path
from data.signals import RigSignals, Signal, Signals

Sample = tuple[int, int, bytes]  # log time, header stamp [ns], the values' bytes
FIELDS: Final = (f"{TOPIC}:position[0]", f"{TOPIC}:effort[0]")
_WANTED: Final = tuple(parse_path(text) for text in FIELDS)
_SIGNALS: Final = RigSignals(
    mcap=Signals(position=Signal(FIELDS[0]), torque=Signal(FIELDS[1])),
    csv=Signals(time=Signal(0, unit="s"), position=Signal(1), torque=Signal(2)),
)


@dataclass(frozen=True)
class Outcome:
    """What came of reading one damaged log."""

    refused: bool  # not read without salvage
    salvaged: bool  # but with it
    strange: int  # samples that are none of the intact log
    wrong: str  # what must not be; empty for nothing


@cache
def intact(seed: Seed) -> frozenset[Sample]:
    """The samples of a log before it was damaged."""
    return frozenset(_samples(read_columns(np.frombuffer(seed.content, np.uint8), _WANTED).topics[TOPIC]))


def read_mutant(seed: Seed, content: bytes, folder: Path | None) -> Outcome:
    """Read a damaged log as columns and describe it; where there is a folder, through the file door too."""
    if folder is not None:
        _through_the_door(content, folder / ("run.csv" if seed.guard == "table" else "run.mcap"))
    if seed.guard == "table":
        return _read_table(content)
    data = np.frombuffer(content, np.uint8)
    described = describe_mcap(data).integrity
    try:
        read = read_columns(data, _WANTED)
    except LogError:
        return Outcome(True, False, 0, "")
    if read.integrity != described:
        return Outcome(False, False, 0, "the description and the reader disagree on what is lost")
    samples = _samples(read.topics[TOPIC])
    strange = sum(sample not in intact(seed) for sample in samples)
    whole, salvaged = _allowed(read.integrity, salvage=False), _allowed(read.integrity, salvage=True)
    wrong = ""
    if strange and (seed.guard == "chunk" or (seed.guard == "file" and whole)):
        wrong = f"{strange} samples are none of the intact log's"
    elif whole and seed.guard in ("chunk", "file") and set(samples) != intact(seed):
        wrong = f"passes for whole with {len(set(samples))} of {len(intact(seed))} samples"
    return Outcome(not whole, salvaged and not whole, strange, wrong)


def _samples(topic: Topic) -> list[Sample]:
    header = topic.log_time if topic.header_time is None else topic.header_time
    values = np.stack([topic.values[text] for text in FIELDS], axis=1)
    times = zip(topic.log_time.tolist(), header.tolist(), strict=True)
    return [(*both, row.tobytes()) for both, row in zip(times, values, strict=True)]


def _allowed(integrity: Integrity, *, salvage: bool) -> bool:
    try:
        integrity.require("run.mcap", salvage=salvage)
    except LogError:
        return False
    return True


def _read_table(content: bytes) -> Outcome:
    refused = salvaged = False
    try:
        describe_csv(content)
    except LogError:
        refused = True
    try:
        layout = sniff(content)
        table = read_csv(content, layout, range(min(3, len(layout.units))))
        integrity = table_integrity(table)
        refused = not _allowed(integrity, salvage=False)
        salvaged = refused and _allowed(integrity, salvage=True)
    except LogError:
        refused = True
    return Outcome(refused, salvaged, 0, "")


def _through_the_door(content: bytes, path: Path) -> None:
    path.write_bytes(content)
    for salvage in (False, True):
        try:
            read_recording(path, log=path.name, protocol="excitation", signals=_SIGNALS, salvage=salvage)
        except LogError:
            continue

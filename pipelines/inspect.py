"""What a log holds, with no settings at all: channels, units, rate, clock, gaps, integrity, what is lost.

The answer is a value: `to_plain` gives it to a program (schema `stribeck/inspection/1`); the terminal
draws it for a person. Its status says whether the log is whole, readable in part, or not at all.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from data.files import ByteArray, read_bytes
from data.findings import LogError
from data.integrity import Integrity
from data.mcap import description as mcap_description
from data.mcap.description import McapDescription
from data.signals import Format, log_format
from data.tables import description as table_description
from data.tables.description import TableDescription
from pipelines.exit_status import Status

if TYPE_CHECKING:
    from data.csv.description import CsvDescription

SCHEMA: Final = "stribeck/inspection/1"
Description: TypeAlias = "McapDescription | TableDescription | CsvDescription"


@dataclass(frozen=True)
class Inspection:
    """One log, described."""

    log: str
    file_format: Format
    size: int  # [bytes]
    seconds: float  # that the inspection took
    content: Description

    @property
    def integrity(self) -> Integrity:
        """What is proved of the file."""
        return self.content.integrity

    @property
    def status(self) -> Status:
        """Whole: DONE. Readable in part: WITHHELD. Not at all: REFUSED."""
        if self.integrity.whole:
            return Status.DONE
        return Status.WITHHELD if self.integrity.messages else Status.REFUSED

    @property
    def simulated(self) -> bool:
        """Whether a virtual rig wrote it."""
        return self.content.metadata.get("simulated", "").strip().lower() == "true"


def inspect_log(path: Path) -> Inspection:
    """Describe a log.

    Raises
    ------
    LogError
        When it cannot be read at all.
    """
    begin = time.perf_counter()
    log = path.as_posix()
    content = read_bytes(path, log=log)  # a file that is not there has no ending to speak of
    file_format = log_format(path)
    try:
        found = _described(path, file_format, content)
    except LogError as error:
        raise LogError(f"{log}: {error}") from error
    inspection = Inspection(log, file_format, content.size, time.perf_counter() - begin, found)
    if inspection.status is Status.REFUSED:
        inspection.integrity.require(log, salvage=True)
    return inspection


def _described(path: Path, file_format: Format, content: ByteArray) -> Description:
    """Describe a log; what only one format needs is loaded for it: a person waits for the answer."""
    if file_format == "mcap":
        return mcap_description.describe(content)
    if file_format == "csv":
        from data.csv import description as csv_description  # noqa: PLC0415

        return csv_description.describe(content)
    if file_format == "bag":
        from data.bag import description as bag_description  # noqa: PLC0415

        return bag_description.describe(path)
    if file_format == "parquet":
        from data.parquet.log import ParquetLog  # noqa: PLC0415

        return table_description.describe(ParquetLog(content))
    from data.mat.log import MatLog  # noqa: PLC0415

    return table_description.describe(MatLog(content))


def to_plain(inspection: Inspection) -> dict[str, Any]:
    """The inspection as plain values, ready for JSON. Times are seconds, sizes bytes."""
    content = inspection.content
    shared: dict[str, Any] = {
        "schema": SCHEMA,
        "log": inspection.log,
        "format": inspection.file_format,
        "bytes": inspection.size,
        "status": {Status.DONE: "whole", Status.WITHHELD: "partly readable"}.get(
            inspection.status, "unreadable"
        ),
        "simulated": inspection.simulated,
        "integrity": _integrity(inspection.integrity),
        "metadata": dict(content.metadata),
    }
    if isinstance(content, McapDescription):
        own = _mcap(content)
    else:
        own = _columns(content) | ({} if isinstance(content, TableDescription) else _dialect(content))
    return {key: _finite(value) for key, value in (shared | own).items()}


def frozen_dialect(content: CsvDescription) -> str:
    """The dialect found, as a line for [signals] or [[experiment]] in campaign.toml."""
    pairs = asdict(content.layout.frozen).items()
    return "dialect = { " + ", ".join(f"{key} = {_toml(value)}" for key, value in pairs) + " }"


def _toml(value: str | bool | int) -> str:
    """A value as TOML writes it; its strings escape as JSON's do."""
    return json.dumps(value).replace("\x7f", "\\u007f")


def _mcap(content: McapDescription) -> dict[str, Any]:
    return {
        "profile": content.profile,
        "library": content.library,
        "chunks": dict(content.compressions),
        "indexed": content.indexed,
        "channels": [_with_rates(asdict(channel)) for channel in content.channels],
        "channels_not_listed": content.unlisted,
        "empty_topics": list(content.empty_topics),
        "attachments": [asdict(label) for label in content.attachments],
    }


def _dialect(content: CsvDescription) -> dict[str, Any]:
    layout = content.layout
    return {
        "dialect": {
            "delimiter": layout.delimiter,
            "decimal": layout.decimal,
            "encoding": layout.encoding,
            "header": bool(layout.headers),
            "units_row": layout.units_row,
            "comment": layout.comment,
            "quote": layout.quote,
            "lines_before_numbers": layout.first_row,
        },
        "frozen": frozen_dialect(content),
    }


def _columns(content: CsvDescription | TableDescription) -> dict[str, Any]:
    return {
        "rows": content.rows,
        "columns": [asdict(column) for column in content.columns],
        "clock": _rated(asdict(content.clock)) if content.clock else None,
        "clock_column": content.clock_column,
    }


def _integrity(found: Integrity) -> dict[str, Any]:
    return {
        "checksums": found.checksums,
        "whole": found.whole,
        "chunks": found.chunks,
        "messages": found.messages,
        "promised": found.promised,
        "unproved": found.unproved,
        "kept": [[begin * 1e-9, end * 1e-9] for begin, end in found.kept],
        "lost": [
            {
                "begin": loss.begin,
                "end": loss.end,
                "why": loss.why,
                "log_time": None if loss.time_range is None else [t * 1e-9 for t in loss.time_range],
                "before": None if loss.before is None else loss.before * 1e-9,
                "behind": None if loss.behind is None else loss.behind * 1e-9,
            }
            for loss in found.losses
        ],
        "notes": list(found.notes),
    }


def _with_rates(channel: dict[str, Any]) -> dict[str, Any]:
    clocks = {name: _rated(channel[name]) for name in ("log_clock", "header_clock") if channel[name]}
    return channel | {"header_clock": None} | clocks


def _rated(clock: dict[str, Any]) -> dict[str, Any]:
    return clock | {"rate": 1.0 / clock["period"] if clock["period"] > 0.0 else None}


def _finite(value: Any) -> Any:
    """The same value with null where a number is not finite, which JSON cannot say."""
    if isinstance(value, dict):
        return {key: _finite(inside) for key, inside in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inside) for inside in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

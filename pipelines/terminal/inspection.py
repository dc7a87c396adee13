"""An inspection drawn for a person: one screen that tells everything about a log.

Names come from the log: each goes through `shown` (no control characters, bounded) and enters rich as plain
`Text`, never as markup.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from data.clocks import ClockReport
from data.findings import LogError
from data.integrity import Integrity
from data.mcap.description import ChannelDescription, Field, McapDescription
from data.names import shown
from data.signals import Format
from data.tables.description import DescribedColumn, TableDescription
from pipelines.exit_status import Status
from pipelines.inspect import SCHEMA, Description, Inspection, frozen_dialect, inspect_log, to_plain

if TYPE_CHECKING:
    from data.csv.description import Column, CsvDescription

MANY: Final = "stribeck/inspections/1"  # the schema of several inspections at once
_EPOCH: Final = 1e8  # [s]; a start above this is a date
_LATEST: Final = 4e9
_MOST_ROWS: Final = 40
_MOST_LOSSES: Final = 8
_KINDS: Final[dict[Format, str]] = {
    "mcap": "MCAP",
    "bag": "ROS bag",
    "csv": "CSV",
    "parquet": "Parquet",
    "mat": "MATLAB",
}


def inspect_logs(logs: Sequence[Path], *, as_json: bool = False, quiet: bool = False) -> Status:
    """Inspect logs and print each, or only errors where `quiet`; the gravest status of all."""
    worst, answers = Status.DONE, []
    for path in logs:
        try:
            inspection = inspect_log(path)
        except LogError as error:
            worst = Status.REFUSED
            answers.append(
                {"schema": SCHEMA, "log": path.as_posix(), "status": "unreadable", "error": str(error)}
            )
            print(f"stribeck: {error}", file=sys.stderr)
            continue
        if worst is Status.DONE:
            worst = inspection.status
        if as_json:
            answers.append(to_plain(inspection))
        elif not quiet:
            print_inspection(inspection)
    if as_json:
        whole = answers[0] if len(answers) == 1 else {"schema": MANY, "logs": answers}
        print(json.dumps(whole, indent=1, allow_nan=False))
    return worst


def print_inspection(inspection: Inspection, console: Console | None = None) -> None:
    """Print one inspection to the terminal."""
    console = console or Console(highlight=False)
    content = inspection.content
    parts: list[RenderableType] = [_facts(inspection)]
    if isinstance(content, McapDescription):
        topics = [channel.topic for channel in content.channels]
        parts += [
            _channel(channel, alone=topics.count(channel.topic) == 1)
            for channel in content.channels[:_MOST_ROWS]
        ]
        parts += _more(content)
    else:
        parts.append(_columns(content))
    if content.metadata:
        parts.append(_metadata(content))
    title = Text(shown(inspection.log), style="bold")
    if inspection.simulated:
        title.append("  SIMULATED", style="bold magenta")
    console.print(Panel(Group(*parts), title=title, title_align="left", border_style="dim"))
    if not isinstance(content, McapDescription | TableDescription):  # outside the frame, to be copied
        console.print(Text("to freeze how it is read, under [signals] in campaign.toml:", style="dim"))
        console.print(Text(frozen_dialect(content)), soft_wrap=True)


def _facts(inspection: Inspection) -> Table:
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim", no_wrap=True)
    facts.add_column()
    content = inspection.content
    if isinstance(content, McapDescription):
        parts = [
            _KINDS[inspection.file_format],
            _size(inspection.size),
            f"profile {shown(content.profile, 30) or 'none'}",
            *_container(inspection.file_format, content),
            f"by {shown(content.library, 40)}" if content.library else "",
        ]
        facts.add_row("file", Text(" · ".join(part for part in parts if part)))
    else:
        kind = _KINDS[inspection.file_format]
        facts.add_row("file", Text(f"{kind} · {_size(inspection.size)} · {content.rows} rows"))
        if not isinstance(content, TableDescription):
            facts.add_row("dialect", Text(shown(content.layout.described)))
        if content.clock is not None:
            facts.add_row("clock", _clock(content.clock, f"column {shown(content.clock_column or '', 40)}"))
    facts.add_row("integrity", _integrity(inspection.integrity))
    return facts


def _container(file_format: Format, content: McapDescription) -> tuple[str, ...]:
    """How an MCAP file is built."""
    if file_format != "mcap":
        return ()
    chunks = ", ".join(f"{count} {shown(name, 20)} chunks" for name, count in content.compressions.items())
    return chunks or "no chunks", "indexed" if content.indexed else "no index"


def _integrity(found: Integrity) -> Text:
    checksums = {
        "verified": ("checksums verified", "green"),
        "absent": ("no checksums: nothing contradicts itself, nothing is proved", "yellow"),
        "failed": ("damaged", "bold red"),
    }[found.checksums if found.whole else "failed"]
    text = Text(*checksums)
    if not found.whole:
        text.append(f"; `--salvage` keeps {found.left}", style="yellow")
    for loss in found.losses[:_MOST_LOSSES]:
        text.append(f"\nlost {loss.text}", style="red")
    if len(found.losses) > _MOST_LOSSES:
        text.append(f"\nand {len(found.losses) - _MOST_LOSSES} more places", style="red")
    for note in found.notes:
        text.append(f"\n{note}", style="dim")
    return text


def _channel(channel: ChannelDescription, *, alone: bool) -> Group:
    """A channel; where it is not `alone` on its topic, by the name that tells it from the others."""
    topic = channel.topic if alone else f"{channel.topic}#{channel.number}"
    head = Text("\n")
    head.append(shown(topic), style="bold cyan")
    kind = shown(channel.schema, 60) or "no schema"
    head.append(
        f"  {kind} · {shown(channel.encoding, 20)} · {channel.log_clock.samples} messages", style="dim"
    )
    rows: list[RenderableType] = [head]
    if channel.header_clock is not None:
        rows.append(_clock(channel.header_clock, "header stamps"))
    rows.append(_clock(channel.log_clock, "log times"))
    if channel.refused:
        rows.append(Text(shown(channel.refused, 300), style="yellow"))
    else:
        rows.append(_field_table(channel, topic))
    return Group(*rows)


def _field_table(channel: ChannelDescription, topic: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("field path", no_wrap=True, overflow="ellipsis")
    table.add_column("first value", justify="right")
    table.add_column("elements")
    telling = [item for item in channel.fields if not _said_elsewhere(item, channel)]
    for item in telling[:_MOST_ROWS]:
        value = "" if item.value is None else _value(item)
        table.add_row(Text(f"{shown(topic, 60)}:{shown(item.path, 60)}"), Text(value), Text(_elements(item)))
    return table


def _said_elsewhere(item: Field, channel: ChannelDescription) -> bool:
    """The header's stamp is the clock's line, the joints stand beside their arrays."""
    named = any(other.joints for other in channel.fields)
    return (item.path.startswith("header.") and channel.header_clock is not None) or (
        item.path == "name" and named
    )


def _value(item: Field) -> str:
    return shown(item.value, 24) if isinstance(item.value, str) else f"{item.value:.6g}"


def _elements(item: Field) -> str:
    if item.length is None:
        return ""
    if item.joints:
        return ", ".join(f"[{k}] {{{shown(name, 24)}}}" for k, name in enumerate(item.joints[:8]))
    return f"{item.length}" if item.length else "empty"


def _clock(clock: ClockReport, name: str) -> Text:
    text = Text(f"{name}: ")
    if clock.samples < 2:
        return text.append("one sample")
    text.append(f"{clock.rate:.6g} Hz for {clock.duration:.6g} s", style="bold")
    text.append(f" from {_moment(clock.start)}, {_jitter(clock.jitter)}")
    if clock.stalls:
        text.append(
            f"; stands still or jumps back {clock.stalls} times, first {clock.first_stall:.6g} s in",
            style="red",
        )
    if clock.gaps:
        at, length = clock.longest_gaps[0]
        text.append(f"; {clock.gaps} gaps, the longest {_span(length)} at {at:.6g} s", style="yellow")
    return text


def _jitter(width: float) -> str:
    return f"jitter {_span(width)}" if width >= 1e-9 else "no jitter"


def _moment(start: float) -> str:
    if _EPOCH < start < _LATEST:
        return datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return f"{start:.6g} s"


def _span(seconds: float) -> str:
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= size:
            return f"{seconds / size:.4g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _size(count: int) -> str:
    for size, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count} bytes"


def _columns(content: CsvDescription | TableDescription) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading, justify in (
        ("no.", "right"),
        ("column", "left"),
        ("unit", "left"),
        ("from", "right"),
        ("to", "right"),
    ):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]  # rich wants a literal
    table.add_column("")
    for column in content.columns[:_MOST_ROWS]:
        table.add_row(
            str(column.number),
            Text(shown(column.header, 60), style="bold cyan"),
            Text(shown(column.unit or "", 20)),
            "" if column.low is None else f"{column.low:.6g}",
            "" if column.high is None else f"{column.high:.6g}",
            Text(_remark(column, content.rows), style="yellow"),
        )
    return table


def _remark(column: Column | DescribedColumn, rows: int) -> str:
    if column.text is not None:
        return "no numbers: " + shown(column.text, 200)
    own = column.rows if isinstance(column, DescribedColumn) else rows
    parts = [
        f"{own} values" if own != rows else "",
        f"{column.missing} cells are empty or not finite" if column.missing else "",
    ]
    return "; ".join(part for part in parts if part)


def _more(content: McapDescription) -> list[RenderableType]:
    rows: list[RenderableType] = []
    hidden = max(len(content.channels) - _MOST_ROWS, 0) + content.unlisted
    if hidden:
        rows.append(Text(f"and {hidden} more channels", style="dim"))
    if content.empty_topics:
        names = ", ".join(shown(topic, 40) for topic in content.empty_topics[:8])
        rows.append(Text(f"declared without a message: {names}", style="dim"))
    rows += [
        Text(
            f"attachment {shown(label.name, 60)} ({shown(label.media_type, 30)}, {_size(label.size)})",
            style="dim",
        )
        for label in content.attachments[:8]
    ]
    return rows


def _metadata(content: Description) -> Table:
    table = Table.grid(padding=(0, 2))
    table.add_row(Text("\nmetadata", style="dim"))
    plain = {key: value for key, value in content.metadata.items() if "/" not in key} or content.metadata
    for key, value in list(plain.items())[:_MOST_ROWS]:
        table.add_row(Text(shown(key, 40), style="cyan"), Text(shown(value, 80)))
    return table

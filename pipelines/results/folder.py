"""Result folders: what a command leaves behind, as text, file by file, each whole or not there at all.

A folder belongs to a campaign (or to a robot that came from one, or to the word `paper`). The manifest in it
says to which. A command run again on the same campaign brings its own files up to date and leaves the
others; a folder that belongs to something else, or to nobody, is in the way, and stays untouched unless the
user says `--force`. Even then nothing is deleted: files of the same name are replaced, no more.

Every JSON file begins with a `schema` tag, holds no NaN (an unknown number is `null`, with the reason beside
it) and writes floats so that they read back bit for bit.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Final

import numpy as np

from data.files import write_atomically
from data.names import shown
from pipelines.exit_status import UsageError

MANIFEST: Final = "manifest.json"
PARTIAL: Final = re.compile(r"\..+\.[0-9a-f]{8}\.partial")  # as `data.files.write_atomically` names them
STALE: Final = 60.0  # [s] after which nobody is still writing it
MANIFEST_SCHEMA: Final = "stribeck/manifest/1"


@dataclass(frozen=True)
class Owner:
    """Whose results a folder holds. The same owner brings a folder up to date; no other touches it."""

    campaign: str  # the campaign's name, or the robot file's where no campaign is known
    rig: str = ""


@dataclass(frozen=True)
class ResultFolder:
    """A folder that a command may write into; made at the first write, so that a refusal leaves nothing.

    `written` collects the SHA-256 of each file of this command, for its manifest.
    """

    path: Path
    owner: Owner
    written: dict[str, str] = field(default_factory=dict)

    def write_text(self, name: str, text: str) -> Path:
        """Write one result file, whole or not at all."""
        return self.write_bytes(name, text.encode("utf-8"))

    def write_bytes(self, name: str, content: bytes) -> Path:
        """Write one result file, whole or not at all."""
        target = self.path / name
        if not (self.path / MANIFEST).exists():
            self.claim()
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(target, content)
        self.written[name] = hashlib.sha256(content).hexdigest()
        return target

    def write_by(self, name: str, write: Callable[[Path], object]) -> Path:
        """Have a result file written by `write`, which writes its path whole or not at all."""
        target = self.path / name
        if not (self.path / MANIFEST).exists():
            self.claim()
        target.parent.mkdir(parents=True, exist_ok=True)
        write(target)
        with target.open("rb") as stream:
            self.written[name] = hashlib.file_digest(stream, "sha256").hexdigest()
        return target

    def write_json(self, name: str, schema: str, values: Mapping[str, object]) -> Path:
        """Write a JSON file with its schema tag first; raises ValueError for a number that is not finite."""
        return self.write_text(name, json_text(schema, values))

    def write_csv(self, name: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
        """Write a comma-separated table: a header, then rows; an absent value is an empty cell."""
        return self.write_text(name, csv_text(header, rows))

    def claim(self) -> None:
        """Say whose folder this is before anything lies in it: an interrupted command can be rerun."""
        self.path.mkdir(parents=True, exist_ok=True)
        for entry in self.path.iterdir():
            if _is_leftover(entry) and time.time() - entry.stat().st_mtime > STALE:
                entry.unlink(missing_ok=True)
        claim = json_text(MANIFEST_SCHEMA, {"campaign": self.owner.campaign, "rig": self.owner.rig})
        write_atomically(self.path / MANIFEST, claim.encode("utf-8"))


def open_results(out: Path, owner: Owner, *, force: bool = False) -> ResultFolder:
    """The folder to write into; raises `UsageError` where something else is in the way. Writes nothing."""
    folder = ResultFolder(path=out, owner=owner)
    for parent in (out, *out.parents):
        if parent.is_symlink() and not parent.exists():
            raise UsageError(f"{parent} is a link to nothing: name another folder with -o")
        if parent.exists():
            if not parent.is_dir():
                raise UsageError(f"{parent} is a file, not a folder: name another folder with -o")
            break
    if force or not out.exists() or all(map(_is_leftover, out.iterdir())):
        return folder
    holder = folder_owner(out)
    if holder == owner:
        return folder
    if holder is None:
        found = sorted(entry.name for entry in out.iterdir() if not _is_leftover(entry))
        shown = ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
        what = f"holds {shown}, which no command of ours wrote"
    else:
        what = f"holds the results of {holder.campaign!r}" + (f" on {holder.rig!r}" if holder.rig else "")
    raise UsageError(
        f"{out} {what}; these would be those of {owner.campaign!r}"
        + (f" on {owner.rig!r}" if owner.rig else "")
        + ". Name another folder with -o, or say --force to write into this one (nothing is "
        "deleted, files of the same name are replaced)."
    )


def _is_leftover(entry: Path) -> bool:
    """Whether a command of ours that was killed while it wrote left this: `.NAME.8 hex digits.partial`."""
    return PARTIAL.fullmatch(entry.name) is not None and entry.is_file() and not entry.is_symlink()


def folder_owner(out: Path) -> Owner | None:
    """Whose results a folder holds, by its manifest; None where it has none that can be read."""
    try:
        manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(manifest, dict) or manifest.get("schema") != MANIFEST_SCHEMA:
        return None
    campaign, rig = manifest.get("campaign"), manifest.get("rig")
    return Owner(campaign, rig) if isinstance(campaign, str) and isinstance(rig, str) else None


def json_text(schema: str, values: Mapping[str, object]) -> str:
    """JSON with the schema tag first, keys in the order given; raises ValueError for NaN or infinity."""
    return (
        json.dumps({"schema": schema, **_plain_items(values)}, indent=2, allow_nan=False, ensure_ascii=False)
        + "\n"
    )


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A comma-separated table; floats read back bit for bit, None is an empty cell.

    A text that a spreadsheet would take for a formula gets an apostrophe in front; numbers never do. Line
    ends and what could steer a terminal are shown as what they are: names come from logs.
    """
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow([_cell(value) for value in row])
    return sheet.getvalue()


def _cell(value: object) -> object:
    value = plain(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = shown(value, 4 * len(value))
        return "'" + text if value.startswith(("=", "+", "-", "@", "\t", "\r")) else text
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ""
    return "" if value is None else value


def plain(value: object) -> object:
    """Dataclasses, tuples, mappings and numpy values as what JSON knows."""
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return _plain_items(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def _plain_items(values: Mapping[str, object]) -> dict[str, object]:
    return {str(key): plain(value) for key, value in values.items()}

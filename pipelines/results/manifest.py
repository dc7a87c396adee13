"""manifest.json: where the files of a result folder come from.

Schema `stribeck/manifest/1`: `campaign` and `rig` say whose folder it is; `simulated` whether the logs came
from a virtual rig; `versions` of this program and of what it computes with; `commands`, an entry for each
that wrote here, with its options, seed and exit status; `inputs` (campaign.toml, logs, robot.json) and
`outputs` (with the command that wrote them), each with its SHA-256. Inputs are named as the campaign names
them, and nothing depends on the machine, its folders or the time: the same inputs give the same manifest.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Final

from pipelines.results.folder import MANIFEST, MANIFEST_SCHEMA, ResultFolder

COMPUTING: Final = (
    "stribeck",
    "numpy",
    "scipy",
    "pandas",
    "numba",
    "lmfit",
    "mcap",
    "filterpy",
    "matplotlib",
)


@dataclass(frozen=True)
class Command:
    """One command, as its folder's manifest remembers it."""

    name: str
    options: Mapping[str, object]  # no paths
    seed: int | None
    status: int
    inputs: Mapping[str, str] = field(default_factory=dict)  # name: SHA-256
    simulated: bool = False


def write_manifest(folder: ResultFolder, command: Command) -> None:
    """Bring the folder's manifest up to date with what `command` has read and written."""
    before = _before(folder)
    outputs = {
        name: {"file": name, "sha256": digest, "command": command.name}
        for name, digest in folder.written.items()
        if name != MANIFEST
    }
    inputs = {name: {"file": name, "sha256": digest} for name, digest in command.inputs.items()}
    entry = {
        "command": command.name,
        "options": dict(command.options),
        "seed": command.seed,
        "status": command.status,
    }
    folder.write_json(
        MANIFEST,
        MANIFEST_SCHEMA,
        {
            "campaign": folder.owner.campaign,
            "rig": folder.owner.rig,
            "simulated": command.simulated,
            "versions": versions(),
            "commands": _merged(before, "commands", "command", {command.name: entry}),
            "inputs": _merged(before, "inputs", "file", inputs),
            "outputs": _merged(before, "outputs", "file", outputs),
        },
    )


def versions() -> dict[str, str]:
    """What computed the results: this program, Python, and the libraries that numbers go through."""
    found = {"python": platform.python_version()}
    for name in COMPUTING:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


def _before(folder: ResultFolder) -> Mapping[str, object]:
    try:
        manifest = json.loads((folder.path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    same = isinstance(manifest, dict) and manifest.get("campaign") == folder.owner.campaign
    return manifest if same else {}


def _merged(
    before: Mapping[str, object], part: str, key: str, now: Mapping[str, Mapping[str, object]]
) -> list[Mapping[str, object]]:
    """The entries of the manifest that were there, brought up to date, in order of their key."""
    listed = before.get(part)
    entries: dict[str, Mapping[str, object]] = {
        str(entry[key]): entry
        for entry in (listed if isinstance(listed, list) else ())
        if isinstance(entry, dict) and key in entry
    }
    entries.update(now)
    return [entries[name] for name in sorted(entries)]

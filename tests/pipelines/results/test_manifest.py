"""manifest.json: what was read and written, by hash, the same for the same inputs, and no machine in it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from pipelines.results.folder import MANIFEST, Owner, ResultFolder, open_results
from pipelines.results.manifest import Command, versions, write_manifest

BENCH = Owner("bench", "rig 3")
INPUTS = {"velocity/p0.10.csv": "ab", "bench.toml": "cd"}


def manifest_of(folder: ResultFolder) -> dict[str, object]:
    return dict(json.loads((folder.path / MANIFEST).read_text(encoding="utf-8")))


def test_it_names_inputs_outputs_and_how_they_came(tmp_path: Path) -> None:
    folder = open_results(tmp_path / "out", BENCH)
    folder.write_text("robot.json", "{}")
    write_manifest(folder, Command("identify", {"free_beta": True}, 7, 3, INPUTS, simulated=True))
    assert manifest_of(folder) == {
        "schema": "stribeck/manifest/1",
        "campaign": "bench",
        "rig": "rig 3",
        "simulated": True,
        "versions": versions(),
        "commands": [{"command": "identify", "options": {"free_beta": True}, "seed": 7, "status": 3}],
        "inputs": [
            {"file": "bench.toml", "sha256": "cd"},
            {"file": "velocity/p0.10.csv", "sha256": "ab"},
        ],
        "outputs": [
            {"file": "robot.json", "sha256": hashlib.sha256(b"{}").hexdigest(), "command": "identify"}
        ],
    }


def test_a_later_command_adds_to_it_and_replaces_its_own(tmp_path: Path) -> None:
    for number, names in enumerate((["a.txt", "b.txt"], ["b.txt"], ["b.txt"])):
        folder = open_results(tmp_path / "out", BENCH)
        for name in names:
            folder.write_text(name, f"{number}")
        write_manifest(folder, Command("first" if number == 0 else "second", {}, None, 0))
    found = manifest_of(folder)
    assert [entry["command"] for entry in found["commands"]] == ["first", "second"]  # type: ignore[attr-defined]  # json
    assert [(o["file"], o["command"]) for o in found["outputs"]] == [  # type: ignore[attr-defined]  # json
        ("a.txt", "first"),
        ("b.txt", "second"),
    ]


def test_the_same_inputs_give_the_same_manifest_anywhere(tmp_path: Path) -> None:
    texts = set()
    for place in ("here", "there/deeper"):
        folder = open_results(tmp_path / place, BENCH)
        folder.write_text("x.txt", "x")
        write_manifest(folder, Command("run", {}, 0, 0, INPUTS))
        texts.add((folder.path / MANIFEST).read_text(encoding="utf-8"))
    assert len(texts) == 1
    assert str(tmp_path) not in texts.pop()


def test_versions_name_what_computes() -> None:
    assert {"python", "stribeck", "numpy", "scipy", "numba", "lmfit"} <= set(versions())

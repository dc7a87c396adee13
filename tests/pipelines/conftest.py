"""A small campaign, recorded once a session on the virtual rig, and the results of `run` on it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.settings.campaign import load_campaign
from pipelines.virtual.demo_campaign import demo_campaign_text
from pipelines.virtual_rig import record

SMALLER = {
    "[0.8, 0.95, 0.98, 0.99, 1.0, 1.02, 1.1, 1.3]": "[0.9, 0.98, 1.05, 1.2]",
    "[0.6, -0.1]": "[0.6]",
    "duration      = 30.0": "duration      = 15.0",
}


@dataclass(frozen=True)
class Finished:
    """What a command left behind."""

    out: Path
    status: int
    printed: str

    def document(self, name: str) -> dict[str, Any]:
        return dict(json.loads((self.out / name).read_text(encoding="utf-8")))


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded campaign.toml; nothing may write beside it."""
    text = demo_campaign_text(quick=True)
    for usual, smaller in SMALLER.items():
        assert usual in text
        text = text.replace(usual, smaller)
    path = tmp_path_factory.mktemp("rig") / "small.toml"
    path.write_text(text, encoding="utf-8")
    record(load_campaign(path, logs_exist=False), path.parent)
    return path


@pytest.fixture(scope="session")
def finished(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """`run` on it; nothing may write into the folder."""
    out = tmp_path_factory.mktemp("out") / "results"
    result = CliRunner().invoke(app, ["run", str(recorded), "-o", str(out)])
    assert result.exit_code == 0, result.output
    return Finished(out, result.exit_code, result.output)

"""Without rosbags a bag is refused with what to install."""

import sys
from pathlib import Path

import pytest

from data.bag.columns import read_columns
from data.findings import LogError
from data.mcap.field_path import parse_path


def test_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    with pytest.raises(LogError, match=r"pip install stribeck\[bags\]"):
        read_columns(tmp_path / "run.bag", [parse_path("/joint_states:position")])

"""Result folders: whose they are, and that nothing half-written or unreadable lies in them."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipelines.exit_status import UsageError
from pipelines.results.folder import MANIFEST, Owner, csv_text, folder_owner, json_text, open_results

BENCH = Owner("bench", "rig 3")


def entries(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_nothing_is_made_before_the_first_file(tmp_path: Path) -> None:
    open_results(tmp_path / "out", BENCH)
    assert entries(tmp_path) == []


def test_a_folder_says_whose_it_is(tmp_path: Path) -> None:
    folder = open_results(tmp_path / "a" / "b", BENCH)
    folder.write_text("x.txt", "x")
    assert folder_owner(folder.path) == BENCH
    assert entries(folder.path) == [MANIFEST, "x.txt"]


def test_the_same_campaign_brings_its_folder_up_to_date_file_by_file(tmp_path: Path) -> None:
    first = open_results(tmp_path / "out", BENCH)
    first.write_text("old.txt", "old")
    first.write_text("both.txt", "first")
    second = open_results(tmp_path / "out", BENCH)
    second.write_text("both.txt", "second")
    assert (first.path / "old.txt").read_text() == "old"
    assert (first.path / "both.txt").read_text() == "second"


@pytest.mark.parametrize("other", [Owner("other", "rig 3"), Owner("bench", "rig 4")])
def test_another_campaign_is_in_the_way(tmp_path: Path, other: Owner) -> None:
    open_results(tmp_path / "out", other).write_text("x.txt", "x")
    with pytest.raises(UsageError, match=f"holds the results of '{other.campaign}'"):
        open_results(tmp_path / "out", BENCH)


def test_what_nobody_of_ours_wrote_is_in_the_way_and_force_deletes_nothing(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(UsageError, match=r"thesis\.txt.*--force"):
        open_results(tmp_path, BENCH)
    open_results(tmp_path, BENCH, force=True).write_text("x.txt", "x")
    assert (tmp_path / "thesis.txt").read_text() == "years of work"
    open_results(tmp_path, BENCH).write_text("x.txt", "y")


@pytest.mark.parametrize(
    "content", ["", "[]", "{", '{"schema": "stribeck/manifest/1", "campaign": 1}', "\xff"]
)
def test_a_manifest_that_is_none_is_in_the_way(tmp_path: Path, content: str) -> None:
    (tmp_path / MANIFEST).write_text(content, encoding="latin-1")
    with pytest.raises(UsageError, match="no command of ours wrote"):
        open_results(tmp_path, BENCH)


def test_a_file_in_the_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x")
    for place in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(UsageError, match="is a file, not a folder"):
            open_results(place, BENCH, force=True)


def test_an_interrupted_write_leaves_the_old_file_and_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = open_results(tmp_path / "out", BENCH)
    folder.write_text("x.txt", "whole")

    def pulled(*_: object) -> None:
        raise OSError("the plug was pulled")

    monkeypatch.setattr(os, "fsync", pulled)
    with pytest.raises(OSError, match="plug"):
        folder.write_text("x.txt", "half")
    assert (folder.path / "x.txt").read_text() == "whole"
    assert entries(folder.path) == [MANIFEST, "x.txt"]


def test_json_begins_with_its_schema_and_knows_no_nan() -> None:
    text = json_text("stribeck/x/1", {"b": (1.0, None), "a": np.array([0.1]), "n": np.float64(0.5)})
    assert list(json.loads(text)) == ["schema", "b", "a", "n"]
    for value in (math.nan, math.inf, np.float64("nan"), np.array([np.nan])):
        with pytest.raises(ValueError, match="JSON"):
            json_text("stribeck/x/1", {"a": [{"deep": value}]})


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=5))
def test_floats_come_back_bit_for_bit(values: list[float]) -> None:
    assert json.loads(json_text("s", {"v": values}))["v"] == values
    row = next(csv.reader(io.StringIO(csv_text(["h"] * len(values), [values]).split("\n", 1)[1])))
    assert [float(cell) for cell in row] == values


@pytest.mark.parametrize("text", ["=1+1", "+1", "-x", "@sum"])
def test_a_text_cell_is_no_formula_and_a_number_stays_one(text: str) -> None:
    rows = list(csv.reader(io.StringIO(csv_text(["a", "b", "c", "d"], [[text, -1.5, None, True]]))))
    assert rows[1] == ["'" + text, "-1.5", "", "true"]


def test_what_a_killed_command_left_is_ours_and_goes_once_it_is_stale(tmp_path: Path) -> None:
    fresh, stale = (tmp_path / f".robot.json.{tail}.partial" for tail in ("0a1b2c3d", "89abcdef"))
    fresh.write_text("half")
    stale.write_text("half")
    os.utime(stale, (0, 0))
    open_results(tmp_path, BENCH).write_text("x.txt", "x")
    assert entries(tmp_path) == [fresh.name, MANIFEST, "x.txt"]


def test_only_our_own_leftovers_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / ".thesis.partial").write_text("years of work")
    with pytest.raises(UsageError, match="which no command of ours wrote"):
        open_results(tmp_path, BENCH)


def test_a_link_to_nothing_is_said(tmp_path: Path) -> None:
    (tmp_path / "out").symlink_to(tmp_path / "nowhere")
    with pytest.raises(UsageError, match="is a link to nothing"):
        open_results(tmp_path / "out", BENCH)


def test_a_name_from_a_log_steers_no_terminal() -> None:
    text = csv_text(["log"], [["a\x1b[31m\nb\r.csv"]])
    assert text == "log\na\\x1b[31m\\nb\\r.csv\n"

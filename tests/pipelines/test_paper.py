"""`paper`: all of its files, from nothing but the published parameters."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pipelines.paper import table1, write_paper
from pipelines.results.folder import Owner, ResultFolder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paper")
    write_paper(ResultFolder(path, Owner("paper")))
    return path


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def test_every_figure_comes_with_its_numbers(folder: Path) -> None:
    for number in (2, 4, 6, 7, 8, 9):
        assert (folder / f"figure{number}.svg").read_text(encoding="utf-8").rstrip().endswith("</svg>")
        assert len(rows(folder / f"figure{number}.csv")) > 50


def test_table_1_has_computed_means_and_critical_gains(folder: Path) -> None:
    table = table1()
    assert table["F_c [N m]"] == pytest.approx((0.3990, 0.3887, 0.39385))
    assert table["L_c [1/s]"] == pytest.approx((94.3668, 55.1481, 73.0704), abs=1e-4)
    written = {row["parameter"]: float(row["mean"]) for row in rows(folder / "table1.csv")}
    assert written == {name: row[2] for name, row in table.items()}
    assert "| L_c [1/s] | 94.3668 | 55.1481 | 73.0704 |" in (folder / "table1.md").read_text(encoding="utf-8")


def test_figure_4_collapses_at_the_critical_gain(folder: Path) -> None:
    table = [(float(row["L"]), float(row["exact_x1_max"])) for row in rows(folder / "figure4.csv")]
    assert all(error > 0 for L, error in table if L < 73.07)
    assert all(error == 0 for L, error in table if L > 73.08)


def test_figure_6_tells_which_perturbation_it_shows(folder: Path) -> None:
    table = rows(folder / "figure6.csv")
    assert {row["solution"] for row in table} == {"exact, r = 1", "perturbed, r = 1 + 1e-5"}
    late = [
        abs(float(row["x1"])) for row in table if row["solution"].startswith("pert") and float(row["t"]) > 20
    ]
    assert max(late) == pytest.approx(0.2456, abs=1e-4)


def test_figure_8_has_inner_edges_only_above_one(folder: Path) -> None:
    table = rows(folder / "figure8.csv")
    assert {float(row["r"]) > 1 for row in table if row["x1_inner"]} == {True}
    assert all(row["x1_outer"] for row in table if float(row["r"]) < 1)


def test_figure_9_is_the_diagram_over_r(folder: Path) -> None:
    document = json.loads((folder / "figure9.json").read_text(encoding="utf-8"))
    assert document["schema"] == "stribeck/diagram/1"
    points = [p for b in document["branches"] if b["kind"] == "limit_cycle" for p in b["points"]]
    amplitudes = {round(p["r"], 9): p["amplitude"] for p in points}
    assert amplitudes[1.01] == pytest.approx(0.09852434192, abs=1e-8)
    assert amplitudes[1.1] == pytest.approx(0.35368017536, abs=1e-8)


def test_it_is_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    write_paper(ResultFolder(tmp_path, Owner("paper")))
    for path in folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name

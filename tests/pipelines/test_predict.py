"""The bifurcation diagram as a command asks for it, ideal and sampled."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from compensation.sampled_loop import Sampling
from ident.model.published import asymmetric_robot, symmetric_robot
from pipelines.exit_status import UsageError
from pipelines.predict import Prediction, one_sweep, parse_sweep, predict, write_prediction
from pipelines.results.folder import Owner, ResultFolder

PAPER = Gains(0.4, 0.02, observer=73.5, compensation=1.0)


def ideal(over: str) -> Prediction:
    robot = symmetric_robot()
    return predict(robot, Controller(PAPER, robot), parse_sweep(over))


def test_a_sweep_includes_both_ends() -> None:
    sweep = parse_sweep("r=0.8:1.2:200")
    assert sweep.parameter == "r"
    assert (sweep.values[0], sweep.values[-1], sweep.values.size) == (0.8, 1.2, 200)
    assert parse_sweep("L=20:120:3").values.tolist() == [20.0, 70.0, 120.0]
    assert one_sweep([]).values.size == 200


@pytest.mark.parametrize(
    "text",
    [
        "", "r", "r=", "r=1", "r=1:2", "n1=0:1:5", "r=0.8:1.2:1", "r=1.2:0.8:5", "r=0.8:1.2:x", "r=-1:1:5",
        "r=0:inf:5", "r=nan:1:5", "r=0:1:1000000000", "r=0.8:1.2:2.5",
    ],
)  # fmt: skip
def test_a_sweep_that_is_none_is_wrong_usage(text: str) -> None:
    with pytest.raises(UsageError, match="--over"):
        parse_sweep(text)


def test_maps_are_not_drawn_yet() -> None:
    with pytest.raises(UsageError, match="more than once"):
        one_sweep(["r=0.8:1.2:5", "L=20:120:5"])


def test_files_hold_the_papers_diagram(tmp_path: Path) -> None:
    result = ideal("r=0.9:1.1:3")
    write_prediction(result, ResultFolder(tmp_path, Owner("paper")), title="paper")
    document = json.loads((tmp_path / "diagram.json").read_text(encoding="utf-8"))
    assert document["schema"] == "stribeck/diagram/1"
    assert (document["parameter"], document["observer_gain"]) == ("r", 73.5)
    assert document["compensation_gain"] is None
    assert "continuous" in document["loop"]
    (cycle,) = [b for b in document["branches"] if b["kind"] == "limit_cycle" and b["stable"]]
    (point,) = [p for p in cycle["points"] if p["r"] == 1.1]
    assert point["amplitude"] == pytest.approx(0.35368017536, abs=1e-8)
    assert point["period"] == pytest.approx(6.383337703, abs=1e-8)
    (rest,) = [
        p
        for b in document["branches"]
        if b["kind"] == "equilibrium_set"
        for p in b["points"]
        if p["r"] == 0.9
    ]
    robot = symmetric_robot()
    found = equilibrium_set(robot, Controller(Gains(0.4, 0.02, 73.5, 0.9), robot))
    assert (rest["x1_min"], rest["x1_max"]) == pytest.approx((found.x1_min, found.x1_max), rel=1e-12)
    with (tmp_path / "diagram.csv").open(encoding="utf-8", newline="") as text:
        rows = list(csv.DictReader(text))
    assert list(rows[0]) == ["r", "branch", "kind", "stable", "x1_min", "x1_max", "amplitude", "period"]
    assert sum(len(b["points"]) for b in document["branches"]) == len(rows)
    assert (tmp_path / "figure9.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_over_the_observer_gain(tmp_path: Path) -> None:
    write_prediction(ideal("L=40:80:5"), ResultFolder(tmp_path, Owner("paper")))
    document = json.loads((tmp_path / "diagram.json").read_text(encoding="utf-8"))
    assert (document["parameter"], document["observer_gain"], document["compensation_gain"]) == (
        "L",
        None,
        1.0,
    )
    edges = {
        p["L"]: p["x1_max"]
        for b in document["branches"]
        if b["kind"] == "equilibrium_set"
        for p in b["points"]
    }
    assert edges[40.0] == pytest.approx(0.272937911, abs=1e-8)


def test_counts_move_the_onset_of_the_sampled_loop() -> None:
    """The asymmetric rig under the mean law: with 20,000 counts it cycles only between 1.005 and 1.01."""
    robot = asymmetric_robot()
    sampling = Sampling(0.001, 2 * math.pi / 20_000)
    result = predict(robot, Controller(PAPER, robot.mean()), parse_sweep("r=1.0:1.1:5"), sampling=sampling)
    (branch,) = [b for b in result.diagram.branches if b.kind == "limit_cycle"]
    assert [round(p.value, 9) for p in branch.points] == [1.025, 1.05, 1.075, 1.1]
    assert branch.points[-1].amplitude == pytest.approx(0.35, abs=0.04)  # a tenth to a fifth below 0.391
    (onset,) = result.diagram.bifurcations
    assert 1.004 < onset.value < 1.011
    assert "counts" in result.loop
    assert "64.08 s" in result.notes[0]


def test_a_fast_exact_sampled_loop_cycles_as_the_inclusion_does() -> None:
    robot = symmetric_robot()
    controller = Controller(PAPER, robot)
    sweep = parse_sweep("r=1.05:1.1:2")
    sampled = predict(robot, controller, sweep, sampling=Sampling(2e-4))
    (branch,) = [b for b in sampled.diagram.branches if b.kind == "limit_cycle"]
    exact = [
        p.amplitude for b in predict(robot, controller, sweep).diagram.branches for p in b.points if p.period
    ]
    amplitudes = np.array([p.amplitude for p in branch.points], dtype=np.float64)
    assert amplitudes == pytest.approx(np.array(exact, dtype=np.float64), rel=0.03)

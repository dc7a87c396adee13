"""design.json of the published robot and of fitted ones, whole or in part."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compensation.controller import Gains
from compensation.design_criteria import critical_observer_gains
from ident.estimate import CURVE_PARAMETERS, Covariance, Estimate, IdentifiedRobot
from ident.model.friction import StribeckCurve
from ident.model.published import INERTIA, NEGATIVE, POSITIVE
from pipelines.design import design, write_design
from pipelines.results.folder import Owner, ResultFolder
from pipelines.results.robot_file import RobotFile, paper_robot
from pipelines.settings.loop import LoopDefaults
from pipelines.terminal import answers

GAINS = Gains(0.4, 0.02, observer=73.5, compensation=1.0)


def fitted(relative_error: float = 0.01, **positive: Estimate) -> RobotFile:
    """Table 1's columns as a fit with independent relative errors; `positive` replaces entries."""
    names = ["inertia"]
    centres = [INERTIA]
    entries: dict[str, dict[str, Estimate]] = {"positive": {}, "negative": {}}
    for direction, curve in (("positive", POSITIVE), ("negative", NEGATIVE)):
        for name in CURVE_PARAMETERS:
            value = getattr(curve, name)
            fixed = name == "stribeck_shape"
            entries[direction][name] = Estimate(
                value, "", None if fixed else relative_error * value, fixed=fixed
            )
            if not fixed:
                names.append(f"{direction}.{name}")
                centres.append(value)
    entries["positive"] |= positive
    identified = IdentifiedRobot(
        inertia=Estimate(INERTIA, "kg m^2", relative_error * INERTIA),
        positive=entries["positive"],
        negative=entries["negative"],
        mean=entries["positive"],
        torque_offset=Estimate(None, "N m", withheld="no reference"),
        runs=(),
        notes=(),
        covariance=Covariance(tuple(names), np.diag((relative_error * np.array(centres)) ** 2)),
        simulated=True,
    )
    return RobotFile("robot.json", Owner("bench"), identified.robot(), identified, LoopDefaults())


def written(source: RobotFile, folder: Path, gains: Gains | None = GAINS, **choices: Any) -> dict[str, Any]:
    write_design(design(source, gains, **choices), ResultFolder(folder, source.owner))
    content: dict[str, Any] = json.loads((folder / "design.json").read_text(encoding="utf-8"))
    return content


def test_the_papers_numbers(tmp_path: Path) -> None:
    found = written(paper_robot(), tmp_path)
    assert found["schema"] == "stribeck/design/1"
    critical = found["critical_observer_gain"]
    values = {name: round(critical[name]["value"], 2) for name in critical}
    assert values == {"positive": 94.37, "negative": 55.15, "mean": 73.07, "worst": 94.37}
    assert all(critical[name]["interval95"] is None for name in critical)
    assert found["decay_rate"]["observer_error"]["value"] == pytest.approx(0.4296, abs=1e-4)
    assert found["decay_rate"]["loop"]["value"] == pytest.approx(1.940384615, abs=1e-9)
    theorems = {
        (c["robot"], c["law"]): c["holds"]
        for c in found["certificates"]
        if c["hypothesis"].startswith("theorem")
    }
    assert theorems == {
        ("both directions", "per-direction"): False,
        ("both directions", "mean"): False,
        ("mean", "mean"): True,
    }
    assert found["equilibrium_sets"][-1]["single_point"] is True
    assert {"figure4.svg", "figure8.svg"} <= {path.name for path in tmp_path.iterdir()}


def test_rests_beside_the_cycle_are_told_up_to_r_max(tmp_path: Path) -> None:
    below = written(paper_robot(), tmp_path / "below", replace(GAINS, observer=40.0))
    above = written(paper_robot(), tmp_path / "above")
    assert below["rests_beside_the_cycle"]["r_max"]["value"] == pytest.approx(1.0349869921, abs=1e-9)
    assert above["rests_beside_the_cycle"]["r_max"]["value"] == 1.0
    assert below["rests_beside_the_cycle"]["r_max"]["interval95"] is None
    (said,) = [line for line in answers.design(below) if "beside any limit cycle" in line]
    assert said == "rests off the set point, beside any limit cycle, up to r = 1.035 at L = 40 1/s"


def test_r_max_of_each_direction_has_its_interval(tmp_path: Path) -> None:
    found = written(fitted(), tmp_path, replace(GAINS, observer=150.0))["rests_beside_the_cycle"]
    mean = 0.5 * (POSITIVE.static_torque + NEGATIVE.static_torque)
    assert found["positive"]["value"] == pytest.approx(POSITIVE.static_torque / mean, rel=1e-12)
    assert found["negative"]["value"] == pytest.approx(NEGATIVE.static_torque / mean, rel=1e-12)
    assert found["r_max"] == found["positive"]
    low, high = found["positive"]["interval95"]
    assert low < found["positive"]["value"] < high


def test_recommended_gains_keep_clear_of_both_limits(tmp_path: Path) -> None:
    found = written(fitted(), tmp_path)
    best, (mean,) = found["recommended"], found["recommended"]["alternatives"]
    assert best["compensator"] == "per-direction"
    assert best["observer_gain"] > found["critical_observer_gain"]["worst"]["interval95"][1] > 94.37
    assert 0.9 < best["compensation_gain"] < 1.0
    assert mean["compensator"] == "mean"
    assert mean["compensation_gain"] < NEGATIVE.static_torque / (
        0.5 * (POSITIVE.static_torque + NEGATIVE.static_torque)
    )
    assert best["largest_rest_error"] < mean["largest_rest_error"]


def test_intervals_agree_with_linear_error_propagation(tmp_path: Path) -> None:
    error = 0.003
    found = written(fitted(error), tmp_path)["critical_observer_gain"]["positive"]
    centre = {name: getattr(POSITIVE, name) for name in CURVE_PARAMETERS}

    def gain(change: str) -> float:
        values = {k: v * (1 + error) if k == change else v for k, v in centre.items()}
        curve = StribeckCurve(**values)
        inertia = INERTIA * (1 + error) if change == "inertia" else INERTIA
        return (curve.steepest_fall - curve.viscous_damping) / inertia

    free = [name for name in CURVE_PARAMETERS if name != "stribeck_shape"]
    deviation = float(np.sqrt(sum((gain(name) - gain("")) ** 2 for name in [*free, "inertia"])))
    low, high = found["interval95"]
    assert (high - low) / (2 * 1.96) == pytest.approx(deviation, rel=0.1)
    assert low < found["value"] < high


def test_a_fit_moves_with_its_two_directions_or_with_its_mean(tmp_path: Path) -> None:
    own = written(fitted(), tmp_path / "own")
    mean = written(fitted(), tmp_path / "mean", law="mean")
    assert own["decay_rate"]["observer_error"]["value"] == pytest.approx(73.5 - 94.37, abs=0.01)
    assert mean["decay_rate"]["observer_error"]["value"] == pytest.approx(73.5 - 73.07, abs=0.01)
    assert own["equilibrium_sets"][-1]["single_point"] is False
    assert mean["equilibrium_sets"][-1]["single_point"] is True
    assert own["simulated"] is True
    assert "SIMULATED" in (tmp_path / "own" / "figure4.svg").read_text(encoding="utf-8")


def test_the_compensator_can_carry_each_directions_own_law(tmp_path: Path) -> None:
    gains = replace(GAINS, observer=95.0)
    found = written(fitted(), tmp_path, gains, compensator="per-direction")
    assert found["compensator"] == "per-direction"
    assert found["equilibrium_sets"][-1]["single_point"] is True


def test_a_slow_controller_is_warned_of_its_observer_gain(tmp_path: Path) -> None:
    slow = replace(fitted(), loop=LoopDefaults(sample_period=0.01))
    (caution,) = written(slow, tmp_path / "slow")["recommended"]["cautions"]
    assert "L h" in caution
    quick = replace(fitted(), loop=LoopDefaults(sample_period=0.001))
    assert written(quick, tmp_path / "quick")["recommended"]["cautions"] == []


def test_a_linear_axis_has_its_own_units(tmp_path: Path) -> None:
    source = fitted()
    assert source.identified is not None
    found = written(replace(source, identified=replace(source.identified, axis="linear")), tmp_path)
    units = {certificate["unit"] for certificate in found["certificates"]}
    assert units == {"1/s", "1", "N", "m"}


def test_a_withheld_parameter_withholds_what_needs_it(tmp_path: Path) -> None:
    source = fitted(stribeck_velocity=Estimate(None, "rad/s", withheld="no run below 0.3 rad/s"))
    result = design(source, GAINS)
    assert result.withheld == ("positive.stribeck_velocity is withheld: no run below 0.3 rad/s",)
    found = written(source, tmp_path)
    assert found["critical_observer_gain"]["negative"]["value"] == pytest.approx(55.15, abs=0.01)
    for name in ("positive", "mean", "worst"):
        assert found["critical_observer_gain"][name]["value"] is None
        assert "no run below 0.3 rad/s" in found["critical_observer_gain"][name]["withheld"]
    assert found["recommended"]["observer_gain"] is None
    assert "stribeck_velocity" in found["recommended"]["why"]
    assert not (tmp_path / "figure4.svg").exists()


def test_an_infinitely_steep_law_has_no_finite_gain(tmp_path: Path) -> None:
    found = written(fitted(stribeck_shape=Estimate(0.8, "1", fixed=True)), tmp_path)
    for name in ("positive", "mean", "worst"):
        assert found["critical_observer_gain"][name]["value"] is None
        assert "beta < 1" in found["critical_observer_gain"][name]["withheld"]
    assert found["decay_rate"]["observer_error"]["value"] is None
    assert found["recommended"]["observer_gain"] is None


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    written(fitted(), tmp_path / "a")
    written(fitted(), tmp_path / "b")
    for name in ("design.json", "figure4.svg", "figure8.svg"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_worst_is_the_larger_direction() -> None:
    robot = fitted().fitted
    assert robot is not None
    found = critical_observer_gains(robot)
    assert found.worst == found.positive > found.mean > found.negative


def test_what_needs_no_gains_is_designed_without_them(tmp_path: Path) -> None:
    why = "the campaign has no set-point runs"
    document = written(fitted(), tmp_path, None, without_gains=why)
    with_gains = written(fitted(), tmp_path)
    assert document["critical_observer_gain"] == with_gains["critical_observer_gain"]
    assert document["overcompensation_threshold"] == with_gains["overcompensation_threshold"]
    assert document["gains"] is None
    assert document["withheld"] == [why]
    assert {entry["withheld"] for entry in document["decay_rate"].values()} == {why}
    assert {entry["withheld"] for entry in document["rests_beside_the_cycle"].values()} == {why}
    assert not any("beside any limit cycle" in line for line in answers.design(document))
    assert document["equilibrium_sets"] == document["certificates"] == []
    advice, usual = document["recommended"], with_gains["recommended"]
    assert advice["compensation_gain"] == usual["compensation_gain"]
    assert document["critical_observer_gain"]["worst"]["value"] < advice["observer_gain"]
    assert advice["observer_gain"] <= usual["observer_gain"]
    assert advice["largest_rest_error"] is None
    assert "not known without the proportional" in advice["why"]


def test_without_an_observer_gain_its_decay_is_withheld(tmp_path: Path) -> None:
    found = written(paper_robot(), tmp_path, replace(GAINS, observer=0.0))
    assert found["decay_rate"]["observer_error"]["value"] is None
    assert "needs L > 0 (eq 17)" in found["decay_rate"]["observer_error"]["withheld"]
    failing = [one["hypothesis"] for one in found["certificates"] if "needs L > 0" in one["says"]]
    assert any(hypothesis.startswith("theorem") for hypothesis in failing)

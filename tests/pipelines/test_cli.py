"""The command line: what lies where afterwards, exit codes, and no traceback whatever is put in."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from pipelines.cli import app
from tests.pipelines.conftest import Finished

RUN_FILES = {
    "robot.json", "friction_map.csv", "fit_report.txt", "table1.csv", "table1.md", "table1.tex",
    "figure2.svg", "validation.svg", "design.json", "figure4.svg", "figure8.svg", "diagram.csv",
    "diagram.json", "figure9.svg", "comparison.json", "comparison.csv", "figure10.svg", "report.html",
    "manifest.json",
}  # fmt: skip
HEAVY = ("numpy", "scipy", "pandas", "numba", "matplotlib", "lmfit", "pydantic", "mcap", "jinja2")


def stribeck(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def assert_refused(result: Result, status: int, *words: str) -> None:
    """One message that names what is wrong, the right exit code, and no traceback."""
    assert result.exit_code == status, result.output
    assert "Traceback" not in result.output
    assert "should not have happened" not in result.output
    for word in words:
        assert word in result.stderr


@pytest.fixture
def copied(recorded: Path, tmp_path: Path) -> Path:
    """The campaign, to spoil; its logs are links to the recorded ones."""
    for log in recorded.parent.rglob("*"):
        target = tmp_path / "rig" / log.relative_to(recorded.parent)
        if log.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            os.link(log, target)
    path = tmp_path / "rig" / recorded.name
    text = path.read_text(encoding="utf-8")
    path.unlink()
    path.write_text(text, encoding="utf-8")
    return path


def spoil(path: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_run_answers_everything(finished: Finished) -> None:
    assert finished.status == 0, finished.printed
    assert {path.name for path in finished.out.iterdir()} >= RUN_FILES
    assert "paper" in finished.printed
    assert "report.html" in finished.printed


def test_run_identifies_the_truth(finished: Finished, recorded: Path) -> None:
    robot = finished.document("robot.json")
    truth = json.loads((recorded.parent / "truth.json").read_text(encoding="utf-8"))
    assert robot["simulated"] is True
    assert robot["inertia"]["value"] == pytest.approx(truth["inertia"], rel=0.02)
    for direction in ("positive", "negative"):
        for name, within in (("static_torque", 0.02), ("coulomb_torque", 0.02), ("viscous_damping", 0.04)):
            assert robot[direction][name]["value"] == pytest.approx(truth[direction][name], rel=within)


def test_the_manifest_knows_every_file_of_the_folder(finished: Finished) -> None:
    manifest = finished.document("manifest.json")
    listed = {entry["file"] for entry in manifest["outputs"]}
    assert listed | {"manifest.json"} == {path.name for path in finished.out.iterdir()}
    assert manifest["commands"][0]["command"] == "run"
    assert str(finished.out.parent) not in json.dumps(manifest)


def test_no_result_holds_a_path_of_this_machine(finished: Finished, recorded: Path) -> None:
    for path in finished.out.iterdir():
        text = path.read_text(encoding="utf-8")
        assert str(recorded.parent) not in text, path
        assert str(finished.out.parent) not in text, path


def test_every_json_file_has_its_schema_first(finished: Finished) -> None:
    for path in finished.out.glob("*.json"):
        assert next(iter(finished.document(path.name))) == "schema"


def test_the_questions_of_a_robot_file(finished: Finished, tmp_path: Path) -> None:
    robot = finished.out / "robot.json"
    design = stribeck("design", robot, "-o", tmp_path / "d", "--json")
    assert design.exit_code == 0, design.output
    assert json.loads(design.stdout)["critical_observer_gain"]["worst"]["value"] == pytest.approx(
        94.4, rel=0.1
    )
    line = ("simulate", robot, "-o", tmp_path / "s", "--x0", "0.5,0,0", "--duration", "2")
    missing = stribeck(*line)
    assert_refused(missing, 2, "robot.json", "--compensation-gain")
    assert not (tmp_path / "s").exists()
    simulated = stribeck(*line, "--compensation-gain", "0.9")
    assert simulated.exit_code == 0, simulated.output
    rows = np.genfromtxt(tmp_path / "s" / "trajectory.csv", delimiter=",", names=True)
    assert rows.dtype.names == ("t", "x1", "x2", "x3", "v", "u")
    assert rows["t"][-1] == 2.0
    predicted = stribeck(
        "predict", robot, "-o", tmp_path / "p", "--over", "r=0.9:1.1:3", "--sample-period", "0"
    )
    assert predicted.exit_code == 0, predicted.output
    assert (tmp_path / "p" / "diagram.json").exists()


def test_compare_again_says_the_same(finished: Finished, recorded: Path, tmp_path: Path) -> None:
    again = stribeck("compare", recorded, "--robot", finished.out / "robot.json", "-o", tmp_path / "c", "-q")
    assert (again.exit_code, again.stdout) == (0, "")
    same = (tmp_path / "c" / "comparison.json").read_bytes()
    assert same == (finished.out / "comparison.json").read_bytes()


def test_identify_prints_its_robot_for_programs(recorded: Path, finished: Finished, tmp_path: Path) -> None:
    result = stribeck("identify", recorded, "-o", tmp_path / "i", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == finished.document("robot.json")


def test_inspect_needs_no_settings(recorded: Path) -> None:
    logs = sorted(recorded.parent.glob("*/*"))[:2]
    result = stribeck("inspect", *logs)
    assert result.exit_code == 0
    assert logs[0].name in result.stdout


def test_paper_from_its_parameters_alone(tmp_path: Path) -> None:
    result = stribeck("design", "paper", "-o", tmp_path / "paper", "--json")
    found = json.loads(result.stdout)["critical_observer_gain"]
    values = [found[name]["value"] for name in ("positive", "negative", "mean")]
    np.testing.assert_allclose(values, [94.37, 55.15, 73.07], atol=0.005)


def test_results_of_another_campaign_are_not_written_over(finished: Finished) -> None:
    before = (finished.out / "manifest.json").read_bytes()
    result = stribeck("design", "paper", "-o", finished.out)
    assert_refused(result, 2, "holds the results of 'small'", "--force")
    assert (finished.out / "manifest.json").read_bytes() == before


USAGE: dict[str, tuple[list[str], list[str]]] = {
    "no campaign": (["identify", "none.toml"], ["none.toml: cannot be read"]),
    "x0": (["simulate", "paper", "--x0", "1,2"], ["--x0"]),
    "x0 in words": (["simulate", "paper", "--x0", "a,b,c"], ["--x0"]),
    "duration": (["simulate", "paper", "--duration", "-1"], ["--duration"]),
    "format": (["simulate", "paper", "--format", "xls"], ["--format"]),
    "negative gain": (["simulate", "paper", "--observer-gain", "-1"], ["--observer-gain is -1"]),
    "nan gain": (["design", "paper", "--proportional", "nan"], ["--proportional is nan"]),
    "encoder": (["simulate", "paper", "--encoder-counts", "0"], ["--encoder-counts"]),
    "encoder alone": (["simulate", "paper", "--encoder-counts", "2000"], ["--sample-period"]),
    "sweep": (["predict", "paper", "--over", "q=1:2:3"], ["--over"]),
    "two sweeps": (["predict", "paper", "--over", "r=0:1:3", "--over", "L=1:2:3"], ["--over"]),
    "unknown option": (["predict", "paper", "--draws", "9"], ["--draws"]),
    "unknown command": (["export", "paper"], ["export"]),
    "worded number": (["design", "paper", "--observer-gain", "many"], ["--observer-gain"]),
    "law": (["design", "paper", "--law", "none"], ["--law"]),
    "no robot": (["compare", "none.toml"], ["--robot"]),
}


@pytest.mark.parametrize(("words", "said"), USAGE.values(), ids=USAGE.keys())
def test_wrong_usage_is_2_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(stribeck(*words), 2, *said)
    assert list(tmp_path.iterdir()) == []


def test_a_robot_file_that_is_none_is_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(stribeck("design", "none.json"), 1, "none.json: cannot be read")
    assert list(tmp_path.iterdir()) == []


def empty(log: Path) -> None:
    log.unlink()
    log.write_bytes(b"")


def cut(log: Path) -> None:
    content = log.read_bytes()
    log.unlink()
    log.write_bytes(content[: len(content) // 2])


def with_nan(log: Path) -> None:
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    lines[len(lines) // 2] = "nan," + lines[len(lines) // 2].split(",", 1)[1]
    log.unlink()
    log.write_text("".join(lines), encoding="utf-8")


@pytest.mark.parametrize(
    ("pattern", "harm"),
    [("velocity/*.csv", empty), ("breakaway/*.mcap", empty), ("set_point/*.mcap", empty),
     ("multisine/*.mcap", cut), ("velocity/*.csv", with_nan)],
)  # fmt: skip
def test_a_bad_log_is_1_and_named_and_nothing_is_written(
    copied: Path, tmp_path: Path, pattern: str, harm: Callable[[Path], None]
) -> None:
    log = sorted(copied.parent.glob(pattern))[0]
    harm(log)
    result = stribeck("run", copied, "-o", tmp_path / "out")
    assert_refused(result, 1, log.name)
    assert not (tmp_path / "out").exists()


def test_an_unknown_signal_is_named(copied: Path, tmp_path: Path) -> None:
    spoil(copied, "q_deg", "q_dge")
    assert_refused(stribeck("identify", copied, "-o", tmp_path / "out"), 1, "q_dge", "q_deg")
    assert not (tmp_path / "out").exists()


def test_a_missing_direction_is_withheld_and_the_other_never_copied(copied: Path, tmp_path: Path) -> None:
    for log in (*copied.parent.glob("velocity/n*"), *copied.parent.glob("breakaway/n*")):
        log.unlink()
    out = tmp_path / "out"
    result = stribeck("run", copied, "-o", out)
    assert result.exit_code == 3, result.output
    robot = json.loads((out / "robot.json").read_text(encoding="utf-8"))
    assert all(robot["positive"][name]["value"] is not None for name in ("static_torque", "coulomb_torque"))
    for law in ("negative", "mean"):
        for estimate in robot[law].values():
            assert estimate["value"] is None
            assert "negative" in estimate["withheld"]
    assert (out / "report.html").exists()


def test_both_directions_missing_are_refused(copied: Path, tmp_path: Path) -> None:
    for log in (*copied.parent.glob("velocity/*"), *copied.parent.glob("breakaway/*")):
        log.unlink()
    result = stribeck("run", copied, "-o", tmp_path / "out")
    assert result.exit_code in {1, 2}, result.output
    assert not (tmp_path / "out").exists()


def test_an_excluded_log_is_listed_and_no_reason_for_status_3(copied: Path, tmp_path: Path) -> None:
    log = sorted(path.name for path in copied.parent.glob("set_point/*"))[0]
    spoil(
        copied,
        'logs = ["set_point/*.mcap"]',
        f'logs = ["set_point/*.mcap"]\nexclude = {{ "{log}" = "belt" }}',
    )
    result = stribeck("compare", copied, "--robot", "paper", "-o", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["excluded"] == [{"log": f"set_point/{log}", "why": "belt"}]
    assert len(document["runs"]) == 3
    onset = document["onset"][0]
    assert onset["predicted_interval95"] is None
    assert "no uncertainty" in onset["why"]["predicted_interval95"]


def test_a_withheld_parameter_is_3_and_everything_else_is_written(recorded: Path, tmp_path: Path) -> None:
    """Speeds far above the Stribeck velocity and no breakaways say nothing of the curve's bend."""
    text = recorded.read_text(encoding="utf-8")
    start = text.index('[[experiment]]\nprotocol = "breakaway"')
    text = text[:start] + text[text.index("[[experiment]]", start + 1) :]
    path = tmp_path / "fast.toml"
    path.write_text(text, encoding="utf-8")
    spoil(
        path, "[0.005, 0.012, 0.03, 0.07, 0.17, 0.4, 1.0, 2.5]", "[0.5, 0.6, 0.75, 0.9, 1.1, 1.4, 1.8, 2.4]"
    )
    assert stribeck("record", path, "-q").exit_code == 0
    result = stribeck("run", path, "-o", tmp_path / "out")
    assert_refused(result, 3)
    assert "withheld" in result.stdout
    robot = json.loads((tmp_path / "out" / "robot.json").read_text(encoding="utf-8"))
    assert robot["positive"]["stribeck_velocity"]["value"] is None
    assert robot["positive"]["stribeck_velocity"]["withheld"]
    comparison = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))
    assert comparison["runs"][0]["verdict"] == "equilibrium"
    assert comparison["runs"][0]["predicted"]["verdict"] is None
    assert "withheld" in comparison["runs"][0]["predicted"]["why"]
    assert comparison["onset"][0]["recorded"] == [0.98, 1.05]
    assert comparison["onset"][0]["predicted"] is None
    assert {"design.json", "figure2.svg", "figure10.svg", "report.html", "manifest.json"} <= {
        entry.name for entry in (tmp_path / "out").iterdir()
    }
    assert_refused(
        stribeck("simulate", tmp_path / "out" / "robot.json", "--compensation-gain", "1"), 1, "withheld"
    )


def test_help_loads_nothing_heavy() -> None:
    code = f"import sys, pipelines.cli; print([name for name in {HEAVY} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_the_module_is_the_command() -> None:
    found = subprocess.run(
        [sys.executable, "-m", "pipelines", "--help"], capture_output=True, text=True, check=True
    )
    for command in (
        "demo",
        "record",
        "inspect",
        "identify",
        "design",
        "simulate",
        "predict",
        "compare",
        "run",
        "paper",
    ):
        assert command in found.stdout


def test_an_interruption_is_130_and_clean(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pipelines.paper.write_paper", interrupted)
    result = stribeck("paper", "-o", tmp_path / "out")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_defect_of_ours_is_one_line_and_a_traceback_only_on_request(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def broken(_: object) -> None:
        raise ZeroDivisionError("one \x1b[31m over none")

    monkeypatch.setattr("pipelines.paper.write_paper", broken)
    monkeypatch.delenv("STRIBECK_DEBUG", raising=False)
    result = stribeck("paper", "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "STRIBECK_DEBUG=1" in result.stderr
    assert "\x1b" not in result.stderr
    monkeypatch.setenv("STRIBECK_DEBUG", "1")
    assert "Traceback" in stribeck("paper", "-o", tmp_path / "out").stderr


def test_without_set_point_runs_the_true_reason_is_said_and_the_rest_is_done(
    copied: Path, tmp_path: Path
) -> None:
    text = copied.read_text(encoding="utf-8")
    head, tail = text.index('[[experiment]]\nprotocol = "set_point"'), text.index("\n[virtual_rig]")
    copied.write_text(text[:head] + text[tail:], encoding="utf-8")
    out = tmp_path / "out"
    result = stribeck("run", copied, "-o", out)
    assert result.exit_code == 3, result.output
    design = json.loads((out / "design.json").read_text(encoding="utf-8"))
    assert design["critical_observer_gain"]["worst"]["value"] == pytest.approx(94.4, rel=0.15)
    assert design["recommended"]["observer_gain"] is not None
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "No complete friction law" not in page
    assert "--proportional" in page
    assert "has no set-point runs" in page


@pytest.mark.parametrize("words", [("--over", "junk"), ("--proportional", "-1"), ("--sample-period", "nan")])
def test_run_checks_its_options_before_it_writes(
    recorded: Path, tmp_path: Path, words: tuple[str, str]
) -> None:
    assert_refused(stribeck("run", recorded, "-o", tmp_path / "out", *words), 2, words[0])
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("scale", ["1e-300", "1e300"])
def test_a_torque_of_no_rig_is_refused(copied: Path, tmp_path: Path, scale: str) -> None:
    spoil(copied, 'unit = "N m" }', f'unit = "N m", scale = {scale} }}')
    assert_refused(
        stribeck("identify", copied, "-o", tmp_path / "out"),
        1,
        "torque reaches",
        "which no rig does",
        "scale",
    )


@pytest.mark.parametrize("command", ["demo", "design", "compare"])
def test_help_shows_every_default(command: str) -> None:
    shown = stribeck(command, "--help").stdout
    assert "default: stribeck-out" in " ".join(shown.replace("│", " ").split())


def test_what_was_salvaged_is_3_and_said(copied: Path, tmp_path: Path) -> None:
    log = sorted((copied.parent / "breakaway").glob("*.mcap"))[0]
    content = log.read_bytes()
    log.unlink()
    log.write_bytes(content[: int(0.8 * len(content))])
    out = tmp_path / "out"
    result = stribeck("identify", copied, "-o", out, "--salvage")
    assert result.exit_code == 3, result.output
    assert f"{log.name}: E-DAMAGE: salvaged" in result.stdout
    document = json.loads((out / "robot.json").read_text(encoding="utf-8"))
    (entry,) = [run for run in document["runs"] if run["log"].endswith(log.name)]
    assert "salvaged" in entry["why"]

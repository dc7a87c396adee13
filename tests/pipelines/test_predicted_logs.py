"""Predicted runs as logs: the ecosystem's reader finds the prediction, on the recording's clock."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from typer.testing import CliRunner

from data.signals import Signal, Signals
from pipelines.cli import app
from pipelines.inspect import inspect_log
from pipelines.predicted_logs import TOPIC, predicted_run
from pipelines.recordings import set_point_logs
from pipelines.results.folder import Owner, ResultFolder
from pipelines.results.robot_file import read_robot
from pipelines.run_outcomes import as_run
from pipelines.settings.campaign import Rig, load_campaign
from pipelines.viewer_layout import LAYOUT, write_layout
from tests.pipelines.conftest import Finished


@pytest.fixture(scope="module")
def compared(recorded: Path, finished: Finished, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("compared") / "out"
    robot = str(finished.out / "robot.json")
    arguments = ["compare", str(recorded), "--robot", robot, "-o", str(out), "--predicted-logs", "-q"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return out


def test_mcaps_own_reader_finds_the_prediction(compared: Path, recorded: Path, finished: Finished) -> None:
    source = read_robot(finished.out / "robot.json")
    assert source.fitted is not None
    runs = set_point_logs(load_campaign(recorded)).runs
    files = sorted((compared / "predicted").iterdir())
    assert [path.stem for path in files] == sorted(Path(run.recording.log).stem for run in runs)
    for run in runs:
        path = compared / "predicted" / f"{Path(run.recording.log).stem}.mcap"
        model = source.fitted.mean() if run.compensator is None else run.compensator.model(source.fitted)
        truth = predicted_run(as_run(run, source.moving("per-direction"), model))
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            rows = [
                (message.log_time, state.position[0], state.velocity[0], state.effort[0])
                for _, _, message, state in reader.iter_decoded_messages(topics=[TOPIC])
            ]
            (metadata,) = [record.metadata for record in reader.iter_metadata()]
        stamp, position, velocity, effort = (np.array(column) for column in zip(*rows, strict=True))
        assert np.array_equal(position, truth.measured)
        assert np.array_equal(velocity, truth.velocity)
        assert np.array_equal(effort, truth.torque)
        assert metadata["simulated"] == "true"
        assert metadata["prediction_of"] == run.recording.log
        begun = run.recording.begun
        assert begun is not None
        seconds = (stamp - round(begun * 1e9)) * 1e-9
        assert np.allclose(seconds, run.recording.time[: seconds.size], rtol=0, atol=1e-8)
        assert abs(seconds.size - run.recording.time.size) <= 1
        described = inspect_log(path)
        assert described.simulated
        assert described.integrity.checksums == "verified"


def test_the_manifest_names_them_and_only_when_asked(compared: Path, finished: Finished) -> None:
    manifest = json.loads((compared / "manifest.json").read_text(encoding="utf-8"))
    for path in (compared / LAYOUT, *(compared / "predicted").iterdir()):
        name = path.relative_to(compared).as_posix()
        (entry,) = [entry for entry in manifest["outputs"] if entry["file"] == name]
        assert entry["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert manifest["commands"][0]["options"]["predicted_logs"] is True
    assert not (finished.out / "predicted").exists()
    assert not (finished.out / LAYOUT).exists()


def series(tmp_path: Path, *signals: Signals) -> list[tuple[str, str]]:
    folder = ResultFolder(tmp_path, Owner("c"))
    rig = Rig(name="r", encoder_counts=1000.0, torque_limit=None, axis="rotary")
    write_layout(folder, signals, rig=rig)
    layout = json.loads((tmp_path / LAYOUT).read_text(encoding="utf-8"))
    paths = layout["configById"][layout["layout"]]["paths"]
    return [(path["value"], path["timestampMethod"]) for path in paths]


def test_the_layout_plots_recorded_and_predicted_position(compared: Path, tmp_path: Path) -> None:
    layout = json.loads((compared / LAYOUT).read_text(encoding="utf-8"))
    paths = layout["configById"]["Plot!position"]["paths"]
    assert [path["value"] for path in paths] == ["/joint_states.position[0]", f"{TOPIC}.position[0]"]
    predicted = (f"{TOPIC}.position[0]", "headerStamp")
    named = Signals(position=Signal("/js:position{link}", unit="deg", sign=-1, offset=0.5), clock="log")
    nested = Signals(position=Signal("/rig:motor[1].q", unit="counts"))
    degree, count = np.pi / 180, 2 * np.pi / 1000
    assert series(tmp_path, named, nested) == [
        (f"/js.position[:].@mul({-degree!r}).@add(0.5)", "receiveTime"),
        (f"/rig.motor[1].q.@mul({count!r})", "headerStamp"),
        predicted,
    ]
    assert series(tmp_path, Signals(position=Signal("no path")), Signals()) == [predicted]

"""robot.json: what was identified comes back as it was, and what is no robot is refused by file and key."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from data.findings import Finding, Severity
from ident.estimate import (
    CURVE_PARAMETERS,
    Covariance,
    Estimate,
    IdentifiedRobot,
    ProfilePoints,
    RunUse,
)
from ident.model import published
from ident.model.friction import StribeckCurve
from ident.model.robot import OneLinkRobot
from pipelines.results.folder import Owner, open_results
from pipelines.results.robot_file import RobotFileError, paper_robot, read_robot, write_robot
from pipelines.settings.loop import Compensator, LoopDefaults
from tests.strategies import robots

LOOP = LoopDefaults(
    proportional=0.4,
    derivative=0.02,
    observer=73.5,
    sample_period=0.001,
    resolution=1e-4,
    observer_update="exact",
    delay=2,
    compensator=Compensator(published.symmetric_robot().friction, 0.03),
)


def curve(values: StribeckCurve) -> dict[str, Estimate]:
    return {name: Estimate(getattr(values, name), "x", 0.01, (None, 2.0)) for name in CURVE_PARAMETERS}


def identified(robot: OneLinkRobot) -> IdentifiedRobot:
    return IdentifiedRobot(
        inertia=Estimate(robot.inertia, "kg m^2", 1e-4, (0.9 * robot.inertia, None)),
        positive=curve(robot.friction.positive),
        negative=curve(robot.friction.negative),
        mean=curve(robot.mean().friction.positive),
        torque_offset=Estimate(None, "N m", withheld="no experiment separates it"),
        runs=(RunUse("a.csv", "ff", "breakaway", used=False, why="belt <slipped>"),),
        notes=(Finding("E-OFFSET", Severity.WARN, "text", "a.csv"),),
        covariance=Covariance(("inertia", "positive.static_torque"), np.array([[1e-8, 1e-9], [1e-9, 1e-6]])),
        inertia_sources={"breakaway": Estimate(0.02, "kg m^2")},
        profiles={"mean.static_torque": ProfilePoints(np.array([0.5, 0.6, 0.8]), np.array([4.5, 0.0, 5.0]))},
        axis="linear",
        simulated=True,
    )


def written(folder: Path, robot: IdentifiedRobot) -> Path:
    return write_robot(open_results(folder / "out", Owner("bench", "rig 3"), force=True), robot, LOOP)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20, deadline=None)
@given(robot=robots())
def test_a_robot_comes_back_bit_for_bit(tmp_path: Path, robot: OneLinkRobot) -> None:
    before = identified(robot)
    found = read_robot(written(tmp_path, before))
    after = found.identified
    assert after is not None
    assert (found.fitted, found.loop, found.owner) == (robot, LOOP, Owner("bench", "rig 3"))
    same = replace(after, covariance=before.covariance, profiles=before.profiles)
    assert same == before
    assert after.covariance.names == before.covariance.names
    np.testing.assert_array_equal(after.covariance.matrix, before.covariance.matrix)
    for name, profile in before.profiles.items():
        np.testing.assert_array_equal(after.profiles[name].value, profile.value)
        np.testing.assert_array_equal(after.profiles[name].rise, profile.rise)
    assert after.draws(3, np.random.default_rng(1)) == before.draws(3, np.random.default_rng(1))


def test_the_laws_and_compensators_that_can_be_chosen(tmp_path: Path) -> None:
    robot = published.asymmetric_robot()
    found = read_robot(written(tmp_path, identified(robot)))
    assert found.moving() == robot
    assert found.moving("mean") == robot.mean()
    assert found.compensating() == OneLinkRobot(0.03, published.symmetric_robot().friction)
    assert found.compensating("mean") == robot.mean()
    assert found.compensating("per-direction") == robot


def test_the_paper_s_robot() -> None:
    found = read_robot("paper")
    assert found == paper_robot()
    assert found.moving() == published.symmetric_robot() == found.compensating()
    loop = found.loop
    assert (loop.compensation, loop.observer, loop.proportional, loop.derivative) == (1.0, 73.5, 0.4, 0.02)
    assert loop.sample_period == 0.0


def test_a_withheld_parameter_leaves_no_robot_and_says_why(tmp_path: Path) -> None:
    robot = identified(published.asymmetric_robot())
    gone = Estimate(None, "rad/s", withheld="no slow runs: record speeds below 0.07 rad/s")
    found = read_robot(
        written(tmp_path, replace(robot, negative={**robot.negative, "stribeck_velocity": gone}))
    )
    assert found.fitted is None
    with pytest.raises(RobotFileError, match=r"negative\.stribeck_velocity is withheld: no slow runs"):
        found.moving()


def test_a_file_with_no_more_than_the_parameters_is_enough(tmp_path: Path) -> None:
    path = written(tmp_path, identified(published.asymmetric_robot()))
    document = json.loads(path.read_text(encoding="utf-8"))
    path = tmp_path / "mine.json"
    needed = ("schema", "inertia", "positive", "negative")
    path.write_text(json.dumps({key: document[key] for key in needed}), encoding="utf-8")
    found = read_robot(path)
    assert found.fitted == published.asymmetric_robot()
    assert found.loop == LoopDefaults()
    assert found.owner == Owner("mine")
    assert found.identified is not None
    mean = published.symmetric_robot().friction.positive
    assert {name: entry.value for name, entry in found.identified.mean.items()} == {
        name: getattr(mean, name) for name in CURVE_PARAMETERS
    }


Document = dict[str, Any]
HOSTILE: dict[str, tuple[Callable[[Document], object], str]] = {
    "schema": (lambda d: d.update(schema="stribeck/robot/9"), "schema is 'stribeck/robot/9'"),
    "no schema": (lambda d: d.pop("schema"), "schema is None"),
    "missing": (lambda d: d.pop("positive"), "positive: Field required"),
    "missing deeper": (
        lambda d: d["positive"].pop("static_torque"),
        "positive.static_torque: Field required",
    ),
    "worded": (lambda d: d["inertia"].update(value="0.026"), "inertia.value: Input should be a valid number"),
    "true": (lambda d: d["inertia"].update(value=True), "inertia.value: Input should be a valid number"),
    "no reason": (lambda d: d["inertia"].update(value=None), "inertia: .*`withheld` must say why"),
    "no robot": (lambda d: d["inertia"].update(value=-1.0), "inertia is -1.0 kg m"),
    "law": (lambda d: (d.pop("mean"), d["negative"]["static_torque"].update(value=0.1)), "F_s >= F_c"),
    "jump": (lambda d: (d.pop("mean"), d["positive"]["stribeck_shape"].update(value=1e9)), "beta <= 100"),
    "mean": (
        lambda d: d["mean"]["static_torque"].update(value=0.9),
        r"mean\.static_torque is 0\.9: the mean of",
    ),
    "swapped": (
        lambda d: d["inertia"].update(interval95=[0.03, 0.02]),
        r"inertia: interval95 is \[0\.03, 0\.02\]: the lower end",
    ),
    "slip": (lambda d: d["inertia"].update(stder=0.1), r"inertia\.stder: Extra inputs"),
    "protocol": (lambda d: d["runs"][0].update(protocol="x"), "runs.0.protocol"),
    "names": (lambda d: d["covariance"].update(names=["inertia"]), "covariance: .* 1 names"),
    "unknown name": (
        lambda d: d["covariance"].update(names=["inertia", "x"]),
        "covariance: .* 'x' is no parameter",
    ),
    "ragged": (lambda d: d["covariance"].update(matrix=[[1.0], [1.0, 2.0]]), "covariance: .* 2 names"),
    "skew": (lambda d: d["covariance"].update(matrix=[[1.0, 0.0], [1.0, 2.0]]), "covariance is symmetric"),
    "indefinite": (lambda d: d["covariance"].update(matrix=[[1.0, 2.0], [2.0, 1.0]]), "negative eigenvalue"),
    "profile name": (lambda d: d["profiles"].update(x={"value": [], "rise": []}), "'x' is no parameter"),
    "profile": (
        lambda d: d["profiles"].update(inertia={"value": [1.0, 2.0], "rise": [0.0]}),
        r"profiles\.inertia: 2 values and 1 rises",
    ),
    "profile order": (
        lambda d: d["profiles"].update(inertia={"value": [2.0, 1.0], "rise": [0.0, 1.0]}),
        "profiles.inertia: value: a profile goes from low",
    ),
    "gain": (lambda d: d["campaign"]["loop"].update(observer=-1.0), "campaign.loop.observer"),
    "a list": (lambda d: d.update(positive=[1, 2]), "positive: "),
}


@pytest.mark.parametrize(("spoil", "message"), HOSTILE.values(), ids=HOSTILE.keys())
def test_a_spoiled_file_is_refused_by_file_and_key(
    tmp_path: Path, spoil: Callable[[Document], object], message: str
) -> None:
    path = written(tmp_path, identified(published.asymmetric_robot()))
    document = json.loads(path.read_text(encoding="utf-8"))
    spoil(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(RobotFileError, match=message) as refusal:
        read_robot(path)
    assert str(path) in str(refusal.value)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b"\xff\xfe",
        b"null",
        b"3",
        b'{"schema": "stribeck/robot/1", "inertia": NaN}',
    ],
)
def test_what_is_no_json_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "robot.json"
    path.write_bytes(content)
    with pytest.raises(RobotFileError, match=r"robot\.json"):
        read_robot(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    for path in (tmp_path / "none.json", tmp_path):
        with pytest.raises(RobotFileError, match="cannot be read"):
            read_robot(path)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(
    key=st.sampled_from(["inertia", "positive", "mean", "runs", "notes", "covariance", "campaign"]),
    value=JSON,
)
def test_whatever_stands_in_a_key_is_read_or_refused(tmp_path: Path, key: str, value: object) -> None:
    path = written(tmp_path, identified(published.asymmetric_robot()))
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**document, key: value}), encoding="utf-8")
    with contextlib.suppress(RobotFileError):
        read_robot(path)

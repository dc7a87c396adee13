"""campaign.toml: what it says is what is read, and what breaks a rule is refused in its own words."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from data.findings import LogError
from data.protocols import SetPoint
from data.signals import Signal
from pipelines.settings.campaign import Campaign, load_campaign
from pipelines.settings.campaign_error import CampaignError
from pipelines.settings.set_point import FromMetadata

TEXT = """
[rig]
name = "bench 3"
encoder_counts = 20000
[signals]
time = { csv = "t" }
position = { csv = "q_deg", mcap = "/joint_states:position[0]", unit = { csv = "deg", mcap = "rad" } }
torque = { csv = "i", mcap = "/joint_states:effort[0]", unit = "A", scale = 0.12, sign = -1 }
[[experiment]]
protocol = "constant_velocity"
logs = ["velocity/*.csv"]
exclude = { "velocity/p0.30.csv" = "belt slipped" }
window = { "p0.10.csv" = [2.0, 9.5] }
[[experiment]]
protocol = "set_point"
logs = ["runs/*.mcap"]
torque = { mcap = "/torque:data" }
proportional_gain = 0.4
derivative_gain = 0.02
observer_gain = { "a.mcap" = 40, "b.mcap" = 73.5 }
compensation_gain = "metadata:r"
compensator = { static_torque = 0.54, coulomb_torque = 0.39, stribeck_velocity = 0.07, viscous_damping = 0 }
"""
LOGS = ("velocity/p0.30.csv", "velocity/p0.10.csv", "runs/b.mcap", "runs/a.mcap")


def written(folder: Path, text: str = TEXT, logs: tuple[str, ...] = LOGS) -> Path:
    for log in logs:
        (folder / log).parent.mkdir(parents=True, exist_ok=True)
        (folder / log).touch()
    path = folder / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, text: str = TEXT) -> Campaign:
    return load_campaign(written(folder, text))


def test_a_campaign_is_read_as_it_says(tmp_path: Path) -> None:
    campaign = loaded(tmp_path)
    steady, runs = campaign.experiments
    assert (campaign.name, campaign.rig.name, campaign.rig.axis) == ("bench", "bench 3", "rotary")
    assert steady.logs == ("velocity/p0.10.csv", "velocity/p0.30.csv")
    assert steady.exclude == {"velocity/p0.30.csv": "belt slipped"}
    assert steady.window == {"velocity/p0.10.csv": (2.0, 9.5)}
    assert steady.signals.of("csv").torque == Signal("i", "A", scale=0.12, sign=-1)
    assert steady.signals.of("csv").position == Signal("q_deg", "deg")
    assert runs.logs == ("runs/a.mcap", "runs/b.mcap")


def test_a_signal_of_an_experiment_takes_the_whole_place_of_the_rig_s(tmp_path: Path) -> None:
    assert loaded(tmp_path).experiments[1].signals.of("mcap").torque == Signal("/torque:data")


def test_set_point_gains_come_from_numbers_tables_and_metadata(tmp_path: Path) -> None:
    runs = loaded(tmp_path).experiments[1].set_point
    assert runs is not None
    assert runs.compensation_gain == FromMetadata("r")
    assert runs.for_log("runs/a.mcap", {"r": "0.95"}) == SetPoint(0.4, 0.02, 40.0, 0.95)
    assert runs.for_log("runs/b.mcap", {"r": "1.1"}).observer_gain == 73.5
    assert runs.compensator is not None
    assert runs.compensator.inertia is None


@pytest.mark.parametrize("metadata", [{}, {"R": "1"}, {"r": "one"}, {"r": "-1"}, {"r": "nan"}])
def test_a_gain_that_a_log_does_not_hold_names_log_and_key(tmp_path: Path, metadata: dict[str, str]) -> None:
    runs = loaded(tmp_path).experiments[1].set_point
    assert runs is not None
    with pytest.raises(LogError, match=r"runs/a\.mcap: compensation_gain .* 'r'"):
        runs.for_log("runs/a.mcap", metadata)


def test_loop_defaults_hold_only_what_is_the_same_for_all_runs(tmp_path: Path) -> None:
    defaults = loaded(tmp_path).loop_defaults()
    assert (defaults.proportional, defaults.derivative) == (0.4, 0.02)
    assert (defaults.observer, defaults.compensation) == (None, None)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("campaign.toml", "bench7"), ("other.toml", "other"), ("Campaign 2.toml", "Campaign 2")],
)
def test_a_campaign_is_called_by_its_file_or_its_folder(tmp_path: Path, name: str, expected: str) -> None:
    folder = tmp_path / "bench7" / "campaign"
    path = written(folder).rename(folder / name)
    assert load_campaign(path).name == expected


BROKEN = {
    "true sign": ("sign = -1", "sign = true", "torque.sign: True is no sign: give 1 or -1"),
    "no column": ('csv = "i"', "csv = -1", "torque.csv: -1 is no column: give its header's text"),
    "angle of a torque": ('unit = "A", scale = 0.12', 'unit = "deg"', "torque: 'deg' measures angle"),
    "huge gain": ("proportional_gain = 0.4", "proportional_gain = 1e22", "a gain is a number from 0 to"),
    "unknown table": ("[rig]", "[rigg]", "rigg: unknown key; the nearest known one is 'rig'"),
    "unknown key": ("observer_gain", "observer_gian", r"observer_gian: unknown key; .* 'observer_gain'"),
    "unknown signal key": ("scale", "scall", "torque.scall: unknown key; the nearest known one is 'scale'"),
    "unknown signal": ("time =", "tyme =", "tyme: unknown key; the nearest known one is 'time'"),
    "plural table": ("[[experiment]]", "[[experiments]]", "experiments: unknown key; .* 'experiment'"),
    "negative gain": (
        "proportional_gain = 0.4",
        "proportional_gain = -0.4",
        "proportional_gain: -0.4: a gain",
    ),
    "zero n1": ("proportional_gain = 0.4", "proportional_gain = 0", "proportional_gain` is 0: n1 > 0"),
    "worded gain": (
        "proportional_gain = 0.4",
        'proportional_gain = "x"',
        "proportional_gain: 'x' is no gain",
    ),
    "true gain": (
        "proportional_gain = 0.4",
        "proportional_gain = true",
        "proportional_gain: True is no number",
    ),
    "infinite gain": ("proportional_gain = 0.4", "proportional_gain = inf", "proportional_gain: inf: a gain"),
    "missing gain": ("proportional_gain = 0.4", "", "`proportional_gain` is missing"),
    "table lacks a log": (', "b.mcap" = 73.5', "", "observer_gain: the table has no entry for 'runs/b.mcap'"),
    "table names no log": ('"b.mcap" =', '"c.mcap" =', "observer_gain: 'c.mcap' is none of its logs"),
    "gain in a table": ("= 73.5 }", '= "y" }', "observer_gain: 'y' for 'b.mcap' is no number"),
    "glob": ("velocity/*.csv", "speed/*.csv", r"logs: 'speed/\*.csv' matches no file"),
    "excluded log": ('"velocity/p0.30.csv" =', '"p0.3.csv" =', "exclude: 'p0.3.csv' is none of its logs"),
    "window": ("[2.0, 9.5]", "[9.5, 2.0]", r"window of 'p0.10.csv' is \[9.5, 2\]"),
    "protocol": ('"set_point"', '"setpoint"', "protocol: Input should be"),
    "unit": ('unit = "A"', 'unit = "Ampere-ish"', "torque: 'Ampere-ish'"),
    "format": ('csv = "deg"', 'cvs = "deg"', "position.unit: 'cvs' is no log format"),
    "no source": ('csv = "q_deg", ', "", r"velocity/p0.10.csv is a csv log, .* where position stands"),
    "compensator": (
        "static_torque = 0.54",
        "static_torque = 0.3",
        "compensator: static_torque 0.3 N m is below",
    ),
    "half a compensator": ("static_torque = 0.54, ", "", "compensator: static_torque is missing"),
    "axis": ('name = "bench 3"', 'axis = "round"', r"\[rig\]: axis: Input should be 'rotary' or 'linear'"),
    "counts": ("20000", "-5", r"\[rig\]: encoder_counts: .* \(it is -5\)"),
    "misplaced key": ("[2.0, 9.5] }", "[2.0, 9.5] }\ndelay = 1", "`delay` belongs to the protocol set_point"),
    "TOML": ("[rig]", "[rig", "not TOML: .*line 2"),
    "clock": ('csv = "i"', 'clock = "log"', "`clock` belongs to `time`"),
}


@pytest.mark.parametrize(("old", "new", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_a_broken_rule_is_said_with_file_and_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(CampaignError, match=message) as refusal:
        loaded(tmp_path, TEXT.replace(old, new))
    assert str(refusal.value).startswith(str(tmp_path / "bench.toml"))


def test_a_folder_that_is_named_like_a_log_is_said(tmp_path: Path) -> None:
    path = written(tmp_path)
    (tmp_path / "velocity" / "p9.csv").mkdir()
    with pytest.raises(CampaignError, match=r"velocity.p9\.csv', which is a folder"):
        load_campaign(path)


def test_files_that_are_no_campaign(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=r"none\.toml: cannot be read"):
        load_campaign(tmp_path / "none.toml")
    with pytest.raises(CampaignError, match="cannot be read"):
        load_campaign(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CampaignError, match="byte 0 is not UTF-8"):
        load_campaign(binary)
    binary.write_text("", encoding="utf-8")
    with pytest.raises(CampaignError, match="experiment: is missing"):
        load_campaign(binary)


def test_logs_may_still_have_to_be_recorded(tmp_path: Path) -> None:
    path = written(tmp_path, logs=())
    with pytest.raises(CampaignError, match="matches no file"):
        load_campaign(path)
    campaign = load_campaign(path, logs_exist=False)
    assert campaign.experiments[0].logs == ()
    assert campaign.experiments[0].log_patterns == ("velocity/*.csv",)


def test_a_log_whose_name_looks_like_a_pattern_is_found(tmp_path: Path) -> None:
    path = written(tmp_path, TEXT.replace("runs/*.mcap", "runs/[1].mcap").replace(
        '{ "a.mcap" = 40, "b.mcap" = 73.5 }', "73.5"), (*LOGS, "runs/[1].mcap"))  # fmt: skip
    assert load_campaign(path).experiments[1].logs == ("runs/[1].mcap",)


KEYS = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=20)
HEADS = ("[rig]\n", "[signals]\n", 'protocol = "constant_velocity"\n', 'protocol = "set_point"\n')


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(key=KEYS, head=st.sampled_from(HEADS))
def test_no_unknown_key_passes(tmp_path: Path, key: str, head: str) -> None:
    text = TEXT.replace(head, f"{head}{key} = 1\n")
    with pytest.raises(CampaignError) as refusal:
        loaded(tmp_path, text)
    assert key in str(refusal.value) or "not TOML" in str(refusal.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(text=st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(CampaignError):
        loaded(tmp_path, text.encode("utf-8", "ignore").decode())

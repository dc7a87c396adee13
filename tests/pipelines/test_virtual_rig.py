"""The virtual rig: its logs, read back through the door of any log, hold the motion that the truth makes."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path, PurePath

import numpy as np
import pytest

from data.csv.log import write_csv
from data.ingest import read_recording
from data.recording import FloatArray, Recording
from data.signals import CsvDialect, RigSignals, Signal, Signals
from data.units import Quantity
from ident.model.published import asymmetric_robot
from ident.response import law_array
from pipelines.settings.campaign import Campaign, load_campaign
from pipelines.settings.campaign_error import CampaignError
from pipelines.virtual.demo_campaign import demo_campaign_text
from pipelines.virtual.log import Look, write_log
from pipelines.virtual_rig import TRUTH, record

COUNT = 2 * math.pi / 2**18

SMALL = """
[rig]
name = "small"
encoder_counts = 262144
[signals]
time = { csv = "t" }
position = { csv = "q_deg", mcap = "/joint_states:position[0]", unit = { csv = "deg", mcap = "rad" } }
torque = { csv = "u", mcap = "/joint_states:effort[0]" }
[[experiment]]
protocol = "breakaway"
logs = ["breakaway/*.mcap"]
[[experiment]]
protocol = "constant_velocity"
logs = ["velocity/*.csv"]
[[experiment]]
protocol = "frequency_response"
logs = ["multisine/*.mcap"]
[[experiment]]
protocol = "set_point"
logs = ["set_point/run_*.mcap"]
proportional_gain = 0.4
derivative_gain = 0.02
observer_gain = 73.5
compensation_gain = "metadata:r"
[virtual_rig]
torque_noise = 0.01
ramp_rates = [0.3]
ramps = 2
speeds = [0.01, 1.0]
multisine = { realisations = 2 }
compensation_gains = [0.9, 1.1]
starts = [0.6]
duration = 15.0
"""

AWKWARD = """
[rig]
encoder_counts = 1000000
axis = "linear"
[signals]
time = { csv = "zeit", unit = { csv = "ms" } }
position = { csv = "x", mcap = "/axis/state:position{slide}", unit = { csv = "mm", mcap = "counts" } }
torque = { csv = "i", mcap = "/axis/state:effort[0]", unit = "A", scale = 5.0, sign = -1, offset = 0.5 }
velocity = { mcap = "/axis/state:velocity[0]", unit = "mm/s" }
reference = { mcap = "/command:position" }
[[experiment]]
protocol = "constant_velocity"
logs = ["v/a*.mcap", "v/b*.csv"]
[[experiment]]
protocol = "excitation"
logs = ["e/*.csv"]
[virtual_rig]
speeds = [0.005]
[virtual_rig.robot]
inertia = 2.5
positive = { static_torque = 20, coulomb_torque = 14, stribeck_velocity = 0.02, viscous_damping = 8 }
negative = { static_torque = 18, coulomb_torque = 13, stribeck_velocity = 0.025, viscous_damping = 7 }
"""


def campaign_in(folder: Path, text: str, *, logs_exist: bool = False) -> Campaign:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "campaign.toml").write_text(text)
    return load_campaign(folder / "campaign.toml", logs_exist=logs_exist)


def recordings(campaign: Campaign) -> dict[str, Recording]:
    again = load_campaign(campaign.path)
    return {
        log: read_recording(
            campaign.folder / log,
            log=log,
            protocol=experiment.protocol,
            signals=experiment.signals,
            axis=again.rig.axis,
            encoder_counts=again.rig.encoder_counts,
            torque_limit=None,
        )
        for experiment in again.experiments
        for log in experiment.logs
    }


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Recording]:
    campaign = campaign_in(tmp_path_factory.mktemp("rig") / "small", SMALL)
    written = record(campaign, campaign.folder)
    found = recordings(campaign)
    assert sorted(written) == sorted([*(campaign.folder / log for log in found), campaign.folder / TRUTH])
    return found


def test_every_log_is_found_by_its_glob_read_without_findings_and_labelled(
    small: dict[str, Recording],
) -> None:
    assert len(small) == 2 + 4 + 2 + 2
    assert all(run.simulated and not run.findings for run in small.values())
    assert {run.metadata["r"] for log, run in small.items() if log.startswith("set_point")} == {"0.9", "1.1"}
    for run in small.values():
        counts = run.position / COUNT
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-4)
        assert run.sample_period == pytest.approx(1e-3, rel=1e-6)


@pytest.mark.parametrize(("log", "speed"), [("p0.01", 0.01), ("n0.01", -0.01), ("p1", 1.0), ("n1", -1.0)])
def test_a_constant_speed_shows_the_friction_of_its_direction(
    small: dict[str, Recording], log: str, speed: float
) -> None:
    run = small[f"velocity/{log}.csv"]
    friction = asymmetric_robot().friction
    curve = friction.positive if speed > 0 else friction.negative
    assert np.polyfit(run.time, run.position, 1)[0] == pytest.approx(speed, rel=1e-3)
    noise = 0.01 / math.sqrt(run.time.size)
    assert math.copysign(1, speed) * run.torque.mean() == pytest.approx(
        float(curve.total(abs(speed))), abs=5 * noise + 2e-4
    )
    assert np.all(np.diff(run.position[::500]) * speed > 0)  # no stick-slip


def test_breakaways_start_from_rest_at_the_static_torque(small: dict[str, Recording]) -> None:
    for log, static in (("p_rate0.3", 0.5735), ("n_rate0.3", -0.5123)):
        run = small[f"breakaway/{log}.mcap"]
        moved = np.flatnonzero(np.abs(run.position - run.position[0]) > 3 * COUNT)[0]
        onset = float(np.median(run.torque[moved - 20 : moved + 5]))
        assert onset == pytest.approx(static, abs=0.02)
        assert abs(run.position[-1] - run.position[0]) > 2 * 1.5  # two ramps, each over the travel
        assert np.ptp(run.position[-100:]) == 0.0


def test_multisines_differ_in_phase_and_swing_about_the_bias(small: dict[str, Recording]) -> None:
    runs = [small[f"multisine/{n}.mcap"] for n in (1, 2)]
    for run in runs:
        speed = np.gradient(run.position, run.time)
        assert speed.mean() == pytest.approx(3.0, rel=1e-3)
        assert 5 * 0.075 < speed.min() < speed.max() < 1.5 * 3.0
        assert run.time.size == 4 * 2000
        np.testing.assert_allclose(run.torque[:2000], run.torque[2000:4000], atol=0.08)
    assert np.std(runs[0].torque - runs[1].torque) > 0.1


def test_set_points_rest_below_and_cycle_above(small: dict[str, Recording]) -> None:
    resting, cycling = (small[f"set_point/run_r{r}_p0.6.mcap"].position for r in ("0.900", "1.100"))
    assert np.ptp(resting[-3000:]) == 0.0
    assert np.abs(cycling[-7000:]).max() == pytest.approx(0.39, rel=0.02)


def test_the_truth_stands_beside_the_logs(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD)
    told: list[tuple[str, int, int]] = []
    written = record(campaign, tmp_path, lambda label, done, total: told.append((label, done, total)))
    truth = json.loads((tmp_path / TRUTH).read_text())
    assert truth["schema"] == "stribeck/truth/1"
    assert truth["simulated"] is True
    assert truth["inertia"] == 2.5
    assert truth["negative"]["stribeck_velocity"] == 0.025
    assert told[0] == ("v/ap0.005.mcap", 0, 4)
    assert told[-1] == (TRUTH, 4, 4)
    assert len(written) == 5


def test_awkward_names_units_and_axes_read_back_as_meant(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD)
    record(campaign, tmp_path)
    runs = recordings(campaign)
    assert set(runs) == {"v/ap0.005.mcap", "v/bn0.005.csv", "e/1.csv", "e/2.csv"}
    forward, backward = runs["v/ap0.005.mcap"], runs["v/bn0.005.csv"]
    friction = campaign.virtual_rig.true_robot().friction if campaign.virtual_rig else None
    assert friction is not None
    assert forward.torque.mean() == pytest.approx(float(friction.positive.total(0.005)), rel=1e-3)
    assert backward.torque.mean() == pytest.approx(-float(friction.negative.total(0.005)), rel=1e-3)
    for run, speed in ((forward, 0.005), (backward, -0.005)):
        assert np.polyfit(run.time, run.position, 1)[0] == pytest.approx(speed, rel=1e-3)
        np.testing.assert_allclose(run.position * 1e6, np.rint(run.position * 1e6), atol=1e-3)
    assert forward.velocity is not None
    assert forward.reference is not None
    assert forward.velocity.mean() == pytest.approx(0.005, rel=1e-3)
    assert np.abs(forward.reference - forward.position).max() < 1e-4


def test_parquet_logs_are_recorded_and_read_back_bit_for_bit(tmp_path: Path) -> None:
    """What is written as CSV keeps 12 decimals, as MCAP whole nanoseconds; Parquet keeps everything."""
    plain = AWKWARD.replace('{ csv = "zeit", unit = { csv = "ms" } }', '{ csv = "t", parquet = "t" }')
    plain = re.sub(r"(?m)^(position|torque) = .*", r'\1 = { csv = "\1", parquet = "\1" }', plain)
    texts = {kind: plain.replace('"v/a*.mcap", "v/b*.csv"', f'"v/*.{kind}"') for kind in ("csv", "parquet")}
    runs = {}
    for kind, text in texts.items():
        folder = tmp_path / kind
        folder.mkdir()
        campaign = campaign_in(folder, text.replace('"e/*.csv"', f'"e/*.{kind}"'))
        record(campaign, folder)
        runs[kind] = recordings(campaign)
    assert {PurePath(log).suffix for log in runs["parquet"]} == {".parquet"}
    for log, run in runs["parquet"].items():
        other = runs["csv"][log.replace(".parquet", ".csv")]
        assert run.simulated
        np.testing.assert_array_equal(run.time, 1e-3 * np.arange(run.time.size))
        np.testing.assert_allclose(run.position, other.position, rtol=0, atol=6e-13)
        np.testing.assert_allclose(run.torque, other.torque, rtol=0, atol=6e-13)
        counts = run.position * 1e6
        np.testing.assert_array_equal(run.position, np.rint(counts) * 1e-6)  # as the encoder gave them


def test_a_fast_link_on_a_fine_encoder_is_read_without_findings(tmp_path: Path) -> None:
    text = AWKWARD.replace('"excitation"\nlogs = ["e/*.csv"]', '"breakaway"\nlogs = ["b/*.csv"]')
    campaign = campaign_in(tmp_path, text.replace("speeds =", "ramps = 2\nspeeds ="))
    record(campaign, tmp_path)
    runs = [run for log, run in recordings(campaign).items() if log.startswith("b/")]
    assert len(runs) == 4
    # over 2^10 counts a sample: as large as a counter's overflow could be
    assert max(np.abs(np.diff(run.position)).max() for run in runs) > 1.02e-3
    assert all(run.findings == () for run in runs)


def test_the_same_seed_writes_the_same_bytes(tmp_path: Path) -> None:
    text = AWKWARD + "\n"
    seeds = [text, text, text.replace("[virtual_rig]\n", "[virtual_rig]\nseed = 2\n")]
    contents = []
    for number, variant in enumerate(seeds):
        campaign = campaign_in(tmp_path / str(number), variant)
        contents.append([path.read_bytes() for path in record(campaign, campaign.folder)[:-1]])
    assert contents[0] == contents[1]
    assert all(a != b for a, b in zip(contents[0], contents[2], strict=True))


def test_recording_again_brings_the_logs_up_to_date(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD)
    assert record(campaign, tmp_path) == record(campaign, tmp_path)


def test_a_real_rig_s_log_is_not_written_over(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD)
    real = tmp_path / "v" / "bn0.005.csv"
    write_csv(real, columns={"zeit": np.arange(3.0)})
    before = real.read_bytes()
    with pytest.raises(CampaignError, match=r"bn0\.005\.csv: is there already.*real "):
        record(campaign, tmp_path)
    assert real.read_bytes() == before
    assert not (tmp_path / TRUTH).exists()


def test_logs_of_an_earlier_recording_go_and_those_of_others_stay(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD)
    record(campaign, tmp_path)
    other = campaign_in(tmp_path, AWKWARD.replace("[0.005]", "[0.006]"))
    record(other, tmp_path)
    assert {path.name for path in (tmp_path / "v").iterdir()} == {"ap0.006.mcap", "bn0.006.csv"}
    foreign = tmp_path / "v" / "b_real.csv"
    write_csv(foreign, columns={"zeit": np.arange(3.0)})
    with pytest.raises(CampaignError, match=r"b_real\.csv: matches a pattern"):
        record(other, tmp_path)
    assert foreign.exists()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('"e/*.csv"', '"e/motion.csv"', "fills in the `[*]`"),
        ('"e/*.csv"', '"v/a*.mcap", "v/**/*.csv"', "fills in the `[*]`"),
        ('"/axis/state:effort[0]"', '"/motor:effort[0]"', "one is written"),
        ('"/axis/state:effort[0]"', '"/axis/state:current"', "JointState"),
        ('csv = "i"', "csv = 2", "columns by name"),
    ],
)
def test_refuses_names_that_it_cannot_write_to(tmp_path: Path, before: str, after: str, said: str) -> None:
    assert before in AWKWARD
    campaign = campaign_in(tmp_path, AWKWARD.replace(before, after))
    with pytest.raises(CampaignError, match=said):
        record(campaign, tmp_path)


def test_refuses_a_campaign_without_a_virtual_rig(tmp_path: Path) -> None:
    campaign = campaign_in(tmp_path, AWKWARD[: AWKWARD.index("[virtual_rig]")])
    with pytest.raises(CampaignError, match=r"no \[virtual_rig\]"):
        record(campaign, tmp_path)


def test_a_table_of_gains_names_the_runs_itself(tmp_path: Path) -> None:
    text = SMALL.replace('"metadata:r"', '{ "run_a.mcap" = 0.9, "run_b.mcap" = 1.1 }')
    parts = text.split("[[experiment]]")
    text = parts[0] + "[[experiment]]" + parts[-1]
    campaign = campaign_in(tmp_path, text.replace("set_point/run_*", "run_*"))
    assert [path.name for path in record(campaign, tmp_path)] == ["run_a.mcap", "run_b.mcap", TRUTH]


@pytest.mark.parametrize("quick", [True, False])
def test_the_demo_s_campaign_is_one(tmp_path: Path, quick: bool) -> None:
    campaign = campaign_in(tmp_path, demo_campaign_text(quick))
    assert campaign.virtual_rig is not None
    assert campaign.virtual_rig.true_robot() == asymmetric_robot()
    assert [experiment.protocol for experiment in campaign.experiments] == [
        "breakaway",
        "constant_velocity",
        "frequency_response",
        "set_point",
    ]
    settings = campaign.experiments[-1].set_point
    assert settings is not None
    assert settings.compensator is not None
    model, mean = settings.compensator.model(asymmetric_robot()), asymmetric_robot().mean()
    np.testing.assert_allclose(law_array(model), law_array(mean), rtol=1e-12)


def test_a_dialect_that_the_virtual_rig_does_not_write_is_refused(tmp_path: Path) -> None:
    for dialect, said in ((CsvDialect(decimal=","), "decimal"), (CsvDialect(header=False), "header")):
        signals = Signals(position=Signal("q"), torque=Signal("u"), dialect=dialect)
        look = Look(RigSignals(csv=signals), "rotary", None, "cdr")
        run = np.arange(5, dtype=np.float64)
        values: dict[Quantity, FloatArray] = {"time": run, "position": run, "torque": run}
        with pytest.raises(CampaignError, match=f"leave `{said}` out"):
            write_log(tmp_path / "run.csv", look, values=values, metadata={})
    assert list(tmp_path.iterdir()) == []

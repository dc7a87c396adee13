"""The file door: real and written logs become recordings in SI, everything else a LogError that helps."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from data.csv.log import write_csv
from data.findings import LogError, Severity
from data.ingest import read_recording
from data.mcap.writer import write_mcap
from data.recording import FloatArray, Recording
from data.signals import RigSignals, Signal, Signals
from tests.data import hostile

EMPS = Path(__file__).parents[3] / "shared/realdata/emps"
TIME = np.arange(3000, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
VELOCITY = 2 * np.cos(2 * TIME)
TORQUE = 0.4 * np.sign(VELOCITY) + 0.1 * VELOCITY
MCAP = RigSignals(
    mcap=Signals(
        position=Signal("/joint_states:position[0]"),
        torque=Signal("/joint_states:effort{link}"),
        velocity=Signal("/joint_states:velocity"),
    )
)


def read(path: Path, signals: RigSignals = MCAP, **options: object) -> Recording:
    return read_recording(path, log=path.name, protocol="excitation", signals=signals, **options)  # type: ignore[arg-type]  # the tests name what they need


def write(path: Path, **changes: object) -> Path:
    columns = {"time": TIME, "position": POSITION, "velocity": VELOCITY, "effort": TORQUE}
    metadata = {"simulated": "true", "r": "0.9"}
    write_mcap(path, metadata=metadata, **(columns | changes))
    return path


def test_both_formats_give_the_same_recording(tmp_path: Path) -> None:
    mcap = read(write(tmp_path / "run.mcap", epoch=1_700_000_000_000_000_000))
    columns = {"t [ms]": TIME * 1e3, "q [deg]": np.degrees(POSITION), "i [A]": -TORQUE / 0.12}
    write_csv(tmp_path / "run.csv", columns=columns, metadata={"simulated": "true", "r": "0.9"})
    signals = RigSignals(
        csv=Signals(
            time=Signal("t", unit="ms"),
            position=Signal("q [deg]", unit="deg"),
            torque=Signal("i", unit="A", scale=0.12, sign=-1),
        )
    )
    csv = read(tmp_path / "run.csv", signals)
    for recording in (mcap, csv):
        assert recording.simulated
        assert recording.metadata["r"] == "0.9"
        assert recording.findings == ()
        assert np.allclose(recording.time, TIME, rtol=0, atol=1e-12)
        assert np.allclose(recording.position, POSITION, rtol=0, atol=1e-14)
        assert np.allclose(recording.torque, TORQUE, rtol=0, atol=1e-14)
        assert recording.resolution == pytest.approx(1e-5, rel=1e-6)
    assert mcap.velocity is not None
    assert np.array_equal(mcap.velocity, VELOCITY)
    assert len(mcap.sha256) == 64


def test_the_encoder_of_the_campaign_beats_the_estimate(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap")
    assert read(path, encoder_counts=20_000).resolution == pytest.approx(2 * np.pi / 20_000)


def test_a_window_is_counted_from_the_start_of_the_log(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap", time=TIME + 100.0)
    cut = read(path, window=(0.5, 1.0))
    assert (cut.time[0], cut.time[-1], cut.time.size) == (0.5, 1.0, 501)
    with pytest.raises(LogError, match=r"window of 50 to 60 s; the log lasts 2.999 s"):
        read(path, window=(50, 60))


def test_a_reference_on_its_own_topic_is_paired_or_held(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap", extra={"/command": np.where(TIME < 1, 0.0, 0.25)})
    position, torque = Signal("/joint_states:position"), Signal("/joint_states:effort")
    signals = RigSignals(
        mcap=Signals(position=position, torque=torque, reference=Signal("/command:position"))
    )
    got = read(path, signals).reference
    assert got is not None
    assert np.array_equal(got, np.where(TIME < 1, 0.0, 0.25))


@pytest.mark.skipif(not EMPS.exists(), reason="the EMPS recordings are not beside the project")
@pytest.mark.parametrize("name", ["estimation.csv", "validation.csv"])
def test_a_real_linear_axis(name: str) -> None:
    signals = RigSignals(
        csv=Signals(
            position=Signal("qm [m]"), torque=Signal("vir", unit="V", scale=35.15065), reference=Signal("qg")
        )
    )
    got = read(EMPS / name, signals, axis="linear")
    assert got.findings == ()
    assert got.time.size == 24_841
    assert got.sample_period == pytest.approx(1e-3, rel=1e-9)
    logged = RigSignals(csv=Signals(position=Signal("qm"), torque=Signal("force")))
    assert np.allclose(read(EMPS / name, logged, axis="linear").torque, got.torque, atol=1e-4)
    # The published estimate of the rig is 203.5 N s/m and 20.4 N: the power balance gives the same size.
    slope = np.gradient(got.position, got.time)
    moving = np.abs(slope) > 0.05
    fit = np.linalg.lstsq(
        np.stack((np.gradient(slope, got.time), slope, np.sign(slope), np.ones_like(slope)), axis=1)[moving],
        got.torque[moving],
        rcond=None,
    )[0]
    assert fit[1] == pytest.approx(203.5, rel=0.15)


@pytest.mark.parametrize(
    ("signals", "why"),
    [
        (Signals(position=Signal("/joint_states:position")), "names no torque for mcap"),
        (Signals(position=Signal("/joints:position"), torque=Signal("/x:y")), "no topic.*/joint_states"),
        (
            Signals(position=Signal("/joint_states:pos"), torque=Signal("/joint_states:effort")),
            "no field 'pos'.*position",
        ),
        (
            Signals(position=Signal("/joint_states:position[3]"), torque=Signal("/joint_states:effort")),
            "no element 3",
        ),
        (
            Signals(
                position=Signal("/joint_states:position", unit="mm"), torque=Signal("/joint_states:effort")
            ),
            "measures length",
        ),
        (
            Signals(
                position=Signal("/joint_states:position"), torque=Signal("/joint_states:effort", unit="A")
            ),
            "needs a `scale`",
        ),
    ],
)
def test_signals_that_a_log_does_not_have(tmp_path: Path, signals: Signals, why: str) -> None:
    path = write(tmp_path / "run.mcap")
    with pytest.raises(LogError, match=f"run.mcap.*{why}"):
        read(path, RigSignals(mcap=signals))


@pytest.mark.parametrize(
    ("header", "unit"), [("q [deg]", None), ("q_deg", None), ("q (deg)", "rad"), ("q [rpm]", "rad")]
)
def test_a_unit_in_the_log_that_contradicts_the_campaign(
    tmp_path: Path, header: str, unit: str | None
) -> None:
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": TIME, header: POSITION, "u": TORQUE})
    signals = RigSignals(csv=Signals(position=Signal(1, unit=unit), torque=Signal("u")))
    with pytest.raises(LogError, match="E-UNIT refuse: the log declares position in"):
        read(path, signals)


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "noise.mcap").write_bytes(np.random.default_rng(0).bytes(5000))
    for name, why in (
        ("none.mcap", "no such file"),
        ("empty.mcap", "0 bytes"),
        ("folder.mcap", "is a folder"),
        ("noise.mcap", "does not begin as an MCAP file|no topic"),
        ("run.xyz", "by their ending"),
    ):
        with pytest.raises(LogError, match=why):
            read(tmp_path / name)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap")
    path.chmod(0)
    with pytest.raises(LogError, match="cannot be read"):
        read(path)


def test_a_cut_log_is_refused_and_salvaged_on_request(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap", time=np.arange(30_000, dtype=np.float64) * 1e-3, **long_columns())
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(
        LogError, match=r"run.mcap is damaged at bytes \d+ to \d+.*`--salvage` would keep \d+ messages"
    ):
        read(path)
    kept = read(path, salvage=True)
    assert [(finding.code, finding.severity) for finding in kept.findings] == [
        ("E-DAMAGE", Severity.WITHHOLD)
    ]
    assert re.search(
        r"lost bytes \d+ to \d+, behind log time [\d.]+ s: .*Kept \d+ messages", kept.findings[0].text
    )
    assert 5000 < kept.time.size < 30_000
    assert np.array_equal(kept.torque, long_columns()["effort"][: kept.time.size])


def long_columns() -> dict[str, FloatArray]:
    time = np.arange(30_000, dtype=np.float64) * 1e-3
    speed = 2 * np.cos(2 * time)
    return {"position": np.sin(2 * time), "velocity": speed, "effort": 0.4 * np.sign(speed)}


@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_clocks(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "run.mcap"
    hostile.run(path, n=500, encoding=encoding)  # type: ignore[arg-type]  # a word of the parameters
    for clock in (None, "header", "log", "publish"):
        named = MCAP.of("mcap")
        signals = Signals(position=named.position, torque=named.torque, clock=clock)
        assert np.allclose(
            read(path, RigSignals(mcap=signals)).time, np.arange(500, dtype=np.float64) * 1e-3, atol=1e-12
        )
    field = Signal("/joint_states:header.stamp.nanosec", unit="ns")
    timed = RigSignals(mcap=Signals(position=named.position, torque=named.torque, time=field))
    assert np.allclose(read(path, timed).time, np.arange(500, dtype=np.float64) * 1e-3, atol=1e-12)


def test_a_clock_that_jumps_back_splits_the_run(tmp_path: Path) -> None:
    time = TIME.copy()
    time[1500:] -= 0.5
    path = write(tmp_path / "run.mcap", time=time)
    got = read_recording(path, log="run.mcap", protocol="constant_velocity", signals=MCAP)
    assert [(f.code, f.severity) for f in got.findings] == [("E-CLOCK", Severity.WARN)]
    assert "the clock (header stamps) jumps back by 0.499 s" in got.findings[0].text
    first, second = got.parts()
    assert np.allclose(first.time, TIME[:1500], atol=1e-9)
    assert np.allclose(np.diff(second.time), np.diff(TIME[1500:]), atol=1e-9)
    assert np.array_equal(np.concatenate((first.position, second.position)), got.position)


@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_stamps_that_drift_from_the_log_s_times_are_told(tmp_path: Path, rate: float) -> None:
    path = tmp_path / "run.mcap"
    messages = []
    for k in range(2000):
        stamp, logged = 1_000_000_000 + k * 1_000_000, 1_000_000_000 + round(k * 1e6 * (1 + rate))
        sec, nanosec = divmod(stamp, 10**9)
        data = {
            "header": {"stamp": {"sec": sec, "nanosec": nanosec}},
            "position": [1e-3 * k],
            "effort": [0.1],
        }
        messages.append(hostile.message(1, logged, json.dumps(data).encode()))
    channel = hostile.channel(1, 0, "/joint_states", "json")
    path.write_bytes(hostile.file(channel, *messages))
    named = Signals(position=Signal("/joint_states:position[0]"), torque=Signal("/joint_states:effort[0]"))
    found = read(path, RigSignals(mcap=named)).findings
    assert [(f.code, f.severity) for f in found] == [("E-CLOCK", Severity.WARN)] * bool(rate)
    assert all("by 0.01999 s over the run, 1 %" in f.text for f in found)


def test_damage_is_told_before_what_it_leaves_missing(tmp_path: Path) -> None:
    content = write(tmp_path / "run.mcap").read_bytes()
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 0x40
    for name, damaged in (
        ("flip", bytes(flipped)),
        ("half", content[: len(content) // 2]),
        ("head", content[:8]),
        ("noise", content[:8] + np.random.default_rng(0).bytes(5000)),
        ("text", b"t,q,u\n0,0,0\n"),
    ):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(damaged)
        for salvage in (False, True):
            with pytest.raises(
                LogError, match=f"{name}.mcap is damaged at bytes? .* Nothing in it can be saved"
            ):
                read(path, salvage=salvage)


def test_a_topic_missing_from_what_was_salvaged_is_told_with_the_damage(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap", time=np.arange(30_000, dtype=np.float64) * 1e-3, **long_columns())
    path.write_bytes(path.read_bytes()[:-400])
    signals = RigSignals(
        mcap=Signals(position=Signal("/other:position"), torque=Signal("/joint_states:effort"))
    )
    with pytest.raises(LogError, match="is damaged at bytes"):
        read(path, signals)
    with pytest.raises(LogError, match=r"no topic '/other'.*salvaged: lost bytes"):
        read(path, signals, salvage=True)


def test_what_stands_behind_the_end_is_said_and_nothing_else_changes(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap")
    content = path.read_bytes()
    whole = read(path)
    for rest, why in ((b"x" * 100, "100 bytes stand behind the end"), (content, "another MCAP file of")):
        path.write_bytes(content + rest)
        got = read(path)
        assert [(finding.code, finding.severity) for finding in got.findings] == [("E-FILE", Severity.WARN)]
        assert why in got.findings[0].text
        assert np.array_equal(got.torque, whole.torque)


CSV = RigSignals(csv=Signals(position=Signal("q"), torque=Signal("u"), time=Signal("t")))


def test_a_damaged_row_is_refused_by_its_line_and_salvaged_on_request(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": TIME, "q": POSITION, "u": TORQUE}, metadata={"r": "1"})
    lines = path.read_text().splitlines()
    lines[1001], lines[2001] = "#N/A" + lines[1001][5:], lines[2001] + ",7"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(
        LogError, match=r"run.csv is damaged .* line 1002 begins with '#N/A.* \(and 1 more places"
    ):
        read(path, CSV)
    got = read(path, CSV, salvage=True)
    assert got.time.size == 2998
    assert (got.findings[0].code, got.findings[0].severity) == ("E-DAMAGE", Severity.WITHHOLD)
    assert "line 2002 has 4 cells" in got.findings[0].text
    assert np.array_equal(got.time, np.delete(TIME, [999, 1999]))


def test_a_last_row_that_may_be_cut_is_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": TIME, "q": POSITION, "u": TORQUE})
    path.write_bytes(path.read_bytes()[:-12])
    got = read(path, CSV)
    assert got.time.size == 2999
    assert [(finding.code, finding.severity) for finding in got.findings] == [("E-FILE", Severity.WARN)]
    assert "it may be cut off and was left out" in got.findings[0].text


@pytest.mark.parametrize("unit", ["s", "ns"])
def test_a_date_as_time_costs_no_precision(tmp_path: Path, unit: str) -> None:
    rows = zip(range(3000), POSITION.tolist(), TORQUE.tolist(), strict=True)
    form = "1700000{:06d}000000" if unit == "ns" else "1700000{:03d}.{:03d}5"
    path = tmp_path / "run.csv"
    path.write_text(
        "t,q,u\n" + "".join(f"{_stamp(k, form)},{position!r},{torque!r}\n" for k, position, torque in rows)
    )
    signals = RigSignals(
        csv=Signals(position=Signal("q"), torque=Signal("u"), time=Signal("t", unit=unit, offset=-1.7e9))
    )
    assert np.allclose(read(path, signals).time, TIME, rtol=3e-16, atol=0)


def _stamp(k: int, form: str) -> str:
    return form.format(k) if "06d" in form else form.format(*divmod(k, 1000))


def test_a_field_that_counts_nanoseconds_since_a_date_costs_no_precision(tmp_path: Path) -> None:
    bodies = [
        {"t": 1_700_000_000_000_000_001 + k * 1_000_000, "q": position, "u": torque}
        for k, (position, torque) in enumerate(zip(POSITION.tolist(), TORQUE.tolist(), strict=True))
    ]
    messages = [hostile.message(1, k, json.dumps(body).encode()) for k, body in enumerate(bodies)]
    path = tmp_path / "run.mcap"
    path.write_bytes(hostile.file(hostile.channel(1, 0, "/s", "json"), *messages))
    timed = Signals(position=Signal("/s:q"), torque=Signal("/s:u"), time=Signal("/s:t", unit="ns"))
    assert np.allclose(read(path, RigSignals(mcap=timed)).time, TIME, rtol=3e-16, atol=0)


def _zero_first(path: Path, zeros: int) -> Path:
    """A log whose first messages carry log time 0, as latched ones do."""
    bodies = [{"q": q, "u": u} for q, u in zip(POSITION.tolist(), TORQUE.tolist(), strict=True)]
    stamps = [0 if k < zeros else 1_700_000_000_000_000_000 + k * 1_000_000 for k in range(TIME.size)]
    messages = [
        hostile.message(1, t, json.dumps(body).encode()) for t, body in zip(stamps, bodies, strict=True)
    ]
    path.write_bytes(hostile.file(hostile.channel(1, 0, "/s", "json"), *messages))
    return path


def test_latched_messages_have_no_place_on_the_log_s_clock(tmp_path: Path) -> None:
    signals = RigSignals(mcap=Signals(position=Signal("/s:q"), torque=Signal("/s:u"), clock="log"))
    got = read(_zero_first(tmp_path / "run.mcap", 2), signals)
    assert np.array_equal(got.time, np.arange(2998) / 1000)
    assert np.array_equal(got.torque, TORQUE[2:])
    assert [(finding.code, finding.severity) for finding in got.findings] == [("E-CLOCK", Severity.WARN)]
    assert "2 sample(s) at the start carry time 0" in got.findings[0].text
    whole = read(_zero_first(tmp_path / "run.mcap", 0), signals)
    assert whole.findings == ()


def test_a_clock_that_leaps_years_is_refused(tmp_path: Path) -> None:
    time = TIME.copy()
    time[1500:] += 1.7e9
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": time, "q": POSITION, "u": TORQUE})
    with pytest.raises(LogError, match=r"E-CLOCK refuse: the clock \(column 't'\) jumps ahead by 1.7e\+09 s"):
        read(path, CSV)

"""Inspection: everything about a log with no settings, whole, in part or not at all; none of it trusted."""

import json
import struct
import subprocess
import sys
import tomllib
import tracemalloc
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from rich.console import Console

from data.csv.description import describe
from data.csv.dialect import sniff
from data.csv.log import write_csv
from data.findings import LogError
from data.mcap.writer import write_mcap
from data.parquet.writer import write_parquet
from pipelines.exit_status import Status
from pipelines.inspect import SCHEMA, inspect_log, to_plain
from pipelines.settings.campaign import load_campaign
from pipelines.terminal.inspection import inspect_logs, print_inspection
from tests.data import hostile

TOLD = """
import sys
from pathlib import Path
from pipelines.terminal.inspection import inspect_logs
inspect_logs([Path(sys.argv[1])])
print([name for name in ("numba", "pyarrow", "scipy", "pandas", "google.protobuf") if name in sys.modules])
"""


def test_an_mcap_log_is_told_without_what_it_does_not_need(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    time = np.arange(60_000, dtype=np.float64) * 1e-3
    write_mcap(path, time=time, position=np.sin(time), effort=time, encoding="json", compression="none")
    assert path.stat().st_size > 8 << 20  # what a reader would load compiled code for
    run = subprocess.run([sys.executable, "-c", TOLD, str(path)], capture_output=True, text=True, check=True)
    assert "60000 messages" in run.stdout
    assert run.stdout.splitlines()[-1] == "[]"


def drawn(path: Path) -> str:
    out = StringIO()
    print_inspection(inspect_log(path), Console(file=out, width=110, force_terminal=True, color_system=None))
    return out.getvalue()


def test_an_mcap_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    time = np.arange(5000, dtype=np.float64) * 1e-3
    time[3000:] += 0.25
    write_mcap(
        path,
        time=time,
        position=np.sin(time),
        effort=0 * time,
        extra={"/command": time},
        metadata={"r": "0.9"},
    )
    found = to_plain(inspect_log(path))
    assert found["schema"] == SCHEMA
    assert (found["format"], found["status"], found["simulated"]) == ("mcap", "whole", False)
    assert found["integrity"]["checksums"] == "verified"
    assert found["metadata"]["r"] == "0.9"
    states, command = found["channels"]
    assert (states["topic"], command["topic"]) == ("/joint_states", "/command")
    assert states["schema"] == "sensor_msgs/msg/JointState"
    for clock in (states["log_clock"], states["header_clock"]):
        assert clock["samples"] == 5000
        assert clock["rate"] == pytest.approx(1000.0)
        assert clock["duration"] == pytest.approx(5.249)
        assert clock["gaps"] == 1
        assert clock["longest_gaps"][0] == pytest.approx((2.999, 0.251))
    position = next(f for f in states["fields"] if f["path"] == "position")
    assert list(position["joints"]) == ["link"]
    text = drawn(path)
    for word in ("checksums verified", "1000 Hz", "1 gaps", "/joint_states:position", "[0] {link}", "0.9"):
        assert word in text


def test_a_csv_log(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    time = np.arange(100, dtype=np.float64) * 0.01
    write_csv(path, columns={"t [s]": time, "q [deg]": 3 * time, "i": -time}, metadata={"simulated": "true"})
    found = to_plain(inspect_log(path))
    assert (found["format"], found["status"], found["simulated"], found["rows"]) == (
        "csv",
        "whole",
        True,
        100,
    )
    assert found["dialect"]["delimiter"] == ","
    assert [column["unit"] for column in found["columns"]] == ["s", "deg", None]
    assert found["columns"][1]["high"] == pytest.approx(2.97)
    assert found["clock"]["rate"] == pytest.approx(100.0)
    text = drawn(path)
    for word in ("SIMULATED", "comma between cells", "100 Hz", "q [deg]", "2.97"):
        assert word in text


def test_a_parquet_log(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    time = np.arange(100, dtype=np.float64) * 0.01
    time[60:] += 0.5
    columns = {"time": 1e3 * time, "q": 3 * time, "name": -time}
    write_parquet(path, columns=columns, units={"time": "ms", "q": "deg"}, metadata={"simulated": "true"})
    found = to_plain(inspect_log(path))
    assert (found["format"], found["status"], found["simulated"], found["rows"]) == (
        "parquet",
        "whole",
        True,
        100,
    )
    assert found["integrity"]["checksums"] == "verified"
    assert [column["unit"] for column in found["columns"]] == ["ms", "deg", None]
    assert found["clock_column"] == "time"
    assert found["clock"]["rate"] == pytest.approx(100.0)
    assert (found["clock"]["gaps"], found["clock"]["duration"]) == (1, pytest.approx(1.49))
    text = drawn(path)
    for word in ("SIMULATED", "Parquet", "checksums verified", "100 rows", "100 Hz", "1 gaps", "deg"):
        assert word in text


def test_a_matlab_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    time = np.arange(100, dtype=np.float64) * 0.01
    data = {"t": time, "q": 3 * time, "short": time[:5], "on": time > 0.5}
    scipy.io.savemat(path, {"data": data, "r": 0.9, "note": "\x1b[31mred"})
    found = to_plain(inspect_log(path))
    assert (found["format"], found["status"], found["rows"]) == ("mat", "whole", 100)
    assert found["integrity"]["checksums"] == "absent"
    assert found["metadata"]["r"] == "0.9"
    assert [column["header"] for column in found["columns"]] == ["data.t", "data.q", "data.short", "data.on"]
    assert found["clock"]["rate"] == pytest.approx(100.0)
    text = drawn(path)
    for word in ("MATLAB", "data.q", "2.97", "5 values", "true and false", "100 Hz"):
        assert word in text
    assert "\x1b[31m" not in text


def test_whole_partly_and_not_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, part, none = tmp_path / "whole.mcap", tmp_path / "part.mcap", tmp_path / "none.mcap"
    content = hostile.run(whole, n=20_000)
    part.write_bytes(content[: len(content) // 2])
    none.write_bytes(b"no log")
    assert inspect_logs([whole]) is Status.DONE
    assert inspect_logs([part]) is Status.WITHHELD
    capsys.readouterr()
    assert inspect_logs([none]) is Status.REFUSED
    streams = capsys.readouterr()
    assert streams.out == ""
    assert "does not begin as an MCAP file does" in streams.err
    assert inspect_logs([part], as_json=True) is Status.WITHHELD
    lost = json.loads(capsys.readouterr().out)["integrity"]["lost"]
    assert lost[0]["end"] == len(content) // 2
    assert inspect_logs([whole, part, none], as_json=True) is Status.REFUSED
    answers = json.loads(capsys.readouterr().out)["logs"]
    assert [answer["status"] for answer in answers] == ["whole", "partly readable", "unreadable"]


@pytest.mark.parametrize(
    "name", ["none.mcap", "none.csv", "folder.csv", "empty.csv", "prose.csv", "x.parquet"]
)
def test_what_cannot_be_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "empty.csv").touch()
    (tmp_path / "prose.csv").write_text("this is\nno log\n")
    with pytest.raises(LogError, match=name):
        inspect_log(tmp_path / name)


def test_channels_that_cannot_be_decoded_are_listed_with_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    head = hostile.schema(1, "x.Y", "protobuf", b"") + hostile.channel(1, 1, "/p", "protobuf")
    path.write_bytes(hostile.file(head, hostile.message(1, 1, b"\x08\x01")))
    channel = to_plain(inspect_log(path))["channels"][0]
    assert "protobuf" in channel["refused"]
    assert channel["fields"] == []
    assert "protobuf" in drawn(path)


def test_names_from_a_log_are_only_names(tmp_path: Path) -> None:
    nasty = "/a\x1b]0;owned\x07\x1b[31m[bold red]x[/bold red]\n" + "y" * 5000
    path = tmp_path / "run.mcap"
    head = hostile.schema(1, nasty, "jsonschema", b"") + hostile.channel(1, 1, nasty, "json")
    body = json.dumps({nasty: nasty, "[link=file:///]": 1.0}).encode()
    pair = hostile.text(nasty) * 2
    record = hostile.record(12, hostile.text(nasty) + struct.pack("<I", len(pair)) + pair)
    path.write_bytes(hostile.file(head, hostile.message(1, 1, body), record))
    text = drawn(path)
    assert "\x1b]" not in text
    assert "\x1b[31m" not in text
    assert "\x07" not in text
    assert "[bold red]" in text
    assert len(text) < 20_000
    table = tmp_path / "run.csv"
    table.write_bytes(b"# a\x1b[31m: \x1b[32mb\nt,\x1b[31mq[bold]\n0,1\n1,2\n")
    assert "\x1b[3" not in drawn(table)


def test_a_file_that_is_not_there_is_told_before_its_ending(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="nothere: there is no such file"):
        inspect_log(tmp_path / "nothere")
    (tmp_path / "log.xyz").write_bytes(b"log")
    with pytest.raises(LogError, match="logs are read by their ending"):
        inspect_log(tmp_path / "log.xyz")


@pytest.mark.parametrize(
    ("line", "why"),
    [("0.5,1,2,3", "line 51 has 4 cells"), ("#N/A,1", "line 51 begins with '#N/A'"), (None, "is cut off")],
)
def test_a_table_with_one_damaged_row_is_readable_in_part(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str | None, why: str
) -> None:
    lines = ["t,q", *(f"{0.01 * k:.4f},{0.03 * k * k:.4f}" for k in range(100))]
    if line is not None:
        lines[50] = line
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines)[: None if line else -3])
    assert inspect_logs([path], as_json=True) is Status.WITHHELD
    found = json.loads(capsys.readouterr().out)
    assert (found["status"], found["rows"]) == ("partly readable", 99)
    assert why in found["integrity"]["lost"][0]["why"]
    assert "99 rows" in drawn(path)


def test_a_clock_that_counts_from_a_date_has_its_exact_rate(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(
        "__time,q\n" + "".join(f"{1_700_000_000 + k // 1000}.{k % 1000:03d},0.5\n" for k in range(3000))
    )
    clock = to_plain(inspect_log(path))["clock"]
    assert clock["rate"] == pytest.approx(1000.0, rel=1e-12)
    assert clock["jitter"] < 1e-12
    assert clock["start"] == 1.7e9


def test_the_dialect_that_is_printed_reads_the_log_as_it_was_read(tmp_path: Path) -> None:
    text = "% r: 0.9\nt;q\n[s];[deg]\n" + "".join(f"0,{k};1,{k}\n" for k in range(10, 30))
    (tmp_path / "run.csv").write_bytes(text.encode("utf-16"))
    line = next(line for line in drawn(tmp_path / "run.csv").splitlines() if line.startswith("dialect = "))
    assert tomllib.loads(line)["dialect"] == {
        "delimiter": ";",
        "decimal": ",",
        "encoding": "utf-16",
        "header": True,
        "units_row": True,
        "comment": "%",
        "quote": '"',
        "lines_before_numbers": 3,
    }
    (tmp_path / "campaign.toml").write_text(
        f"""[signals]
position = {{ csv = "q", unit = "deg" }}
torque = {{ csv = "q" }}
{line}
[[experiment]]
protocol = "excitation"
logs = ["run.csv"]
"""
    )
    signals = load_campaign(tmp_path / "campaign.toml").experiments[0].signals.csv
    assert signals is not None
    assert signals.dialect == sniff((tmp_path / "run.csv").read_bytes()).frozen


def test_thirty_megabytes_of_csv_in_a_second_and_a_few_times_the_columns(tmp_path: Path) -> None:
    rows = 400_000
    values = np.random.default_rng(1).normal(size=(rows, 3))
    path = tmp_path / "run.csv"
    columns = {name: values[:, k] for k, name in enumerate("quw")}
    columns = {"t": 1e-3 * np.arange(rows, dtype=np.float64)} | columns
    write_csv(path, columns=columns)
    assert path.stat().st_size > 25e6
    tracemalloc.start()
    describe(np.memmap(path, np.uint8, "r"))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * values.nbytes
    assert min(inspect_log(path).seconds for _ in range(3)) < 3.0  # on a busy machine

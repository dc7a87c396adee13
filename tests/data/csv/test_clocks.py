"""Tables with a clock for each column: each signal is read on its own, and brought onto the position's."""

from pathlib import Path

import numpy as np
import pytest

from data.csv.clocks import governing
from data.csv.dialect import sniff
from data.csv.log import write_csv
from data.findings import LogError, Severity
from data.ingest import read_recording
from data.protocols import ProtocolName
from data.recording import FloatArray, Recording
from data.signals import RigSignals, Signal, Signals

TIME = np.arange(3000, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.sign(np.cos(2 * TIME)) + 0.2 * np.cos(2 * TIME)


def read(
    path: Path,
    signals: Signals | None = None,
    *,
    protocol: ProtocolName = "excitation",
    salvage: bool = False,
) -> Recording:
    named = signals or Signals(position=Signal("q"), torque=Signal("u"))
    return read_recording(
        path,
        log=path.name,
        protocol=protocol,
        signals=RigSignals(csv=named),
        salvage=salvage,
    )


def table(*columns: FloatArray) -> str:
    """Columns of different length; the shorter ones end in empty cells."""
    rows = max(column.size for column in columns)
    return "".join(
        ",".join(repr(float(column[k])) if k < column.size else "" for column in columns) + "\n"
        for k in range(rows)
    )


@pytest.mark.parametrize("named", [None, "time", 0])
def test_simulink_s_signals_stand_on_their_own_clocks(tmp_path: Path, named: str | int | None) -> None:
    path = tmp_path / "run.csv"
    slow = TIME[::10] + 0.0005
    path.write_text(
        "time,q,time,u\n,Unit: rad,,Unit: N m\n,Type: double,,Type: double\n"
        + table(TIME, POSITION, slow, TORQUE[::10])
    )
    time = None if named is None else Signal(named)
    got = read(path, Signals(position=Signal("q"), torque=Signal("u"), time=time))
    assert np.array_equal(got.time, TIME[1:])  # from where the torque has a value
    assert np.array_equal(got.position, POSITION[1:])
    assert np.array_equal(got.torque, np.repeat(TORQUE[::10], 10)[: TIME.size - 1])
    (finding,) = [finding for finding in got.findings if "clock of column 2" in finding.text]
    assert (finding.code, finding.severity) == ("E-CLOCK", Severity.WARN)
    assert "held for up to 0.0095 s, 9.5 position samples" in finding.text
    assert got.metadata["u Unit"] == "N m"
    with pytest.raises(LogError, match=r"column 2 .'time'. is the time of the columns to its right"):
        read(path, Signals(position=Signal("q"), torque=Signal("u"), time=Signal(2)))


def test_signals_sampled_together_need_no_holding(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,q,time,u\n" + table(TIME, POSITION, TIME + 1e-4, TORQUE))
    got = read(path)
    assert np.array_equal(got.torque, TORQUE)
    assert [finding for finding in got.findings if "clock" in finding.text] == []


@pytest.mark.parametrize("epoch", [0, 132_000_000_000_000_000])
def test_twincat_s_columns_have_a_clock_each(tmp_path: Path, epoch: int) -> None:
    ticks = epoch + np.arange(3000) * (10_000 if epoch else 1)
    rows = [
        f"{a};{q!r};{a};{u!r}\n".replace(".", ",")
        for a, q, u in zip(ticks.tolist(), POSITION.tolist(), TORQUE.tolist(), strict=True)
    ]
    head = (
        "Name;C:\\scope.tcscopex\nFile;D:\\run.csv\nStart;132000000000000000\n\n"
        "Name;q;Name;u\nData-Type;LREAL;Data-Type;LREAL\nSampleTime[ms];1;SampleTime[ms];1\n"
        "VariableSize;8;VariableSize;8\nPort;851;Port;851\nUnit;deg;Unit;mNm\n\n"
    )
    path = tmp_path / "run.csv"
    path.write_text(head + "".join(rows))
    layout = sniff(path.read_bytes())
    assert layout.headers == ("time", "q", "time", "u")
    assert layout.units[1::2] == ("deg", "mNm")
    got = read(path, Signals(position=Signal("q", unit="deg"), torque=Signal("u", unit="mN m")))
    assert np.allclose(got.time, TIME, rtol=1e-15, atol=1e-15)
    assert np.allclose(got.position, np.radians(POSITION))
    assert np.allclose(got.torque, 1e-3 * TORQUE)
    assert got.metadata["u Port"] == "851"
    assert got.begun == (pytest.approx(epoch * 1e-7 - 11_644_473_600) if epoch else None)


def test_labview_s_table(tmp_path: Path) -> None:
    head = (
        "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tMulti\nDate\t2024/05/01\n"
        "***End_of_Header***\t\n\t\nChannels\t2\t\t\t\nSamples\t3000\t\t3000\t\n"
        "Y_Unit_Label\tRadians\t\tNm\t\nX0\t0.0\t\t0.0\t\n***End_of_Header***\t\t\t\t\n"
        "X_Value\tq\tX_Value\tu\tComment\n"
    )
    path = tmp_path / "run.lvm"
    path.write_text(head + table(TIME, POSITION, TIME, TORQUE).replace(",", "\t"))
    got = read(path)
    assert np.array_equal(got.torque, TORQUE)
    assert got.metadata["Date"] == "2024/05/01"


def test_a_clock_with_holes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    late = TIME.copy()
    late[1000] = np.nan
    path.write_text("time,q,time,u\n" + table(TIME, POSITION, late, TORQUE))
    with pytest.raises(LogError, match="column 2, a clock, has no time in row 1001"):
        read(path)


def sparse(*, shift: int = 1) -> str:
    """As PlotJuggler writes two topics: a row for every instant of either."""
    torques = zip((TIME[::shift] + 2e-4).tolist(), TORQUE[::shift].tolist(), strict=True)
    rows = [(time, f"{time},{q},,") for time, q in zip(TIME.tolist(), POSITION.tolist(), strict=True)]
    rows += [(time, f"{time},,{u},") for time, u in torques]
    rows += [(time, f"{time},,,1") for time in (TIME[::3] + 3e-4).tolist()]
    return "__time,q,u,other\n" + "\n".join(row for _, row in sorted(rows)) + "\n"


def test_topics_in_rows_of_their_own_are_brought_together(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(sparse())
    got = read(path)
    assert np.allclose(got.time, TIME, atol=1e-12)
    assert np.array_equal(got.position, POSITION)
    assert np.array_equal(got.torque, TORQUE)
    assert not got.findings
    path.write_text(sparse(shift=5))
    got = read(path)
    assert np.array_equal(got.torque, TORQUE[np.maximum(np.arange(1, TIME.size) - 1, 0) // 5 * 5])
    assert "stands in other rows than the position" in next(
        f.text for f in got.findings if f.code == "E-CLOCK"
    )


def test_columns_of_times_govern_those_to_their_right() -> None:
    layout = sniff(b"n,time,q,u,Time,i\n0,0,1,2,0,3\n1,1,1,2,0,3\n")
    assert [governing(layout, k) for k in (2, 3, 5)] == [1, 1, 4]
    beside = sniff(b"timestamp,time,q,u\n0,0,1,2\n1,1,1,2\n")
    assert {governing(beside, k) for k in (2, 3)} == {1}  # a date, and the seconds since
    for names in (b"t,T,q,u", b"time,q,timestamp,u", b"time,q,T [degC],u", b"t,q,time [rad],u"):
        layout = sniff(names + b"\n0,0,1,2\n1,1,1,2\n")
        assert {governing(layout, k) for k in range(1, 4)} == {0}  # times of other names are no other clocks
    assert governing(sniff(b"q,u,t\n0,0,1\n1,1,1\n"), 0) == 2
    assert governing(sniff(b"q,u\n0,0\n1,1\n"), 0) is None


@pytest.mark.parametrize("damage", ["row", "zeros", "empty"])
def test_nothing_joins_what_stands_on_both_sides_of_a_lost_row(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": TIME, "q": POSITION, "u": TORQUE})
    lines = path.read_bytes().split(b"\n")
    lines[1001] = {"row": b"1.0", "zeros": bytes(40), "empty": b",,"}[damage]
    path.write_bytes(b"\n".join(lines))
    got = read(path, salvage=True)
    assert got.breaks == (1000,)
    assert np.array_equal(got.time, np.delete(TIME, 1000))
    assert [part.time.size for part in got.parts()] == [1000, 1999]
    one = read(path, salvage=True, protocol="frequency_response")
    assert (one.time.size, one.breaks) == (1999, ())
    assert any("1 of its 2 parts are used" in finding.text for finding in one.findings)


def test_zeros_at_the_end_cost_nothing_that_was_written(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_csv(path, columns={"t": TIME, "q": POSITION, "u": TORQUE})
    path.write_bytes(path.read_bytes() + bytes(4096))
    with pytest.raises(LogError, match=r"4096 zero bytes at the end.*--salvage. would keep 3000 rows"):
        read(path)
    got = read(path, salvage=True)
    assert np.array_equal(got.torque, TORQUE)
    assert got.breaks == ()
    assert got.findings[0].code == "E-DAMAGE"


def test_a_lost_row_and_a_late_one_leave_one_break(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    time = TIME.copy()
    time[[500, 501]] = time[[501, 500]]
    write_csv(path, columns={"t": time, "q": POSITION, "u": TORQUE})
    lines = path.read_bytes().split(b"\n")
    lines[1001] = b"1.0"
    path.write_bytes(b"\n".join(lines))
    got = read(path, salvage=True)
    assert got.breaks == (1000,)
    assert np.array_equal(got.time, np.delete(TIME, 1000))

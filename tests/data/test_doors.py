"""What every format's door refuses: units that nobody knows, clocks that no rig has."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from data.csv.log import write_csv
from data.findings import LogError
from data.ingest import read_recording
from data.parquet.writer import write_parquet
from data.recording import FloatArray, Recording
from data.signals import RigSignals, Signal, Signals

TIME = np.arange(3000, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.sign(np.cos(2 * TIME)) + 0.2 * np.cos(2 * TIME)
Q, U = Signal("q"), Signal("u")
STAMPS = {"ms": 1.7e12 + 1e3 * TIME, "us": 1.7e15 + 1e6 * TIME, "ns": 1.7e18 + 1e9 * TIME}


def read(path: Path, *, position: Signal = Q, torque: Signal = U, time: Signal | None = None) -> Recording:
    named = Signals(position=position, torque=torque, time=time)
    own = {"csv": RigSignals(csv=named), "parquet": RigSignals(parquet=named), "mat": RigSignals(mat=named)}
    return read_recording(path, log=path.name, protocol="excitation", signals=own[path.suffix[1:]])


def log(path: Path, time: FloatArray, *, header: str = "time", torque: str = "u") -> Path:
    columns = {header: time, "q": POSITION, torque: TORQUE}
    if path.suffix == ".csv":
        write_csv(path, columns=columns)
    elif path.suffix == ".parquet":
        write_parquet(path, columns=columns)
    else:
        scipy.io.savemat(path, columns)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat"])
@pytest.mark.parametrize("word", STAMPS)
def test_stamps_since_1970_in_another_unit_are_no_seconds(tmp_path: Path, suffix: str, word: str) -> None:
    path = log(tmp_path / f"run{suffix}", STAMPS[word])
    with pytest.raises(LogError, match=f'E-UNIT refuse: the time reaches .* years: .* set unit = "{word}"'):
        read(path)
    assert read(path, time=Signal("time", unit=word)).time[-1] == pytest.approx(2.999, abs=1e-4)


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path: Path) -> None:
    path = log(tmp_path / "run.csv", 46_000.0 + TIME / 86_400.0)
    with pytest.raises(LogError, match=r"E-UNIT refuse: the time steps by .* Hz: no rig is sampled so fast"):
        read(path)
    assert read(path, time=Signal("time", unit="days")).time[-1] == pytest.approx(2.999, abs=1e-4)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("header", ["u [Grad]", "u [NM]", "u (dyn*cm)"])
def test_a_declared_unit_that_is_not_known_is_never_taken_for_si(
    tmp_path: Path, suffix: str, header: str
) -> None:
    path = log(tmp_path / f"run{suffix}", TIME, torque=header)
    with pytest.raises(LogError, match=r"E-UNIT refuse: the log declares torque in .* not a unit known here"):
        read(path)
    said = read(path, torque=Signal("u", unit="N m", scale=1e-7))
    assert np.allclose(said.torque, 1e-7 * TORQUE)


def test_a_unit_of_hours_is_read(tmp_path: Path) -> None:
    path = log(tmp_path / "run.csv", np.round(TIME / 3600.0, 12), header="time [h]")
    assert read(path).time[-1] == pytest.approx(2.999, abs=1e-4)


def test_a_struct_with_a_time_of_its_own_is_not_paired_with_another(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    position, torque = Signal("a.q"), Signal("b.u")
    scipy.io.savemat(path, {"a": {"time": TIME, "q": POSITION}, "b": {"time": 2 * TIME, "u": TORQUE}})
    with pytest.raises(LogError, match=r"torque stands beside a time of its own, b\.time, which differs"):
        read(path, position=position, torque=torque)
    named = read(path, position=position, torque=torque, time=Signal("a.time"))
    assert named.time.size == TIME.size
    scipy.io.savemat(path, {"a": {"time": TIME, "q": POSITION}, "b": {"time": TIME, "u": TORQUE}})
    assert np.array_equal(read(path, position=position, torque=torque).torque, TORQUE)

"""MATLAB logs: as scipy reads them, by dotted path; what is no signal by name; every byte suspect."""

import struct
import zlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import scipy.io

from data.findings import LogError
from data.ingest import read_recording
from data.mat.log import MatLog
from data.recording import FloatArray
from data.signals import RigSignals, Signal, Signals

TIME = np.arange(3000, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.cos(2 * TIME)
SIGNALS = RigSignals(mat=Signals(position=Signal("data.q"), torque=Signal("data.i", unit="A", scale=0.5)))
STRUCTS = np.array(
    [(1.0, np.arange(5.0)), (2.0, np.arange(6.0))], dtype=[("gain", object), ("values", object)]
)


def saved(variables: dict[str, Any], *, compressed: bool = True, **options: Any) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mat"
        scipy.io.savemat(path, variables, do_compression=compressed, **options)
        return path.read_bytes()


def as_scipy_reads(content: bytes, name: str) -> FloatArray:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mat"
        path.write_bytes(content)
        return np.asarray(scipy.io.loadmat(path)[name], np.float64).ravel()


def opened(content: bytes) -> MatLog:
    return MatLog(np.frombuffer(content, np.uint8))


def column(log: MatLog, source: str) -> FloatArray:
    place = log.find(source)
    return log.read([place]).values[place].floats()


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(name: str, *, class_: int = 6, shape: tuple[int, ...], data: bytes) -> bytes:
    head = element(6, struct.pack("<II", class_, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, head + element(1, name.encode()) + data)


def file_of(*variables: bytes) -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + b"".join(variables)


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("oned_as", ["row", "column"])
def test_a_recording_of_a_struct(tmp_path: Path, compressed: bool, oned_as: str) -> None:
    variables = {
        "t": TIME[:7],  # of something else
        "data": {"time": TIME, "q": POSITION, "i": 2 * TORQUE, "r": 0.9},
        "simulated": "true",
    }
    path = tmp_path / "run.mat"
    path.write_bytes(saved(variables, compressed=compressed, oned_as=oned_as))
    got = read_recording(path, log="run.mat", protocol="excitation", signals=SIGNALS)
    assert np.array_equal(got.time, TIME)
    assert np.array_equal(got.position, POSITION)
    assert np.array_equal(got.torque, TORQUE)
    assert got.simulated
    assert got.metadata["r"] == got.metadata["data.r"] == "0.9"
    assert got.findings == ()
    assert opened(path.read_bytes()).integrity.checksums == ("verified" if compressed else "absent")


@pytest.mark.parametrize("kind", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8"])
def test_every_type_reads_as_scipy_reads_it(kind: str) -> None:
    values = (np.arange(100) - 40 * (kind[0] != "u")).astype(kind)
    content = saved({"q": values})
    assert np.array_equal(column(opened(content), "q"), as_scipy_reads(content, "q"))


def test_doubles_that_are_stored_as_small_integers_or_in_the_other_byte_order() -> None:
    small = matrix("q", shape=(1, 3), data=struct.pack("<HH4b", 1, 3, -1, 0, 7, 0))
    assert column(opened(file_of(small)), "q").tolist() == [-1.0, 0.0, 7.0]
    values = [0.25, -3.5]
    body = struct.pack(">IIII", 6, 8, 6, 0) + struct.pack(">IIii", 5, 8, 2, 1)
    body += struct.pack(">HH", 1, 1) + b"q\0\0\0" + struct.pack(">II2d", 9, 16, *values)
    swapped = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(">H", 0x0100) + b"MI"
    content = swapped + struct.pack(">II", 14, len(body)) + body
    assert column(opened(content), "q").tolist() == values
    assert as_scipy_reads(content, "q").tolist() == values


def test_columns_of_a_matrix_and_arrays_of_structs() -> None:
    log = opened(saved({"log": np.stack((TIME, POSITION), axis=1), "out": {"signals": STRUCTS}}))
    assert np.array_equal(column(log, "log[1]"), POSITION)
    assert column(log, "out.signals[1].values").tolist() == [0, 1, 2, 3, 4, 5]
    assert log.metadata["out.signals[0].gain"] == "1.0"
    with pytest.raises(LogError, match=r"'log' is an array of 2 columns; say which.*log\[0\], log\[1\]"):
        log.find("log")


def test_the_time_is_the_one_beside_the_position() -> None:
    log = opened(saved({"t": TIME, "a": {"q": POSITION, "b": {"q": POSITION, "time": TIME}}, "tout": TIME}))
    found = {name: log.plain_time(name) for name in ("a.b.q", "a.q", "q")}
    named = {name: None if k is None else log.columns[k].name for name, k in found.items()}
    assert named == {"a.b.q": "a.b.time", "a.q": "t", "q": "t"}


@pytest.mark.parametrize(
    ("value", "what"),
    [
        (np.array([True, False]), "true and false"),
        (np.array([1j, 2.0]), "complex numbers"),
        (np.array([1, "x"], dtype=object), "a cell array"),
        (np.zeros((2, 3, 4)), "an array of 2 x 3 x 4 numbers"),
        (np.zeros((0, 0)), "nothing"),
        (np.array(["ab", "cd"]), "text"),
    ],
)
def test_what_is_no_signal_is_refused_by_name(value: Any, what: str) -> None:
    with pytest.raises(LogError, match=f"'q' is no column of numbers: it holds {what}"):
        column(opened(saved({"q": value})), "q")


def test_objects_are_never_built() -> None:
    words = b"".join(element(1, word) for word in (b"ts", b"MCOS", b"timeseries"))
    opaque = element(14, element(6, struct.pack("<II", 17, 0)) + words)
    with pytest.raises(LogError, match=r"'ts' .*object of class timeseries, which only MATLAB can read"):
        column(opened(file_of(opaque)), "ts")


def test_one_value_is_no_signal_and_lengths_must_agree(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(saved({"t": TIME, "data": {"q": POSITION[:-1], "i": TORQUE}}))
    with pytest.raises(LogError, match=r"position \(data.q\) has 2999 values, the time \(t\) 3000"):
        read_recording(path, log="run.mat", protocol="excitation", signals=SIGNALS)
    with pytest.raises(LogError, match="'r' is one value, no signal"):
        opened(saved({"r": 0.9})).find("r")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n", "save -v7"),
        (struct.pack("<5i", 0, 1, 1, 0, 2) + b"q\0" + bytes(200), "no MAT-file of version 5"),
        (b"no log", "no MAT-file of version 5"),
    ],
)
def test_other_versions_are_named_with_the_remedy(content: bytes, why: str) -> None:
    with pytest.raises(LogError, match=why):
        opened(content)


def test_a_damaged_variable_is_lost_and_the_others_stand(tmp_path: Path) -> None:
    content = bytearray(saved({"data": {"time": TIME, "q": POSITION, "i": TORQUE}, "other": POSITION**2}))
    content[-100] ^= 4
    path = tmp_path / "run.mat"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"is damaged at bytes .*--salvage` would keep 3 arrays"):
        read_recording(path, log="run.mat", protocol="excitation", signals=SIGNALS)
    got = read_recording(path, log="run.mat", protocol="excitation", signals=SIGNALS, salvage=True)
    assert np.array_equal(got.position, POSITION)
    assert [finding.code for finding in got.findings] == ["E-DAMAGE"]


def test_bombs_and_lies_are_refused_before_they_take_memory() -> None:
    zeros = zlib.compress(struct.pack("<II", 14, 1 << 28) + bytes(1 << 28))
    lies = {
        "unpack to 268435456": struct.pack("<II", 15, len(zeros)) + zeros,
        "are claimed, 8 bytes are there": matrix("q", shape=(1 << 30, 1 << 30), data=element(9, bytes(8))),
        "reaches past the end": struct.pack("<II", 14, 0xFFFFFFF0) + bytes(64),
        "of type 99 stands": element(99, bytes(8)),
    }
    for why, variable in lies.items():
        (loss,) = opened(file_of(variable)).integrity.losses
        assert why in loss.why
    nested = element(14, b"")
    for _ in range(5000):
        names = struct.pack("<HHi", 5, 4, 2) + element(1, b"a\0")
        nested = matrix("", class_=2, shape=(1, 1), data=names + nested)
    assert [c.refused for c in opened(file_of(nested)).columns] == ["a workspace of functions"]
    named = matrix("deep", class_=2, shape=(1, 1), data=names + nested)
    assert [c.refused for c in opened(file_of(named)).columns] == ["structs nested too deep"]


@pytest.mark.parametrize("compressed", [True, False])
def test_every_cut_and_many_mutants_are_ours(compressed: bool) -> None:
    content = saved(
        {"t": TIME[:90], "data": {"q": POSITION[:90], "s": STRUCTS}, "c": np.array([1, "x"], dtype=object)},
        compressed=compressed,
    )
    generator = np.random.default_rng(7)
    truth = {"t": TIME[:90], "data.q": POSITION[:90]}
    for trial in range(2000):
        mutant = bytearray(content)
        place = int(generator.integers(128, len(mutant)))
        if trial % 3 == 0:
            del mutant[place:]
        elif trial % 3 == 1:
            mutant[place] ^= 1 << int(generator.integers(8))
        else:
            mutant[place : place + 4] = (b"\xff\xff\xff\x7f", bytes(4))[trial % 2]
        log = opened(bytes(mutant))
        numeric = [k for k, c in enumerate(log.columns) if c.refused is None]
        for place, values in log.read(numeric).values.items():
            wanted = truth.get(log.columns[place].name)
            if compressed and wanted is not None:
                assert np.array_equal(values.floats(), wanted)

"""Parquet logs: numbers as stored, what is no number by name, damage proved, nothing unpacked on trust."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from data.findings import LogError, Severity
from data.ingest import read_recording
from data.parquet.log import ParquetLog
from data.parquet.writer import write_parquet
from data.recording import FloatArray
from data.signals import RigSignals, Signal, Signals

TIME = np.arange(3000, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.cos(2 * TIME)
SIGNALS = RigSignals(parquet=Signals(position=Signal("q"), torque=Signal("i")))


def written(columns: Mapping[str, Any], **options: Any) -> bytes:
    sink = BytesIO()
    pq.write_table(pa.table(dict(columns)), sink, **options)
    return sink.getvalue()


def opened(content: bytes) -> ParquetLog:
    return ParquetLog(np.frombuffer(content, np.uint8))


def column(log: ParquetLog, source: str | int) -> FloatArray:
    place = log.find(source)
    return log.read([place]).values[place].floats()


@settings(max_examples=40, deadline=None)
@given(arrays(np.float64, st.integers(1, 60)))
def test_every_number_survives_bit_for_bit(values: FloatArray) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.parquet"
        write_parquet(path, columns={"t": values, "q": -values}, units={"q": "rad"}, metadata={"r": "0.9"})
        log = opened(path.read_bytes())
        table = pq.read_table(path)
    assert column(log, "t").tobytes() == values.tobytes()
    assert column(log, 1).tobytes() == (-values).tobytes()
    assert log.columns[1].unit == "rad"
    assert log.metadata == {"r": "0.9"}
    assert log.read([0]).integrity.checksums == "verified"
    assert table.column("t").to_numpy().tobytes() == values.tobytes()  # the ecosystem's own reader


@pytest.mark.parametrize("kind", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8"])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": "gzip", "data_page_version": "2.0"},
        {"compression": "none", "use_dictionary": False, "row_group_size": 50},
        {"compression": "brotli", "use_dictionary": False, "write_page_checksum": True},
    ],
)
def test_every_type_of_numbers_under_every_writer(kind: str, options: dict[str, Any]) -> None:
    values = (np.arange(120) % 100).astype(kind)
    assert np.array_equal(column(opened(written({"q": values}, **options)), "q"), values.astype(np.float64))


def test_nothing_is_missing_but_what_is_missing() -> None:
    log = opened(written({"q": pa.array([1, None, 3], pa.int64()), "f": pa.array([None, 0.5, np.nan])}))
    assert np.array_equal(column(log, "q"), [1.0, np.nan, 3.0], equal_nan=True)
    assert np.array_equal(column(log, "f"), [np.nan, 0.5, np.nan], equal_nan=True)


@pytest.mark.parametrize(
    ("values", "what"),
    [
        ([True, False], "true and false"),
        (["1.0", "2.0"], "values of type string"),
        ([[1.0], [2.0]], "nested values"),
        ([{"x": 1.0}, {"x": 2.0}], "nested values"),
        ([b"1", b"2"], "values of type binary"),
        ([None, None], "values of type null"),
        (pa.array([1, 2], pa.decimal128(5, 2)), "values of type decimal128"),
        (pa.array(["a", "b"]).dictionary_encode(), "values of type dictionary"),
    ],
)
def test_what_is_no_number_is_refused_by_name(values: Any, what: str) -> None:
    with pytest.raises(LogError, match=rf"'q' is no column of numbers: it holds {what}"):
        column(opened(written({"q": values})), "q")


def test_an_integer_that_no_float_holds_is_refused() -> None:
    log = opened(written({"n": np.array([2**53, 2**53 + 1]), "m": np.array([2**62, -(2**62)])}))
    with pytest.raises(LogError, match="holds the integer 9007199254740993 in row 2"):
        column(log, "n")
    assert np.array_equal(column(log, "m"), [2.0**62, -(2.0**62)])


def test_columns_are_found_by_name_without_unit_and_number() -> None:
    log = opened(written({"t [s]": [0.0], "q [deg]": [1.0], "q.x": [2.0]}))
    assert [log.find("q [deg]"), log.find("q"), log.find("q.x"), log.find(0)] == [1, 1, 2, 0]
    assert [c.unit for c in log.columns] == ["s", "deg", None]
    with pytest.raises(LogError, match=r"no column 'w'; the log has"):
        log.find("w")
    with pytest.raises(LogError, match="no column number 3; the log has 3"):
        log.find(3)
    twice = pa.Table.from_arrays([pa.array([1.0]), pa.array([2.0])], names=["q", "q"])
    sink = BytesIO()
    pq.write_table(twice, sink)
    for source in ("q", 1):
        with pytest.raises(LogError, match="columns are called 'q'"):
            opened(sink.getvalue()).find(source)


def test_a_recording_of_a_pandas_frame_with_stamps(tmp_path: Path) -> None:
    frame = pd.DataFrame({"q": POSITION, "i": TORQUE})
    frame.index = pd.DatetimeIndex(
        1_700_000_000_000_000_000 + (TIME * 1e9).round().astype(np.int64), tz="UTC"
    )
    frame.attrs = {"r": 0.9, "simulated": "true", "nested": {"x": 1}}
    frame.to_parquet(tmp_path / "run.parquet")
    got = read_recording(tmp_path / "run.parquet", log="run.parquet", protocol="excitation", signals=SIGNALS)
    assert np.array_equal(got.time, (TIME * 1e9).round() / 1e9)
    assert np.array_equal(got.position, POSITION)
    assert got.begun == pytest.approx(1.7e9)
    assert got.simulated
    assert got.metadata == {"r": "0.9", "simulated": "true"}
    assert got.findings == ()


def test_a_unit_that_the_file_contradicts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    write_parquet(path, columns={"t": TIME, "q": POSITION, "i": TORQUE}, units={"q": "deg"})
    with pytest.raises(LogError, match=r"run\.parquet: E-UNIT refuse: the log declares position in 'deg'"):
        read_recording(path, log="run.parquet", protocol="excitation", signals=SIGNALS)


def test_a_damaged_row_group_is_lost_and_the_others_stand(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    content = bytearray(
        written(
            {"t": TIME, "q": POSITION, "i": TORQUE},
            row_group_size=1000, use_dictionary=False, write_page_checksum=True,
        )
    )  # fmt: skip
    whole = opened(bytes(content))
    begin, end = whole.groups[1].span(len(content))
    content[(begin + end) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"checksum is wrong.*--salvage` would keep 2000 rows in 2 intact"):
        read_recording(path, log="run.parquet", protocol="excitation", signals=SIGNALS)
    got = read_recording(path, log="run.parquet", protocol="excitation", signals=SIGNALS, salvage=True)
    assert any(f.code == "E-DAMAGE" and f.severity is Severity.WITHHOLD for f in got.findings)
    assert set(got.position.tolist()) <= set(POSITION[np.r_[:1000, 2000:3000]].tolist())


def test_a_row_group_of_no_rows_is_none() -> None:
    table = pa.table({"t": TIME, "q": TIME})
    sink = BytesIO()
    with pq.ParquetWriter(sink, table.schema) as writer:
        for part in (table[:0], table[:1000], table[:0], table[1000:]):
            writer.write_table(part)
    log = opened(sink.getvalue())
    assert np.array_equal(column(log, "q"), TIME)
    assert log.read([0]).integrity.whole
    assert column(opened(written({"t": TIME[:0]})), "t").size == 0


def test_two_columns_of_one_name_are_told_and_the_others_stand() -> None:
    sink = BytesIO()
    pq.write_table(pa.table([TIME, TIME, POSITION], names=["t", "q", "q"]), sink)
    log = opened(sink.getvalue())
    assert np.array_equal(column(log, "t"), TIME)
    assert "one of several columns of that name" in str(log.columns[1].refused)
    with pytest.raises(LogError, match="2 columns are called 'q'"):
        column(log, "q")


def test_a_footer_that_lies_is_refused() -> None:
    content = written({"q": POSITION}, write_page_checksum=True)
    with pytest.raises(LogError, match="stops before its footer"):
        opened(content[:-10])
    with pytest.raises(LogError, match="does not begin as a Parquet file does"):
        opened(b"PK" + content[2:])
    with pytest.raises(LogError, match="its footer claims 4294967295 bytes"):
        opened(content[:-8] + b"\xff" * 4 + b"PAR1")


def test_a_bomb_takes_no_memory() -> None:
    bomb = written(
        {"q": np.zeros(12_000_000)}, compression="zstd", use_dictionary=False, data_page_size=1 << 30
    )
    assert len(bomb) < 100_000
    with pytest.raises(LogError, match="its footer claims 12000000 rows in"):
        opened(bomb)


def test_every_cut_and_many_mutants_are_refused_or_proved() -> None:
    """pyarrow itself ends the process on some of these."""
    content = written(
        {"t": TIME[:200], "q": POSITION[:200]},
        write_page_checksum=True,
        use_dictionary=False,
        row_group_size=90,
    )
    generator = np.random.default_rng(5)
    truth = {"t": TIME[:200], "q": POSITION[:200]}
    for trial in range(1500):
        mutant = bytearray(content)
        place = int(generator.integers(len(mutant)))
        if trial % 3 == 0:
            del mutant[place:]
        elif trial % 3 == 1:
            mutant[place] ^= 1 << int(generator.integers(8))
        else:
            mutant[place : place + 4] = b"\xff\xff\xff\x7f"
        try:
            log = opened(bytes(mutant))
            places = [k for k, c in enumerate(log.columns) if c.refused is None]
            read = log.read(places)
        except LogError:
            continue
        if not read.integrity.losses and len(mutant) == len(content):
            for place in places:
                wanted = truth.get(log.columns[place].name)
                assert wanted is None or np.array_equal(read.values[place].floats(), wanted)
        assert all(isinstance(text, str) for text in log.metadata.values())

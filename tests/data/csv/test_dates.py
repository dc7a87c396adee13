"""Dates and times of day as the time: exact to the digit, and never guessed."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data.csv.cells import NotNumbersError
from data.csv.dates import TimeCells, kind_of
from data.csv.description import describe
from data.findings import LogError
from data.ingest import read_recording
from data.recording import Recording
from data.signals import RigSignals, Signal, Signals

MOMENTS = st.datetimes(datetime(1970, 1, 2), datetime(2261, 1, 1))  # as on a wall
TIME = np.arange(3000, dtype=np.float64) * 4e-3
POSITION = np.rint(np.sin(2 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.sign(np.cos(2 * TIME)) + 0.2 * np.cos(2 * TIME)


def written(*cells: str, decimal: str = ".") -> list[str]:
    return list(TimeCells("," if decimal == "," else ".").read(pa.array(cells)).to_pylist())


@settings(max_examples=300, deadline=None)
@given(MOMENTS, st.sampled_from([None, 0, 120, -330]), st.integers(0, 999), st.sampled_from([".", ","]))
def test_every_moment_in_every_way(moment: datetime, zone: int | None, nanoseconds: int, sign: str) -> None:
    aware = moment.replace(tzinfo=timezone(timedelta(minutes=zone or 0)))
    since = aware - datetime(1970, 1, 1, tzinfo=UTC)
    exact = since.days * 86_400 + since.seconds + Decimal(since.microseconds * 1000 + nanoseconds) / 10**9
    offset = aware.strftime("%z")
    end = "" if zone is None else "Z" if zone == 0 else f"{offset[:3]}:{offset[3:]}"
    clock = f"{moment:%H:%M:%S}{sign}{moment.microsecond:06d}{nanoseconds:03d}"
    days = (f"{moment.year:04d}-{moment:%m-%d}", f"{moment.day}.{moment.month}.{moment.year:04d}")
    for day in (*days, days[0].replace("-", "/"), f"{moment.day:02d}-{moment:%b}-{moment.year:04d}"):
        for text in (f"{day} {clock}{end}", f"{day}T{clock}{end}", f" {day} {clock} {end}"):
            assert kind_of(text.strip()) == ("date" if zone is None else "zoned")
            (cell,) = written(text, decimal=sign)
            assert Decimal(cell.replace(",", ".")) == exact


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [
        ("09:00:00.5", "32400.5"),
        ("9:00:00", "32400"),
        ("23:59:59,999999999", "86399.999999999"),
        ("0 days 00:00:01.5", "1.5"),
        ("3 days 00:00:00", "259200"),
    ],
)
def test_times_of_day_are_seconds_since_midnight(cell: str, seconds: str) -> None:
    assert Decimal(written(cell)[0]) == Decimal(seconds)


def test_what_is_missing_stays_missing() -> None:
    assert written("2024-05-01 00:00:00", "", "NaN") == ["1714521600.000000000", "", "NaN"]
    cells = TimeCells(".")
    assert cells.read(pa.array(["", "nan"])).to_pylist() == ["", "nan"]  # a block that says nothing
    assert cells.read(pa.array(["", "2024-05-01"])).to_pylist() == ["", "1714521600.000000000"]
    assert cells.dated
    numbers = TimeCells(".")
    assert numbers.read(pa.array(["", "3.5", "2024-05-01"])).to_pylist() == ["", "3.5", "2024-05-01"]
    assert not numbers.dated


def test_midnight_passes() -> None:
    cells = TimeCells(".")
    first = cells.read(pa.array(["23:59:58", "", "23:59:59", "00:00:00.5"])).to_pylist()
    second = cells.read(pa.array(["12:00:00", "23:00:00", "01:00:00"])).to_pylist()
    seconds = [float(cell) for cell in (*first, *second) if cell]
    assert seconds == [86_398, 86_399, 86_400.5, 129_600, 169_200, 176_400]
    back = TimeCells(".").read(pa.array(["12:00:01", "12:00:00", "11:00:00"])).to_pylist()
    assert [float(cell) for cell in back] == [43_201, 43_200, 39_600]  # a clock that was set is no midnight


@pytest.mark.parametrize(
    ("cells", "row", "why"),
    [
        (["2024-05-01", "2024-02-30"], 1, "no such date"),
        (["25:00:00"], 0, "no such date"),
        (["2024-05-01 10:00:00", "2024-05-01 10:00:01Z"], 1, "of another form"),
        (["", "2024-05-01 10:00:00+02:00", "2024-05-01 10:00:01"], 2, "of another form"),
        (["2024-05-01 10:00:00", "10:00:01"], 1, "of another form"),
        (["2024-05-01", "3"], 1, "no date, as the others are"),
        (["1960-01-01"], 0, "before 1970"),
    ],
)
def test_what_is_no_date_is_told_with_its_row(cells: list[str], row: int, why: str) -> None:
    with pytest.raises(NotNumbersError) as told:
        written(*cells)
    assert (told.value.row, told.value.cell) == (row, cells[row])
    assert why in told.value.why


def log(path: Path, cells: list[str], header: str = "time,q,u") -> Path:
    rows = zip(cells, POSITION.tolist(), TORQUE.tolist(), strict=True)
    path.write_text(header + "\n" + "".join(f"{cell},{q},{u}\n" for cell, q, u in rows))
    return path


def moments(form: str = "%Y-%m-%d %H:%M:%S.%f") -> list[str]:
    begin = datetime(2026, 5, 1, 12, 0, 0)  # as on a wall
    return [(begin + timedelta(milliseconds=4 * k)).strftime(form) for k in range(TIME.size)]


def read(path: Path, time: Signal | None = None) -> Recording:
    named = Signals(position=Signal("q"), torque=Signal("u"), time=time)
    return read_recording(path, log=path.name, protocol="excitation", signals=RigSignals(csv=named))


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%H:%M:%S.%f"])
def test_a_log_with_dates_is_read_as_one_with_seconds(tmp_path: Path, form: str) -> None:
    dated = read(log(tmp_path / "dates.csv", moments(form)))
    plain = read(log(tmp_path / "plain.csv", [f"{value:.3f}" for value in TIME.tolist()]))
    np.testing.assert_allclose(dated.time, plain.time, rtol=0, atol=1e-12)
    assert np.array_equal(dated.position, plain.position)
    shown = describe(log(tmp_path / "shown.csv", moments(form)).read_bytes())
    assert shown.clock is not None
    assert shown.clock.period == pytest.approx(4e-3)
    assert shown.columns[0].unit == "s"


def test_dates_are_seconds_whatever_else_is_said(tmp_path: Path) -> None:
    path = log(tmp_path / "run.csv", moments())
    for time in (Signal("time", unit="ms"), Signal("time", scale=1e-3)):
        with pytest.raises(LogError, match="dates or times of day, which are read as seconds"):
            read(path, time)
    assert read(path, Signal("time", unit="s")).time.size == TIME.size
    with pytest.raises(LogError, match="which are read as seconds"):
        read(log(tmp_path / "unit.csv", moments(), "time [ms],q,u"))


def test_a_date_elsewhere_says_what_to_do(tmp_path: Path) -> None:
    path = log(tmp_path / "run.csv", moments(), "Datum,q,u")
    shown = describe(path.read_bytes())
    assert "name it as the time" in str(shown.columns[0].text)
    assert read(path, Signal("Datum")).time.size == TIME.size
    slashes = log(tmp_path / "slashes.csv", moments("%m/%d/%Y %H:%M:%S.%f"))
    with pytest.raises(LogError, match="day and month may be taken for each other"):
        read(slashes)


def test_a_clock_that_turns_to_numbers_is_refused(tmp_path: Path) -> None:
    cells = moments()
    cells[2000:] = [f"{value:.3f}" for value in TIME[2000:].tolist()]
    path = log(tmp_path / "run.csv", cells)
    with pytest.raises(
        LogError, match=r"line 2 holds '2026-05-01 12:00:00.000000' where the rows below it hold"
    ):
        read(path)
    cells[1000:] = [f"{value:.3f}" for value in TIME[1000:2900].tolist()] + cells[:100]
    path = log(tmp_path / "mixed.csv", cells)
    with pytest.raises(LogError, match=r"holds '4\.000' in row 1001 of the numbers: no date, as the others"):
        read(path)


@pytest.mark.parametrize("cell", ["00:05", "12:00:00:123", "20260501T120000", "01.05.26 12:00:00"])
def test_what_could_be_two_times_is_none(cell: str) -> None:
    assert kind_of(cell) == "number"
    content = f"time,q,u\n{cell},1,2\n{cell},2,3\n".encode()
    assert "a form that is not read" in str(describe(content).columns[0].text)

"""Any dialect gives the numbers that were written; what cannot be right is refused by name."""

from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from data.csv.dialect import sniff
from data.csv.log import elapsed, find_column, read_csv, write_csv
from data.findings import LogError
from data.recording import FloatArray
from data.signals import CsvDialect

ROWS = [[0.001 * k, -1.5e-3 * k + 0.25, 12.0 * k] for k in range(30)]


def read(content: bytes, dialect: CsvDialect | None = None) -> tuple[tuple[str, ...], FloatArray]:
    layout = sniff(content, dialect)
    table = read_csv(content, layout, range(layout.columns))
    return layout.headers, np.stack(list(table.values.values()), axis=1)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
@pytest.mark.parametrize(
    ("delimiter", "decimal"),
    [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("  ", "."), (" ", ",")],
)
def test_the_dialect_matrix(delimiter: str, decimal: str, encoding: str) -> None:
    for header, comment, ending, power in product(
        (True, False), (True, False), ("\n", "\r\n"), (True, False)
    ):
        lines = ["# operator: Jürgen", "# r: 0.95"] if comment else []
        lines += [delimiter.join(("t", "q_°", "i"))] if header else []
        show = "{:.6e}" if power else "{:.6f}"
        lines += [delimiter.join(show.format(x).replace(".", decimal) for x in row) for row in ROWS]
        content = (ending.join(lines) + ending).encode(encoding)
        headers, values = read(content)
        assert np.allclose(values, ROWS, rtol=0, atol=1e-6)
        assert headers == (("t", "q_°", "i") if header else ())
        expected = {"operator": "Jürgen", "r": "0.95"} if comment else {}
        assert sniff(content).metadata == expected


@settings(max_examples=60, deadline=None)
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 40), st.just(2)),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    )
)
def test_every_number_survives_bit_for_bit(values: FloatArray) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        write_csv(path, columns={"t [s]": values[:, 0], "q": values[:, 1]}, metadata={"simulated": "true"})
        content = path.read_bytes()
    headers, got = read(content)
    assert headers == ("t [s]", "q")
    assert np.array_equal(got.view(np.int64), values.view(np.int64))
    assert sniff(content).metadata == {"simulated": "true"}


@pytest.mark.parametrize(
    ("text", "headers", "units"),
    [
        ("t,q,i\ns,deg,A\n0,1,2\n1,2,3\n", ("t", "q", "i"), ("s", "deg", "A")),
        ("t;q;i\n[s];[rad];[mN m]\n0;1;2\n1;2;3\n", ("t", "q", "i"), ("s", "rad", "mN m")),
        (
            "t [ms],q (deg),speed_rpm\n0,1,2\n1,2,3\n",
            ("t [ms]", "q (deg)", "speed_rpm"),
            ("ms", "deg", "rpm"),
        ),
        ("t [ms],q (left),i [-]\n0,1,2\n1,2,3\n", ("t [ms]", "q (left)", "i [-]"), ("ms", None, None)),
        ("# t q\n0.1 2\n0.2 3\n", ("t", "q"), (None, None)),
        ('"t","q, deg"\n"1.0","2.0"\n3,4\n', ("t", "q, deg"), (None, None)),
        (
            "__time,/js/link/position\n1700000000.001,0.1\n1700000000.002,0.2\n",
            ("__time", "/js/link/position"),
            (None, None),
        ),
    ],
)
def test_headers_and_declared_units(
    text: str, headers: tuple[str, ...], units: tuple[str | None, ...]
) -> None:
    layout = sniff(text.encode())
    assert layout.headers == headers
    assert layout.units == units


def test_columns_by_header_by_bare_header_and_by_number() -> None:
    layout = sniff(b"t [s],q [deg],q [rad],7\n0,1,2,3\n1,2,3,4\n")
    assert find_column(layout, "q [rad]") == 2
    assert find_column(layout, "t") == 0
    assert find_column(layout, 3) == 3
    assert find_column(layout, "7") == 3
    for source, why in (
        ("q", "2 columns are called"),
        ("u", "no column 'u'; the log has"),
        (9, "no column number 9"),
    ):
        with pytest.raises(LogError, match=why):
            find_column(layout, source)
    assert find_column(sniff(b"1,2\n3,4\n"), "1") == 1
    with pytest.raises(LogError, match="no header, so columns go by number"):
        find_column(sniff(b"1,2\n3,4\n"), "q")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "empty"),
        (b"\n\n", "empty"),
        (b"hello world\nthis is prose\n", "row of numbers"),
        (b"t,q\n", "row of numbers"),
        (b"t,q\n1,2\n1,abc\n", "column 'q' holds 'abc' in row 2"),
        (
            b"t,q\n" + b"1,2\n" * 99 + b"1,2,3\n" * 1500 + b"1,2\n" * 999,
            "line 101 has 3 cells, the others 2.*over 999 more",
        ),
        (b"\x00\x01\x02\x00\xff" * 99, "row of numbers"),
        (b"t,q\n2020-01-01T00:00:00,1.0\n2020-01-01T00:00:01,2.0\n", "column 't' holds '2020"),
    ],
)
def test_what_cannot_be_right_is_refused(content: bytes, why: str) -> None:
    with pytest.raises(LogError, match=why):
        read(content)


def test_a_frozen_dialect_is_obeyed() -> None:
    content = b"1,5\n2,5\n3,5\n"
    assert read(content)[1].tolist() == [[1, 5], [2, 5], [3, 5]]
    frozen = CsvDialect(delimiter=";", decimal=",")
    assert read(content, frozen)[1].tolist() == [[1.5], [2.5], [3.5]]


def test_what_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    column = np.arange(3.0)
    with pytest.raises(LogError, match="control character"):
        write_csv(tmp_path / "a.csv", columns={"q\n": column})
    with pytest.raises(LogError, match="control character"):
        write_csv(tmp_path / "a.csv", columns={"q": column}, metadata={"a": "x\x1b[31m"})
    with pytest.raises(LogError, match="differ in shape"):
        write_csv(tmp_path / "a.csv", columns={"t": column, "q": column[:2]})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("quoted", [True, False])
def test_a_decimal_comma_inside_quotes_is_none_between_cells(quoted: bool) -> None:
    rows = [("0,001", "0,3003"), ("0,002", "-1,5e-3"), ("0,003", "0,3")]
    cells = [[f'"{cell}"' if quoted else cell for cell in row] for row in rows]
    content = ("\n".join(",".join(row) for row in [["t", "q"], *cells]) + "\n").encode()
    if not quoted:
        with pytest.raises(LogError, match=r"line 1 names 2 columns .* have 4 cells"):
            read(content)
        return
    headers, values = read(content)
    assert headers == ("t", "q")
    assert values.tolist() == [[0.001, 0.3003], [0.002, -1.5e-3], [0.003, 0.3]]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(1, 10**7), min_size=2, max_size=30),
    st.integers(0, 9),
    st.sampled_from([0, 17, 1_700_000_000, 1_700_000_000_123_456_789]),
)
def test_time_is_exact_to_the_text_whatever_it_counts_from(steps: list[int], places: int, start: int) -> None:
    ticks = [start * 10**places + int(tick) for tick in np.cumsum(steps)]
    texts = [f"{tick}" if places == 0 else _decimal(tick, places) for tick in ticks]
    for quote, decimal, delimiter in (("", ".", ","), ("", ",", ";"), ('"', ",", ",")):
        lines = [f"{quote}{text.replace('.', decimal)}{quote}{delimiter}0" for text in texts]
        content = ("t" + delimiter + "q\n" + "\n".join(lines) + "\n").encode()
        table = read_csv(content, sniff(content), [0], clocks=[0])
        for begin in (0, 1):
            got = elapsed(table, 0, begin=begin)
            exact = np.array([(tick - ticks[begin]) / 10**places for tick in ticks[begin:]])
            step = np.median(np.diff(exact)) if exact.size > 1 else exact[0]
            assert np.all(np.abs(got - exact) <= 1e-9 * step + 1e-15 * exact)


def _decimal(tick: int, places: int) -> str:
    whole, rest = divmod(tick, 10**places)
    return f"{whole}.{rest:0{places}d}"


def test_a_stamp_that_is_missing_stays_missing_among_exact_ones() -> None:
    content = b"t,q\n1700000000.001,0\n,0\n1700000000.003,0\nnan,0\n1700000000.0041,1\n"
    got = elapsed(read_csv(content, sniff(content), [0], clocks=[0]), 0)
    assert np.array_equal(got, [0.0, np.nan, 0.002, np.nan, 0.0031], equal_nan=True)

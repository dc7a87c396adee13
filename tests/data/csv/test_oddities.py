"""What rigs and their tools write into CSV files: read as it was meant, or refused by what is wrong."""

import gzip
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data.csv.dialect import sniff
from data.csv.layout import CsvLayout
from data.csv.log import read_csv, table_integrity
from data.csv.text import line_bounds, lines
from data.findings import LogError
from data.recording import FloatArray
from data.signals import CsvDialect

NAN = float("nan")
TRUTH = [[round(0.001 * k, 6), round(0.5 - 0.013 * k, 6), round(-1.5 + 0.07 * k * k, 6)] for k in range(12)]


def table(
    head: str = "t,q,u\n",
    rows: list[list[float]] = TRUTH,
    *,
    delimiter: str = ",",
    decimal: str = ".",
    show: str = "{:.6f}",
    end: str = "\n",
    tail: str = "",
) -> str:
    """The truth in one dialect."""
    body = "".join(
        delimiter.join(show.format(x).replace(".", decimal) for x in row) + tail + end for row in rows
    )
    return head + body


def read(content: bytes, frozen: CsvDialect | None = None) -> tuple[CsvLayout, FloatArray]:
    """Every column of a file of which nothing is damaged."""
    layout = sniff(content, frozen)
    found = read_csv(content, layout, range(layout.columns))
    table_integrity(found).require("run.csv", salvage=False)
    return layout, np.stack([found.values[k] for k in range(layout.columns)], axis=1)


GERMAN = table("t;q;u\n", delimiter=";", decimal=",")
TEXT = "t,q,note\n" + "".join(
    f"{k},{2 * k},{word}\n" for k, word in enumerate(["a", "b c", "d#e", '"f,g"', "h"])
)

READ_RIGHT = {
    "plain": table().encode(),
    "byte order mark": table().encode("utf-8-sig"),
    "utf-16 with mark": table().encode("utf-16"),
    "utf-16 big end first with mark": b"\xfe\xff" + table().encode("utf-16-be"),
    "utf-16 without mark": table().encode("utf-16-le"),
    "utf-16 big end first": table().encode("utf-16-be"),
    "utf-16 with CRLF": table(end="\r\n", head="t,q,u\r\n").encode("utf-16"),
    "latin-1": table("# Prüfstand °\nt,q,u\n").encode("latin-1"),
    "utf-8 names": table("# Prüfstand °\nt,q,u\n").encode(),
    "CRLF": table("t,q,u\r\n", end="\r\n").encode(),
    "CR": table("t,q,u\r", end="\r").encode(),
    "mixed line ends": table("t,q,u\r\n", TRUTH[:6]).encode() + table("", TRUTH[6:], end="\r").encode(),
    "form feed in the header": table("t,q,u\x0c\n").encode(),
    "vertical tab in a comment": table("# rig\x0bnote\nt,q,u\n").encode(),
    "file separators in a comment": table("# a\x1cb\x1dc\x1ed\nt,q,u\n").encode(),
    "NEL in latin-1": table("# rig\x85note\nt,q,u\n").encode("latin-1"),
    "line separator of unicode": table("# rig\u2028note\u2029\nt,q,u\n").encode(),
    "semicolons": table("t;q;u\n", delimiter=";").encode(),
    "tabs": table("t\tq\tu\n", delimiter="\t").encode(),
    "blanks": table("t q u\n", delimiter="   ").encode(),
    "decimal comma, semicolons": GERMAN.encode(),
    "decimal comma, tabs": table("t\tq\tu\n", delimiter="\t", decimal=",").encode(),
    "decimal comma with exponent": table("t;q;u\n", delimiter=";", decimal=",", show="{:.12e}").encode(),
    "decimal comma, blanks": table("t q u\n", delimiter=" ", decimal=",").encode(),
    "exponent in capitals": table(show="{:.12E}").encode(),
    "plus signs": table(show="{:+.6f}").encode(),
    "blanks around cells": table("t, q, u\n", delimiter=" , ").encode(),
    "aligned with blanks": table(show="{:14.6f}").encode(),
    "quoted cells": table('"t","q","u"\n', show='"{:.6f}"').encode(),
    "quoted decimal comma between commas": table('"t","q","u"\n', decimal=",", show='"{:.6f}"').encode(),
    "a blank before quotes": table('"t", "q", "u"\n', delimiter=", ", show='"{:.6f}"').encode(),
    "sep= in the first line": table("sep=;\nt;q;u\n", delimiter=";").encode(),
    "a blank line above and below": table("\n\nt,q,u\n", end="\n\n").encode(),
    "blank lines of blanks": table(end="\n   \n").encode(),
    "no line end at the end": table().rstrip("\n").encode(),
    "comments": table("# r: 0.9\n% other\nt,q,u\n").encode(),
    "comments between rows": table(end="\n# marker, pressed\n").encode(),
    "comments behind rows": table("# c\nt,q,u\n", tail=" # fine, so far").encode(),
    "slashes for comments": table("// r: 0.9\nt,q,u\n", end="\n// note\n").encode(),
    "a commented header": table("# t q u\n", delimiter=" ").encode(),
    "units in a row": table("t,q,u\ns,rad,N m\n").encode(),
    "units in brackets": table("t [s],q [rad],u [N m]\n").encode(),
    "units of one in a row": table("t,q,u\ns,1,1\n").encode(),
    "a labelled unit row": table("t,q,u\nUnit:,rad,N m\n").encode(),
    "metadata rows": table("Operator: Jo\nDate;2024-05-01\nt;q;u\n", delimiter=";").encode(),
    "a title": table("Bench 3\nt,q,u\n").encode(),
    "settings of Simulink": table("t,q,u\n,Unit: rad,Unit: N m\n,Type: double,Type: double\n").encode(),
    "a line end in a header": table('"t\n[s]",q,u\n').encode(),
    "CRLF in a header": table('"t\r\n[s]","q\r\n[rad]",u\r\n', end="\r\n").encode(),
    "names of numbers in quotes": table('"t","q, deg","u"\n').encode(),
    "names with quotes inside": table('t,"the ""q""",u\n').encode(),
    "a huge comment": table("# " + "x" * 300_000 + "\nt,q,u\n").encode(),
    "names above units between blanks": table("t [s] q [rad] u [N m]\n", delimiter=" ").encode(),
    "PlotJuggler": table("__time,/js/link/position,/js/link/effort\n").encode(),
    "LabVIEW": table(
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
        "***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t12\t12\t\nX_Dimension\tTime\tTime\t\nX0\t0,0\t0,0\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tq\tu\tComment\n",
        delimiter="\t",
        decimal=",",
    ).encode(),
}


@pytest.mark.parametrize("name", READ_RIGHT)
def test_what_is_meant_is_read(name: str) -> None:
    layout, values = read(READ_RIGHT[name])
    assert np.array_equal(values, np.array(TRUTH))
    assert len(layout.headers) == 3
    again, same = read(READ_RIGHT[name], layout.frozen)  # and with everything frozen that was found
    assert np.array_equal(values, same)
    assert (again.headers, again.units, again.first_row) == (layout.headers, layout.units, layout.first_row)


VALUES: dict[str, tuple[bytes, list[list[float]]]] = {
    "headerless": (table("").encode(), TRUTH),
    "one row": (b"t,q\n0.5,1.5\n", [[0.5, 1.5]]),
    "one column": (b"q\n1\n2\n3\n", [[1], [2], [3]]),
    "one column, decimal comma": (b"q\n1,5\n2,5\n", [[1, 5], [2, 5]]),
    "the largest": (b"t,q\n1,1e308\n2,-1.7976931348623157e308\n", [[1, 1e308], [2, -1.7976931348623157e308]]),
    "the smallest": (b"t,q\n1,5e-324\n2,1e-400\n", [[1, 5e-324], [2, 0.0]]),
    "NaN and infinity": (
        b"t,q,u\n1,NaN,2\n2,inf,3\n3,-Infinity,4\n4,,5\n",
        [[1, NAN, 2], [2, np.inf, 3], [3, -np.inf, 4], [4, NAN, 5]],
    ),
    "Microsoft's NaN": (b"t,q\n1,1.#QNAN\n2,-1.#IND\n3,-1.#INF\n", [[1, NAN], [2, NAN], [3, -np.inf]]),
    "words for nothing": (b"t,q\n1,NA\n2,null\n3,N/A\n4,4\n", [[1, NAN], [2, NAN], [3, NAN], [4, 4]]),
    "an empty column": (b"t,q,u\n1,,3\n2,,4\n", [[1, NAN, 3], [2, NAN, 4]]),
    "a delimiter behind every row": (b"t,q,\n1,2,\n3,4,\n", [[1, 2, NAN], [3, 4, NAN]]),
    "a delimiter behind the names only": (b"t,q,\n1,2\n3,4\n", [[1, 2], [3, 4]]),
    "a line end in a cell of words": (b't,q,u\n1,2,3\n4,"",6\n7,8,9\n', [[1, 2, 3], [4, NAN, 6], [7, 8, 9]]),
    "points without digits": (b"t,q\n.5,1.\n-.5,+2.\n", [[0.5, 1], [-0.5, 2]]),
    "seventeen digits": (
        b"t,q\n0.1,0.30000000000000004\n2,0.10000000000000000555111512312\n",
        [[0.1, 0.1 + 0.2], [2, 0.1]],
    ),
    "stamps of 19 digits": (
        b"t,q\n1700000000123456789,1\n1700000000223456789,2\n",
        [[1700000000123456789, 1], [1700000000223456789, 2]],
    ),
    "negative zero": (b"t,q\n1,-0.0\n2,0\n", [[1, -0.0], [2, 0.0]]),
    "lines of commas at the end": (b"t,q\n1,2\n3,4\n,\n,\n", [[1, 2], [3, 4]]),
}


@pytest.mark.parametrize("name", VALUES)
def test_values_are_what_is_written(name: str) -> None:
    content, truth = VALUES[name]
    values = read(content)[1]
    assert np.array_equal(values, np.array(truth, np.float64), equal_nan=True)
    assert (
        np.array_equal(np.signbit(values), np.signbit(np.array(truth, np.float64))) or np.isnan(truth).any()
    )


REFUSED = {
    "nothing": (b"", "empty"),
    "only line ends": (b"\r\n\r\n", "empty"),
    "only a header": (b"t,q,u\n", "looks like a row of numbers"),
    "prose": (b"the rig\nran well\n", "looks like a row of numbers"),
    "rubbish": (bytes(range(256)) * 40, "row of numbers"),
    "random bytes": (np.random.default_rng(1).bytes(20_000), "row of numbers"),
    "zeros": (bytes(4096), "empty"),
    "gzip": (gzip.compress(table().encode()), "compressed by gzip"),
    "an Excel workbook": (b"PK\x03\x04" + bytes(100), "Excel workbook"),
    "an MCAP log": (b"\x89MCAP0\r\n" + bytes(100), "an MCAP log"),
    "UTF-32": (table().encode("utf-32"), "UTF-32"),
    "a decimal comma between commas": (table(decimal=",").encode(), "line 1 names 3 columns .* have 6 cells"),
    "names for fewer columns": (table("q,u\n").encode(), "line 1 names 2 columns"),
    "names for more columns": (table("t,q,u,v\n").encode(), "line 1 names 4 columns"),
    "a lost cell": (table().replace("0.487000,", "", 1).encode(), "line 3 has 2 cells, the others 3"),
    "a won cell": (table().replace("0.487000,", "0,487000,", 1).encode(), "line 3 has 4 cells, the others 3"),
    "True": (b"t,q\n1,2\n2,True\n3,4\n", "column 'q' holds 'True' in row 2 of the numbers: no number"),
    "only True": (b"t,q,ok\n1,2,True\n2,3,True\n3,4,False\n", "column 'ok' holds 'True' in row 1"),
    "too large": (b"t,q\n1,2\n2,1e400\n", "holds '1e400' in row 2 .* beyond the largest"),
    "a thousands separator": (b't;q\n1;"1,234.5"\n2;3.5\n3;4.5\n', "line 2 holds '1,234.5' where"),
    "thousands with points": (b"t;q\n1,5;1.234,5\n2,5;3,5\n3,5;4,5\n", "line 2 holds '1.234,5' where"),
    "thousands with blanks": (b"t;q\n1,5;1 234,5\n2,5;3,5\n3,5;4,5\n", "line 2 holds '1 234,5' where"),
    "hexadecimal": (b"t,q\n1,2\n2,0x1F\n3,4\n", "holds '0x1F' in row 2"),
    "an underscore": (b"t,q\n1,2\n2,1_000\n3,4\n", "holds '1_000' in row 2"),
    "two signs": (b"t,q\n1,2\n2,--3\n3,4\n", "holds '--3' in row 2"),
    "a unit behind a number": (b"t,q\n1,2 deg\n2,3\n3,4\n", "line 2 holds '2 deg'|holds '2 deg' in row 1"),
    "digits of another script": ("t,q\n1,2\n2,٣\n3,4\n".encode(), "holds '٣' in row 2"),
    "dates as time": (b"t,q\n2024-01-01T00:00:00,1\n2024-01-01T00:00:01,2\n", "column 't' holds '2024"),
    "times of day": (b"t,q,u\n00:00:01,1,2\n00:00:02,2,3\n", "column 't' holds '00:00:01'"),
    "a column of words": (b"t,q,state\n1,2,on\n2,3,off\n", "column 'state' holds 'on' in row 1"),
    "numbers among the names": (b"t,1,2\n0,1,2\n1,2,3\n2,3,4\n", "line 1 holds 't' where the rows below"),
    "a quote that is not closed": (
        table().replace("0.487000", '"0.487000', 1).encode(),
        "line 3 .*quotation mark",
    ),
    "a quote inside a cell": (
        table().replace("0.487000", '0.4"87000', 1).encode(),
        "column 'q' holds '0.4\"87000' in row 2",
    ),
    "rows inside quotes": (
        table().replace("0.487000", '"0.487000', 1).replace("0.448000,", '0.448000",', 1).encode(),
        "holds '0.448000\"' in row 4",
    ),
    "zeros at the end": (table().encode() + bytes(512), r"512 zero bytes at the end.*12 rows"),
    "zeros between rows": (
        table("t,q,u\n", TRUTH[:6]).encode() + bytes(64) + b"\n" + table("", TRUTH[6:]).encode(),
        "line 8 holds zero bytes",
    ),
    "a row that reads like a comment": (
        table().replace("0.001000", "#N/A").replace("t,", "# x\nt,", 1).encode(),
        "begins with '#N/A'",
    ),
    "a first row that reads like a comment": (
        table().replace("0.000000", "#N/A", 1).encode(),
        "line 2 begins with '#N/A'",
    ),
    "a first row with a lost cell": (table("t,q,u\n0.5\n").encode(), "line 2 has 1 cells, the others 3"),
    "a first row of zeros": (b"t,q,u\n" + bytes(30) + table("\n").encode(), "line 2 holds zero bytes"),
    "a cut row": (table().encode()[:-12], "last line is cut off"),
    "a cut number": (table(show="{:.9f}").encode()[:-4], "last number is cut off"),
    "a huge quoted cell": (
        b't,q,note\n1,2,"' + b"x" * 200_000 + b'"\n3,4,"y"\n5,6,"z"\n',
        r"a row with a quotation mark cannot be taken apart \(field larger",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_by_name(name: str) -> None:
    content, why = REFUSED[name]
    with pytest.raises(LogError, match=why):
        read(content)
    for frozen in (CsvDialect(delimiter=",", decimal="."), CsvDialect(header=True), CsvDialect(quote="")):
        try:
            read(content, frozen)
        except LogError:
            continue
        assert name in {"names for fewer columns", "names for more columns", "numbers among the names"} or (
            frozen.quote == ""
        )


def test_words_beside_numbers_harm_no_number() -> None:
    layout = sniff(TEXT.encode())
    found = read_csv(TEXT.encode(), layout, [0, 1])
    assert found.values[1].tolist() == [0, 2, 4, 6, 8]
    assert found.rows.losses == ()


def test_a_huge_cell_of_words_harms_no_number() -> None:
    content = b"t,q,note\n1,2,a\n3,4," + b"x" * 400_000 + b"\n5,6,c\n"
    assert read_csv(content, sniff(content), [0, 1]).values[1].tolist() == [2, 4, 6]


@pytest.mark.parametrize("quote", ["", '"'])
def test_names_that_stand_again_take_the_run_apart(quote: str) -> None:
    def line(*cells: object) -> str:
        return ",".join(f"{quote}{cell}{quote}" for cell in cells) + "\n"

    head = line("time", "q", "tau")
    rows = [line(k, 2 * k, -k) for k in range(3000)]
    content = (head + "".join(rows[:1000]) + head + "".join(rows[1000:]) + head).encode()
    found = read_csv(content, sniff(content), [0, 1, 2])
    assert np.array_equal(found.values[1], 2.0 * np.arange(3000))
    assert found.rows.breaks == (1000,)
    assert found.rows.losses == ()
    assert "the names stand again in line 1002, 3003: recordings were joined" in found.rows.notes[0]


@pytest.mark.parametrize(("delimiter", "sign"), [("\t", ","), (";", ","), (";", ".")])
def test_thousands_are_no_decimals(delimiter: str, sign: str) -> None:
    def written(value: int) -> str:
        return f"{value:,}".replace(",", sign)

    rows = "".join(f"{k}{delimiter}{written(k + 980)}{delimiter}7\n" for k in range(300))
    content = f"t{delimiter}q{delimiter}u\n{rows}".encode()
    with pytest.raises(LogError, match=f"'1\\{sign}000' in row 21 .* may part thousands"):
        read_csv(content, sniff(content), [1])
    trimmed = "".join(f"{k}{delimiter}{str(k / 8).replace('.', sign)}\n" for k in range(8, 300))
    exact = f"t{delimiter}q\n{trimmed}".replace(f"{sign}0\n", "\n").encode()
    assert read_csv(exact, sniff(exact), [1]).values[1].tolist() == [k / 8 for k in range(8, 300)]


def test_words_and_dates_beside_few_numbers() -> None:
    content = b"Date,Time,Status,q,u\n" + b"".join(
        b"2026-05-01,12:00:00.%03d,RUN,%d.5,-%d.5\n" % (k, k, k) for k in range(100)
    )
    found = read_csv(content, sniff(content), [1, 3, 4], clocks=[1])
    assert np.allclose(found.values[1], 43_200 + 1e-3 * np.arange(100))
    assert found.values[4].tolist() == [-k - 0.5 for k in range(100)]


def test_line_ends_in_quoted_words() -> None:
    for end in ("\n", "\r\n"):
        rows = "".join(f'{k},{2 * k},"first{end}second, ""{k}"""{end}' for k in range(5000))
        content = f"t,q,note{end}{rows}".encode()
        found = read_csv(content, sniff(content), [0, 1])
        assert np.array_equal(found.values[1], 2.0 * np.arange(5000))
        assert found.rows.losses == ()


def test_ten_thousand_columns() -> None:
    values = np.arange(30_000, dtype=np.float64).reshape(3, 10_000)
    names = ",".join(f"channel_{k}" for k in range(10_000))
    content = (names + "\n" + "\n".join(",".join(map(str, row)) for row in values.tolist()) + "\n").encode()
    layout, got = read(content)
    assert layout.headers[-1] == "channel_9999"
    assert np.array_equal(got, values)


def test_two_columns_of_one_name_are_told_apart_by_number() -> None:
    layout, values = read(b"t,q,q\n0,1,2\n1,2,3\n")
    assert layout.headers == ("t", "q", "q")
    assert values[:, 2].tolist() == [2, 3]


def test_metadata_and_units_are_kept() -> None:
    head = (
        "# r: 0.9\nBench 3\nOperator: Jo\nDate,2024-05-01\nt,q,u\n,Unit: deg,Unit: N m\nType:,REAL,LREAL\n"
        ",Interp: zoh,Interp: linear\n"
    )
    layout, values = read(table(head).encode())
    assert np.array_equal(values, np.array(TRUTH))
    assert layout.units == (None, "deg", "N m")
    assert layout.metadata == {
        "r": "0.9",
        "line 2": "Bench 3",
        "Operator": "Jo",
        "Date": "2024-05-01",
        "Type": "REAL, LREAL",
        "q Unit": "deg",
        "u Unit": "N m",
        "q Interp": "zoh",
        "u Interp": "linear",
    }


def test_a_frozen_dialect_decides_what_looking_cannot() -> None:
    content = b"1,2,3\n0,1,2\n1,2,3\n"
    assert read(content)[0].headers == ()
    layout, values = read(content, CsvDialect(header=True))
    assert layout.headers == ("1", "2", "3")
    assert values.shape == (2, 3)
    quoted = table("t,q,u\n", show="'{:.6f}'", decimal=",").encode()
    assert np.array_equal(read(quoted, CsvDialect(quote="'", decimal=",", delimiter=","))[1], np.array(TRUTH))
    inches = b'name,t,q\n5" shaft,1,2\n6" shaft,3,4\n'
    found = read_csv(inches, sniff(inches, CsvDialect(quote="")), [1, 2])
    assert (found.values[1].tolist(), found.rows.losses) == ([1, 3], ())
    layout, values = read(b"t,q\n5,m\n0,1\n1,2\n", CsvDialect(units_row=True, lines_before_numbers=2))
    assert (layout.units, values.tolist()) == ((None, "m"), [[0, 1], [1, 2]])
    layout, values = read(b"q,u\n0,1\n", CsvDialect(header=False))
    assert (layout.headers, values.tolist()) == ((), [[0, 1]])
    with pytest.raises(LogError, match=r"line 2 is a row of numbers.*lines_before_numbers"):
        read(table().encode(), CsvDialect(lines_before_numbers=3))
    with pytest.raises(LogError, match="cannot be read as utf-9"):
        read(b"1,2\n", CsvDialect(encoding="utf-9"))
    with pytest.raises(LogError, match="not one ASCII character"):
        CsvDialect(delimiter="ab")


DIALECTS = st.tuples(
    st.sampled_from(
        [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("whitespace", "."), ("|", ".")]
    ),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.booleans(),  # quotes
    st.booleans(),  # a header
    st.booleans(),  # a comment
    st.booleans(),  # units in a row
    st.sampled_from([repr, "{:.17g}".format, "{:.16e}".format, "{:+.17E}".format]),
)


@settings(max_examples=150)
@given(
    st.integers(2, 5).flatmap(
        lambda columns: st.lists(
            st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=columns, max_size=columns),
            min_size=1,
            max_size=30,
        )
    ),
    DIALECTS,
)
def test_any_table_in_any_dialect_comes_back_bit_for_bit(
    rows: list[list[float]],
    dialect: tuple[tuple[str, str], str, str, bool, bool, bool, bool, object],
) -> None:
    (delimiter, decimal), encoding, end, quotes, header, comment, units, show = dialect
    between = " " if delimiter == "whitespace" else delimiter
    quote = '"' if quotes else ""
    columns = len(rows[0])
    head = ["# r: 0.9"] if comment else []
    head += [between.join(f"name{k}" for k in range(columns))] if header else []
    head += [between.join(["s", "rad", "A", "V", "N"][:columns])] if header and units else []
    body = [between.join(quote + show(x).replace(".", decimal) + quote for x in row) for row in rows]  # type: ignore[operator]
    content = (end.join(head + body) + end).encode(encoding)
    frozen = CsvDialect(delimiter=delimiter, decimal=decimal, encoding=encoding)  # type: ignore[arg-type]
    layout, values = read(content, frozen)
    assert np.array_equal(values.view(np.int64), np.array(rows).view(np.int64))
    assert bool(layout.headers) is header
    assert layout.metadata == ({"r": "0.9"} if comment else {})
    assert np.array_equal(read(content, layout.frozen)[1].view(np.int64), values.view(np.int64))


@settings(max_examples=200)
@given(st.text(alphabet="a,\r\n\x0b\x0c\x1c\x85\u2028", max_size=40), st.sampled_from(["utf-8", "latin-1"]))
def test_there_is_one_way_to_split_lines(text: str, encoding: str) -> None:
    content = text.encode(encoding, errors="ignore")
    split = lines(content)
    assert b"".join(split) == content
    if content:
        begins, stops = line_bounds(content)
        assert [content[begin:stop] for begin, stop in zip(begins, stops, strict=True)] == split


@settings(max_examples=300)
@given(st.binary(max_size=300), st.integers(0, 300), st.integers(0, 400))
def test_no_bytes_raise_anything_but_a_log_error(insert: bytes, begin: int, end: int) -> None:
    content = TEXT.encode() + table("").encode()
    mutant = content[:begin] + insert + content[end:]
    with suppress(LogError):
        read(mutant)

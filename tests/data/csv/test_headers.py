"""What stands above the numbers of real tools' files: names, units, and what is neither."""

import pytest

from data.csv.dialect import sniff
from data.findings import LogError

NUMBERS = "".join(f"{k},{k + 0.5},{-k},{2 * k}\n" for k in range(30))


@pytest.mark.parametrize(
    ("above", "names", "units"),
    [
        ("t,q,u,T\ns,rad,N m,°C\n", "t,q,u,T", ("s", "rad", "N m", "°C")),
        ("t,q,u,T\ns,rad,N m,%\n", "t,q,u,T", ("s", "rad", "N m", "%")),
        ("t,q,u,a\ns,rad,N m,n/a\n", "t,q,u,a", ("s", "rad", "N m", None)),
        ("Time,q,u,x\nUTC,rad,N m,-\n", "Time,q,u,x", ("UTC", "rad", "N m", None)),
        ('"TIME","Ch1","Ch2","Ch3"\n"in s","in V","in V","in A"\n', "TIME,Ch1,Ch2,Ch3", ("s", "V", "V", "A")),
        ("t,q,u,x\n# s,rad,N m,V\n", "t,q,u,x", ("s", "rad", "N m", "V")),
        ("# t,q,u,x\n# s,rad,N m,V\n", "t,q,u,x", ("s", "rad", "N m", "V")),
        ("t,q,u,x\n,,,\n", "t,q,u,x", (None,) * 4),
        ("t,q,u,x\nREAL,REAL,LREAL,BOOL\n", "t,q,u,x", (None,) * 4),
        ("t,q,u,x\nf8,f8,f8,f8\ns,rad,Nm,V\n", "t,q,u,x", ("s", "rad", "Nm", "V")),
        ("t,q,u,x\ns,rad,Nm,V\nabs,rel,rel,rel\n", "t,q,u,x", ("s", "rad", "Nm", "V")),
        ("t,q,u,x\ns,rad,Nm,V\n1000 Hz,1000 Hz,1000 Hz,10 Hz\n", "t,q,u,x", ("s", "rad", "Nm", "V")),
        ("TOA5,CR1000\nTIME,N,q,u\nTS,RN,rad,N m\n,,Avg,Avg\n", "TIME,N,q,u", ("TS", "RN", "rad", "N m")),
        ("name,t,q,u\ntrace_values,,,\n", "name,t,q,u", (None,) * 4),
        ("u1,u2,i1,i2\n", "u1,u2,i1,i2", (None,) * 4),  # names, though they look like types
        ("s,A,V,x\n", "s,A,V,x", (None,) * 4),  # names, though they look like units
    ],
)
def test_names_and_units(above: str, names: str, units: tuple[str | None, ...]) -> None:
    layout = sniff((above + NUMBERS).encode())
    assert layout.headers == tuple(names.split(","))
    assert layout.units == units
    assert layout.first_row == above.count("\n")


def test_a_delimiter_behind_every_row_makes_no_name_wrong() -> None:
    content = "t;q;u\n" + "".join(f"{k};{k + 0.5};{-k};\n" for k in range(30))
    assert sniff(content.encode()).headers == ("t", "q", "u", "")
    with pytest.raises(LogError, match="names 3 columns"):
        sniff(content.replace("-3;", "-3;7").encode())


def test_units_that_are_not_known_and_open_rows_come_together() -> None:
    rows = "".join(f"27.11.2026 23:59:{k + 10},5;{k},5;-{k},25;\n" for k in range(30))
    content = "# speed: 1\nZeit;Winkel;Moment\nUhr;arcmin;N·mm\nREAL;REAL;REAL\n" + rows
    layout = sniff(content.encode("latin-1"))
    assert layout.headers == ("Zeit", "Winkel", "Moment", "")
    assert layout.units == ("Uhr", "arcmin", "N·mm", None)
    assert layout.metadata["speed"] == "1"


def test_labview_s_units_are_those_of_its_channels() -> None:
    head = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\n"
    head += "Channels\t2\nY_Unit_Label\tdeg\tN m\nDelta_X\t0.001\t0.001\n***End_of_Header***\n"
    rows = "".join(f"{k}\t{k + 0.5}\t{-k}\n" for k in range(30))
    layout = sniff((head + "X_Value\tq\tu\tComment\n" + rows).encode())
    assert (layout.headers, layout.units) == (("X_Value", "q", "u"), (None, "deg", "N m"))


def test_labview_s_segments_are_refused_by_name() -> None:
    head = "LabVIEW Measurement\nSeparator\tTab\n***End_of_Header***\n"
    segment = "Channels\t1\n***End_of_Header***\nX_Value\tq\n" + "".join(f"{k}\t{-k}\n" for k in range(30))
    assert sniff((head + segment).encode()).headers == ("X_Value", "q")
    with pytest.raises(LogError, match="several segments: another header ends in line 38"):
        sniff((head + segment + segment).encode())


def test_a_preamble_of_words_and_numbers_is_no_row() -> None:
    preamble = "Model,DPO4054\nHorizontal Units,S,\nSample Interval,1e-3,\nAttenuation,1,1\nLabel,,\n"
    rows = "".join(f"{k},{k + 0.5},{-k}\n" for k in range(300))
    layout = sniff((preamble + "TIME,CH1,CH2\n" + rows).encode())
    assert (layout.headers, layout.first_row) == (("TIME", "CH1", "CH2"), 6)
    assert layout.metadata["Sample Interval"] == "1e-3"


@pytest.mark.parametrize("names", ["t,q,u,T\n", "\n", "\nsecond part\nt,q,u,T\n"])
def test_a_table_above_the_table_is_not_lost_unseen(names: str) -> None:
    above = "t,q,u\n" + "".join(f"{k},{k + 0.5},{-k}\n" for k in range(3))
    with pytest.raises(LogError, match=r"rows of 3 numbers, .* has rows of 4: two tables|names 3 columns"):
        sniff((above + names + NUMBERS).encode())

import csv
import io
import math

import pytest

from ident.model import published
from pipelines.report.numerals import shown_interval, shown_number, shown_percent
from pipelines.report.tables import table1_csv, table1_entries, table1_markdown, table1_tex, table1_text
from tests.pipelines.report import examples


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_number_of_the_csv_reads_back_bit_for_bit() -> None:
    robot = examples.robot()
    robot["positive"]["coulomb_torque"]["value"] = 0.1 + 0.2
    rows = {(row["parameter"], row["direction"]): row for row in _rows(table1_csv(robot))}
    assert len(rows) == 1 + 5 * 3
    assert float(rows["coulomb_torque", "positive"]["value"]) == 0.1 + 0.2
    assert rows["static_torque", "positive"]["high95"] == ""  # an open end
    assert float(rows["inertia", ""]["value"]) == 0.026
    assert rows["stribeck_shape", "positive"]["fixed"] == "true"


def test_the_paper_stands_beside_with_unrounded_means() -> None:
    rows = {(row["parameter"], row["direction"]): row for row in _rows(table1_csv(examples.robot()))}
    assert float(rows["stribeck_velocity", "mean"]["paper"]) == 0.5 * (0.0688 + 0.0817)
    assert float(rows["coulomb_torque", "mean"]["paper"]) == 0.5 * (0.3990 + 0.3887)
    assert float(rows["static_torque", "positive"]["paper"]) == published.POSITIVE.static_torque


def test_a_linear_axis_has_no_paper_beside_it() -> None:
    entries = table1_entries(dict(examples.robot(), axis="linear"))
    assert all(entry.paper is None for entry in entries)


def test_what_is_withheld_has_its_reason_and_no_number() -> None:
    robot = examples.robot()
    withheld = next(e for e in table1_entries(robot) if e.withheld)
    assert (withheld.parameter, withheld.direction, withheld.value) == ("stribeck_velocity", "negative", None)
    row = next(r for r in _rows(table1_csv(robot)) if r["withheld"])
    assert row["value"] == ""
    assert "E-LOWSPEED" in row["withheld"]
    assert "E-LOWSPEED" in table1_markdown(robot)
    assert "withheld" in table1_tex(robot)


def test_a_parameter_that_the_file_lacks_is_withheld() -> None:
    robot = examples.robot()
    del robot["mean"], robot["positive"]["static_torque"]
    lacking = [(e.parameter, e.direction) for e in table1_entries(robot) if e.withheld == "not in the file"]
    assert ("static_torque", "positive") in lacking
    assert ("viscous_damping", "mean") in lacking


@pytest.mark.parametrize("start", ["=cmd()", "+1+1", "-2", "@SUM(A1)"])
def test_no_text_cell_is_a_formula(start: str) -> None:
    robot = examples.robot()
    robot["negative"]["stribeck_velocity"]["withheld"] = start
    robot["positive"]["viscous_damping"]["value"] = -0.08  # a number, which no apostrophe may touch
    rows = _rows(table1_csv(robot))
    assert [row["withheld"] for row in rows if row["direction"] == "negative" and row["withheld"]] == [
        "'" + start
    ]
    damping = next(r for r in rows if (r["parameter"], r["direction"]) == ("viscous_damping", "positive"))
    assert float(damping["value"]) == -0.08


def test_the_terminal_shows_the_paper_beside_a_virtual_rig_alone() -> None:
    virtual = table1_text(dict(examples.robot(), simulated=True), truth=examples.truth())
    assert virtual[0].split()[-2:] == ["paper", "truth"]
    assert "0.5735" in "\n".join(virtual)
    real = table1_text(examples.robot())
    assert "paper" not in real[0]
    assert len(real) == len(virtual)
    assert not any("\\" in line for line in real)


def test_markdown_is_one_table_and_no_markup_from_outside() -> None:
    text = table1_markdown(examples.robot())
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1
    assert len(lines) == 2 + 5
    assert "<script" not in text
    assert "\x1b" not in text


def test_the_truth_stands_beside_simulated_values_and_says_so() -> None:
    robot = dict(examples.robot(), simulated=True)
    entries = {(e.parameter, e.direction): e for e in table1_entries(robot, truth=examples.truth())}
    assert entries["static_torque", "positive"].truth == 0.5735
    assert entries["viscous_damping", "mean"].truth == pytest.approx(0.0809)
    assert entries["inertia", ""].truth == 0.026
    for text in (table1_markdown(robot, truth=examples.truth()), table1_tex(robot, truth=examples.truth())):
        assert "imulated" in text
        assert "truth" in text
    assert {row["simulated"] for row in _rows(table1_csv(robot))} == {"true"}
    assert "imulated" not in table1_markdown(examples.robot())


def test_tex_holds_every_value_and_nothing_that_tex_would_run() -> None:
    text = table1_tex(examples.robot())
    body = text[text.index(r"\begin{tabular}") : text.index(r"\end{tabular}")]
    rows = [line for line in body.splitlines() if line.endswith(r"\\")]
    assert {line.count(" & ") for line in rows} == {3}
    assert "0.5123" in body
    assert "script" not in body


def test_digits_follow_the_uncertainty() -> None:
    assert shown_number(0.573512, like=0.0023) == "0.5735"
    assert shown_number(0.573512, like=0.023) == "0.574"
    assert shown_number(-94.3712, like=2.1) == "−94.4"
    assert shown_number(0.573512) == "0.5735"
    assert shown_number(None) == shown_number(math.nan) == "–"
    assert shown_number(math.inf) == "∞"
    assert shown_interval([0.571, 0.576]) == "[0.5710, 0.5760]"
    assert shown_interval([0.55, None]) == "[0.55, ∞)"
    assert shown_interval([None, 0.6]) == "(−∞, 0.6]"
    assert shown_interval(None) == "–"
    assert shown_percent(0.0314) == "3.1\N{NO-BREAK SPACE}%"

"""Only whole rows are read: what is cut, shifted or hidden behind a comment mark is taken out and named."""

import numpy as np
import pytest

from data.csv.dialect import sniff
from data.csv.log import CsvTable, read_csv

RNG = np.random.default_rng(7)
VALUES = np.cumsum(RNG.normal(size=(300, 3)), axis=0) * 0.01


def read(content: bytes) -> CsvTable:
    layout = sniff(content)
    return read_csv(content, layout, range(layout.columns))


def written(form: str, *, delimiter: str = ",") -> str:
    rows = [delimiter.join(form.format(value) for value in row) for row in VALUES]
    return "\n".join((delimiter.join("tqu"), *rows))


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
@pytest.mark.parametrize("bad", ["5,6", "5,6,7,8"])
def test_a_ragged_line_is_named_and_taken_out(bad: str, encoding: str, ending: str) -> None:
    lines = ["# a: b", "t,q,u", "1,2,3", bad, "", "8,9,10", "11,12,13", ""]
    content = ending.join(lines).encode(encoding)
    table = read(content)
    assert table.values[2].tolist() == [3.0, 10.0, 13.0]
    (loss,) = table.rows.losses
    assert loss.why.startswith(f"line 4 has {len(bad.split(','))} cells, the others 3")
    assert (bad + ending).encode(encoding).removeprefix(b"\xff\xfe").removeprefix(b"\xef\xbb\xbf") == content[
        loss.begin : loss.end
    ]


def test_two_ragged_lines_do_not_make_up_for_each_other() -> None:
    table = read(b"t,q,u\n1,2,3\n4,5\n6,7,8,9\n10,11,12\n13,14,15\n")
    assert table.values[0].tolist() == [1.0, 10.0, 13.0]
    assert len(table.rows.losses) == 2


def test_ragged_lines_between_blanks() -> None:
    table = read(b"1 2  3\n  4 5 6 \n7 8\n9 10 11 12\n13\t14 15\n")
    assert table.values[0].tolist() == [1.0, 4.0, 13.0]
    assert [loss.why[:6] for loss in table.rows.losses] == ["line 3", "line 4"]


@pytest.mark.parametrize("head", ["", "# operator: J\n"])
def test_a_cell_that_reads_like_a_comment_hides_no_row(head: str) -> None:
    table = read(f"{head}t,q\n0,1\n1,2\n#N/A,3\n# marker, pressed\n#7,8\n3,4\n4,5 # end, of it\n".encode())
    assert table.values[1].tolist() == [1.0, 2.0, 4.0, 5.0]
    (loss,) = table.rows.losses
    assert "begins with '#N/A'" in loss.why
    assert f"line {4 + bool(head)}" in loss.why
    (note,) = table.rows.notes
    assert note.startswith("1 rows of numbers are commented out")


@pytest.mark.parametrize("form", ["{:.6f}", "{:.9e}", "{:.4f}"])
@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_number_cut_anywhere_is_never_read(form: str, delimiter: str) -> None:
    whole = written(form, delimiter=delimiter)
    last = len(whole) - whole.rindex("\n") - 1
    assert read(whole.encode()).rows.losses == ()
    assert read(whole.encode()).values[0].size == 300
    for cut in range(1, last):
        table = read(whole[:-cut].encode())
        assert table.values[0].size == 299, whole[-last:-cut]
        assert len(table.rows.losses) == 1
        assert table.rows.losses[0].end == len(whole) - cut


def test_numbers_of_varying_length_are_cut_by_at_most_what_does_not_matter() -> None:
    whole = written("{!r}".replace("!r", ":.17g"))
    last = len(whole) - whole.rindex("\n") - 1
    for cut in range(1, last):
        table = read(whole[:-cut].encode())
        if table.values[0].size == 300:
            assert table.values[2][-1] == pytest.approx(VALUES[-1, 2], abs=1e-8)
        else:
            assert len(table.rows.losses) + len(table.rows.notes) == 1


@pytest.mark.parametrize(
    "tail", ["10,20,30\n", "10,20,31", "10,20,9", "10,20,30\r\n", "10,20,30\n\n", '10,20,"3"']
)
def test_a_whole_last_line_needs_no_line_end(tail: str) -> None:
    content = ("t,q,u\n" + "".join(f"{k},{2 * k},{k % 50}\n" for k in range(100)) + tail).encode()
    table = read(content)
    assert table.values[0].size == 101
    assert (table.rows.losses, table.rows.notes) == ((), ())


def test_a_short_integer_at_the_end_is_left_out_with_a_note() -> None:
    content = ("t,q\n" + "".join(f"{k},{1000 + k}\n" for k in range(100)) + "100,11").encode()
    table = read(content)
    assert table.values[0].size == 100
    assert table.rows.losses == ()
    assert "stops at '11', shorter than the numbers above it" in table.rows.notes[0]


def test_a_line_cut_by_a_power_loss_is_a_loss() -> None:
    for content, begin in ((b"t,q\n0,1\n1,2\n2", 12), (b't,q\n0,"1"\n1,"2"\n2,"3', 16)):
        table = read(content)
        assert table.values[1].tolist() == [1.0, 2.0]
        assert [(loss.begin, loss.end) for loss in table.rows.losses] == [(begin, len(content))]

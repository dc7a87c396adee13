from hypothesis import given
from hypothesis import strategies as st

from data.names import nearest, shown


@given(st.text(max_size=400))
def test_a_shown_name_is_one_printable_line_of_bounded_length(name: str) -> None:
    line = shown(name)
    assert line.isprintable()
    assert len(line) <= 240
    if name.isprintable() and len(name) <= 120:
        assert line == name


def test_the_nearest_names() -> None:
    assert nearest("/joint_state", ["/tf", "/joint_states", "/rosout"]).startswith("/joint_states")
    assert nearest("effort", ["motor/effort_measured", "t"]).startswith("motor/effort_measured")
    assert nearest("x", []) == "nothing"
    assert nearest("zzz", [f"c{k}" for k in range(9)]) == "c0, c1, c2, c3 and 5 more"
    assert "\x1b" not in nearest("a", ["a\x1b[31m"])

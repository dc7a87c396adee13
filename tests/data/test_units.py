import math
from pathlib import Path

import numpy as np
import pytest

from data.findings import LogError
from data.signals import RigSignals, Signal, Signals, log_format
from data.units import Quantity, factor_to_si, known_unit, parse_unit, same_unit, si_word


@pytest.mark.parametrize(
    ("word", "quantity", "size"),
    [
        ("deg", "position", math.pi / 180),
        ("°", "position", math.pi / 180),
        ("rev", "position", 2 * math.pi),
        ("mrad", "position", 1e-3),
        ("rpm", "velocity", math.pi / 30),
        ("RPM", "velocity", math.pi / 30),
        ("deg / s", "velocity", math.pi / 180),
        ("rad/s", "velocity", 1.0),
        ("N·m", "torque", 1.0),
        ("N*m", "torque", 1.0),
        ("Nm", "torque", 1.0),
        ("mN m", "torque", 1e-3),
        ("ms", "time", 1e-3),
        ("µs", "time", 1e-6),
        ("ns", "time", 1e-9),
        ("h", "time", 3600.0),
        ("days", "time", 86_400.0),
        ("arcmin", "position", math.pi / 10_800),
        ("gon", "position", math.pi / 200),
        ("µrad", "position", 1e-6),
        ("N·mm", "torque", 1e-3),
        ("lbf·ft", "torque", 1.3558179483314004),  # NIST SP 811, B.8
        ("lbf in", "torque", 0.1129848290276167),
        ("oz in", "torque", 0.00706155181422604),
        ("kgf cm", "torque", 0.0980665),
        ("min⁻¹", "velocity", math.pi / 30),
        (None, "torque", 1.0),
    ],
)
def test_factors(word: str | None, quantity: Quantity, size: float) -> None:
    factor = factor_to_si(word, quantity=quantity, axis="rotary", encoder_counts=None, scaled=False)
    assert factor == pytest.approx(size, rel=1e-15)


def test_a_linear_axis_has_its_own_units() -> None:
    for word, quantity, size in (
        ("mm", "position", 1e-3),
        ("mm/s", "velocity", 1e-3),
        ("kN", "torque", 1e3),
        ("lbf", "torque", 4.4482216152605),
    ):
        factor = factor_to_si(word, quantity=quantity, axis="linear", encoder_counts=None, scaled=False)  # type: ignore[arg-type]  # the words of the tuple
        assert factor == pytest.approx(size, rel=1e-15)
    assert si_word("torque", "linear") == "N"
    assert si_word("velocity", "rotary") == "rad/s"
    with pytest.raises(LogError, match='axis = "linear"'):
        factor_to_si("mm", quantity="position", axis="rotary", encoder_counts=None, scaled=False)


def test_amperes_need_a_scale_and_counts_their_number() -> None:
    with pytest.raises(LogError, match="needs a `scale`"):
        factor_to_si("A", quantity="torque", axis="rotary", encoder_counts=None, scaled=False)
    with pytest.raises(LogError, match="encoder_counts"):
        factor_to_si("counts", quantity="position", axis="rotary", encoder_counts=None, scaled=False)
    assert factor_to_si("mA", quantity="torque", axis="rotary", encoder_counts=None, scaled=True) == 1e-3
    counts = factor_to_si("counts", quantity="position", axis="rotary", encoder_counts=20000, scaled=False)
    assert counts == 2 * math.pi / 20000


@pytest.mark.parametrize(
    ("word", "near"),
    [("degs", "deg"), ("NM", "N m"), ("radian/sek", "rad/s"), ("Grad", "rad"), ("xyzzy", "rad")],
)
def test_an_unknown_word_names_its_nearest(word: str, near: str) -> None:
    with pytest.raises(LogError, match=f"not a unit known here.*{near}"):
        parse_unit(word)


def test_case_matters_where_it_changes_the_meaning() -> None:
    assert known_unit("MN") is None
    assert known_unit("mN") != known_unit("N")
    assert same_unit("N m", "Nm")
    assert not same_unit("rad", "deg")


def test_a_signal_converts_as_the_interface_says() -> None:
    signal = Signal("i", unit="mA", scale=0.12, sign=-1, offset=0.5)
    got = signal.to_si(np.array([1000.0, -2000.0]), quantity="torque", axis="rotary", encoder_counts=None)
    assert got == pytest.approx([0.5 - 0.12, 0.5 + 0.24])
    plain = np.array([1.0, 2.0])
    assert Signal("q").to_si(plain, quantity="position", axis="rotary", encoder_counts=None) is plain


def test_what_no_signal_can_be() -> None:
    for scale, sign, offset in ((0.0, 1, 0.0), (1.0, 2, 0.0), (1.0, 1, math.nan)):
        with pytest.raises(LogError, match="'q'"):
            Signal("q", scale=scale, sign=sign, offset=offset)
    with pytest.raises(LogError, match="names nothing for mcap"):
        RigSignals(csv=Signals()).of("mcap")
    with pytest.raises(LogError, match="by their ending"):
        log_format(Path("run.xlsx"))
    assert log_format(Path("RUN.CSV")) == "csv"

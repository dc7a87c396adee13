import functools
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from ident.model.published import asymmetric_robot
from pipelines.report.bifurcation_figures import figure9
from pipelines.report.comparison_figure import figure10
from pipelines.report.equilibrium_figures import figure4, figure8
from pipelines.report.friction_figures import figure2
from pipelines.report.style import COLOURS, plain, svg_text
from pipelines.report.time_figures import figure6, figure7
from tests.pipelines.report import examples

_FRICTION = asymmetric_robot().friction
CURVES = {1: _FRICTION.positive, -1: _FRICTION.negative}
_GAIN = np.linspace(20.0, 120.0, 11)
_EDGES = np.column_stack((np.linspace(-0.4, 0.0, 11), np.linspace(0.4, 0.0, 11)))
_SVG = "{http://www.w3.org/2000/svg}"


def _figure(number: int, *, title: str = "a title", simulated: bool = False) -> Figure:
    motion = examples.motion()
    if number == 2:
        return figure2(examples.map_points(), CURVES, title=title, simulated=simulated)
    if number == 4:
        return figure4(_GAIN, _EDGES, 3 * _EDGES, critical_gain=73.07, title=title, simulated=simulated)
    if number == 6:
        return figure6(motion, motion, perturbation=examples.HOSTILE, title=title, simulated=simulated)
    if number == 7:
        return figure7(motion, torque=motion.time, title=title, simulated=simulated)
    if number == 8:
        edges = {0.9: np.abs(_EDGES), 1.0: np.abs(_EDGES), 1.01: np.full_like(_EDGES, np.nan)}
        return figure8(_GAIN, edges, critical_gain=None, title=title, simulated=simulated)
    if number == 9:
        return figure9(examples.diagram(), title=title, simulated=simulated)
    diagram = examples.diagram()
    return figure10(
        examples.comparison(), fitted=diagram, symmetric=diagram, title=title, simulated=simulated
    )


@functools.cache
def _text(number: int, *, simulated: bool = False) -> str:
    return svg_text(_figure(number, simulated=simulated))


def _parsed(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(text)  # noqa: S314  # written a moment ago by the tool itself


@pytest.mark.parametrize("number", [2, 4, 6, 7, 8, 9, 10])
class TestEveryFigure:
    def test_is_xml_with_its_title_for_those_who_cannot_see_it(self, number: int) -> None:
        root = _parsed(svg_text(_figure(number, title="bench 3 < bench 4")))
        assert root.tag == f"{_SVG}svg"
        assert root.get("role") == "img"
        assert root.get("aria-label") == "bench 3 < bench 4"
        assert root.findtext(f"{_SVG}title") == "bench 3 < bench 4"

    def test_is_the_same_text_every_time_and_tells_no_date(self, number: int) -> None:
        first, second = _text(number), svg_text(_figure(number))
        assert first == second
        assert "<metadata" not in first
        assert "<dc:" not in first

    def test_leaves_the_settings_as_they_were(self, number: int) -> None:
        before = dict(mpl.rcParams)
        svg_text(_figure(number))
        assert dict(mpl.rcParams) == before

    def test_says_when_it_is_simulated(self, number: int) -> None:
        assert "SIMULATED" not in _text(number)
        simulated = _text(number, simulated=True)
        assert "(SIMULATED)</title>" in simulated
        assert "<!-- SIMULATED -->" in simulated

    def test_survives_a_hostile_title(self, number: int) -> None:
        text = svg_text(_figure(number, title=examples.HOSTILE))
        root = _parsed(text)
        assert "<script" not in text
        assert "\x1b" not in text
        assert "\u202e" not in text
        assert "alert(1)" in str(root.get("aria-label"))

    def test_uses_the_colours_of_the_palette_only(self, number: int) -> None:
        known = {colour.light for colour in COLOURS.values()}
        found = {
            word
            for word in _text(number).replace(";", " ").replace('"', " ").split()
            if word[0] == "#" and len(word) == 7
        }
        assert found <= known

    def test_fits_a_page_and_holds_letters_as_outlines(self, number: int) -> None:
        text = _text(number)
        assert len(text) < 250_000
        assert "<text" not in text
        assert "<image" not in text


def test_dark_and_light_roles_differ() -> None:
    for colour in COLOURS.values():
        assert colour.light != colour.dark
    assert len({colour.light for colour in COLOURS.values()}) == len(COLOURS)


def test_plain_shows_control_characters() -> None:
    assert plain("a\x1b[31mb\nc") == "a\\x1b[31mb\\nc"


def test_no_part_of_the_report_needs_a_display() -> None:
    for path in Path(svg_text.__code__.co_filename).parent.glob("*.py"):
        assert "pyplot" not in path.read_text(encoding="utf-8").replace("without pyplot", "")

import functools
import re
from html.parser import HTMLParser
from typing import Any

import pytest

from pipelines.report.bifurcation_figures import figure9
from pipelines.report.comparison_figure import figure10
from pipelines.report.inline_svg import PictureError, inline_svg
from pipelines.report.page import report_page
from pipelines.report.style import svg_text
from tests.pipelines.report import examples

_VOID = frozenset({"meta", "br", "hr", "img", "input", "link"})


class _Walk(HTMLParser):
    """Checks that tags balance, and collects what a page is made of."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        self.ids += [str(value) for key, value in attrs if key == "id"]
        self.links += [str(value) for key, value in attrs if key.endswith("href") or key == "src"]
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] != ["style"]:
            self.text.append(data)


def _walk(page: str) -> _Walk:
    walk = _Walk()
    walk.feed(page)
    walk.close()
    assert not walk.open
    return walk


@functools.cache
def _figures() -> dict[str, str]:
    return {
        "figure9": svg_text(figure9(examples.diagram())),
        "figure10": svg_text(figure10(examples.comparison(), fitted=examples.diagram())),
    }


def _everything(**changes: Any) -> str:
    parts: dict[str, Any] = {
        "name": "bench 3",
        "rig": "one-link robot",
        "robot": examples.robot(),
        "design": examples.design(),
        "diagram": {
            "parameter": "r",
            "bifurcations": [{"r": 0.9925, "kind": "onset_of_cycling"}],
            "notes": ["n"],
        },
        "comparison": examples.comparison(),
        "manifest": {"versions": {"numpy": "2.4.6"}, "seed": 1, "inputs": [{"file": "a", "sha256": "b"}]},
        "fit_report": "[[Variables]]\n    F_s: 0.57 +/- 0.01",
        "figures": _figures(),
    }
    return report_page(**(parts | changes))


class TestThePage:
    def test_is_well_formed_and_every_identifier_is_its_own(self) -> None:
        walk = _walk(_everything())
        assert len(walk.ids) == len(set(walk.ids))
        for link in walk.links:
            assert link.startswith("#")
            assert link[1:] in walk.ids

    def test_needs_no_network(self) -> None:
        page = _everything()
        assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", page)
        assert not {"script", "iframe", "object", "embed", "img", "image", "link"} & set(_walk(page).tags)
        assert len(page) < 2_000_000

    def test_every_table_has_headers_with_a_scope(self) -> None:
        page = _everything()
        assert page.count("<table") == page.count("<thead")
        assert "<th>" not in page

    def test_is_at_home_on_dark_pages_and_on_paper(self) -> None:
        page = _everything()
        assert "prefers-color-scheme: dark" in page
        assert "@media print" in page
        pictures = "".join(re.findall(r"<svg.*?</svg>", page, re.DOTALL))
        assert not re.findall(r"#[0-9a-f]{6}\b", pictures)  # all colours are the page's

    def test_the_first_screen_answers_the_four_questions(self) -> None:
        text = " ".join("".join(_walk(_everything()).text).split())
        first = text[: text.index("Where limit cycling begins")]
        assert "What is the friction law?" in first
        assert "1 of 11 values withheld" in first
        assert "L = 104.2 1/s, r = 0.94" in first
        assert "9 of 9 runs end as predicted" in first
        assert "Cycling from +0.6 rad begins between r = 0.9 and 1.1; predicted 0.995" in first
        assert "Cycling from −0.1 rad begins below r = 1" in first

    def test_every_run_stands_with_its_use_and_reason(self) -> None:
        text = "".join(_walk(_everything()).text)
        for run in (*examples.robot()["runs"], *examples.comparison()["runs"]):
            assert run["log"] in text
        assert "E-STICKSLIP" in text
        assert text.index("left out") < text.index("seen velocity")  # the graver finding first

    def test_withheld_parameters_show_the_reason(self) -> None:
        assert "E-LOWSPEED: run 0.01 to 0.05 rad/s" in "".join(_walk(_everything()).text)

    def test_the_bifurcations_are_named(self) -> None:
        text = "".join(_walk(_everything()).text)
        assert "0.9925" in text
        assert "onset of cycling" in text

    def test_is_the_same_every_time(self) -> None:
        assert _everything() == _everything()

    def test_a_wrong_prediction_is_said(self) -> None:
        comparison = examples.comparison()
        comparison["runs"][0]["predicted"]["verdict"] = "limit_cycle"
        page = _everything(comparison=comparison)
        assert "8 of 9 runs end as predicted" in page
        assert '<span class="no">no</span>' in page


class TestSimulated:
    def test_is_said_everywhere(self) -> None:
        page = _everything(robot=dict(examples.robot(), simulated=True), truth=examples.truth())
        assert "(SIMULATED) – friction report</title>" in page
        assert 'class="simulated"' in page
        assert "truth" in page
        assert "The truth lies inside" in page

    def test_is_not_said_of_measured_logs(self) -> None:
        assert "SIMULATED" not in _everything()


@pytest.mark.parametrize(
    "part", ["robot", "design", "diagram", "comparison", "manifest", "fit_report", "figures"]
)
def test_every_part_is_optional(part: str) -> None:
    _walk(_everything(**{part: None}))


def test_nothing_at_all_is_still_a_page() -> None:
    text = "".join(_walk(report_page(name="empty")).text)
    assert "No comparison" in text
    assert "No design" in text


class TestHostileNames:
    page = _everything(
        name=examples.HOSTILE,
        rig=examples.HOSTILE,
        robot=examples.robot(log=examples.HOSTILE),
        comparison=examples.comparison(log=examples.HOSTILE),
        manifest={examples.HOSTILE: {"a": examples.HOSTILE, "b": [examples.HOSTILE]}},
        fit_report=f"line\n{examples.HOSTILE}\nline",
    )

    def test_are_data(self) -> None:
        walk = _walk(self.page)
        assert "script" not in walk.tags
        assert not any(key.startswith("on") for key, _ in walk.attributes)
        assert "<script>alert(1)</script>" in "".join(walk.text)  # shown, as text
        assert "{{ 7 * 7 }}" in "".join(walk.text)  # shown, not computed

    def test_have_no_control_characters_left(self) -> None:
        assert "\x1b" not in self.page
        assert "\u202e" not in self.page
        assert r"\x1b[31m" in self.page

    def test_a_fit_report_keeps_its_lines(self) -> None:
        assert re.search(r"<pre>line\n.*\nline</pre>", self.page)


class TestPictures:
    def test_share_no_identifier(self) -> None:
        text = svg_text(figure9(examples.diagram()))
        first, second = (set(re.findall(r'id="(.*?)"', inline_svg(name, text))) for name in ("a", "b"))
        assert first
        assert not first & second
        inline = inline_svg("a", text)
        assert set(re.findall(r'href="#(.*?)"|url\(#(.*?)\)', inline)) != set()
        for groups in re.findall(r'href="#(.*?)"|url\(#(.*?)\)', inline):
            assert "".join(groups) in first

    @pytest.mark.parametrize(
        "inside",
        [
            "<script>1</script>",
            '<g onload="x()"/>',
            '<image href="x.png"/>',
            '<use href="https://elsewhere/x.svg#a"/>',
            '<g style="fill: url(https://elsewhere/a)"/>',
            "<foreignObject/>",
        ],
    )
    def test_from_elsewhere_are_refused(self, inside: str) -> None:
        with pytest.raises(PictureError, match="figure9"):
            inline_svg("figure9", f'<svg viewBox="0 0 1 1">{inside}</svg>')

    def test_that_are_none_are_refused(self) -> None:
        with pytest.raises(PictureError, match="no SVG"):
            inline_svg("figure9", "<html></html>")

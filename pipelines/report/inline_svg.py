"""Our SVG pictures, made part of a page.

A picture on its own has white paper and black ink. Inside `report.html` its colours become the page's
(custom properties, so that a dark page has a dark picture and print is white again), its identifiers get
the picture's name in front, since two pictures on one page must not share them, and everything that only a
file needs is taken off.
"""

from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import Final

from pipelines.report.style import COLOURS

_HEAD: Final = re.compile(r"^.*?(?=<svg\b)", re.DOTALL)
_STYLE: Final = re.compile(r"<defs>\s*<style\b.*?</style>\s*</defs>", re.DOTALL)
_COMMENT: Final = re.compile(r"<!--.*?-->", re.DOTALL)
_ONLY_FILES: Final = re.compile(r"\s(?:xmlns(?::\w+)?|width|height|version)=\"[^\"]*\"")
_ELEMENTS: Final = frozenset({"svg", "title", "defs", "style", "g", "path", "use", "clippath", "rect"})


class PictureError(ValueError):
    """A file that should be one of our pictures and is not."""


class _Elements(HTMLParser):
    """Walks the elements and refuses what our pictures never hold."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Known elements, no event handlers, references only into the picture itself."""
        for key, value in attrs:
            foreign = key.endswith("href") and not (value or "").startswith("#")
            if key.startswith("on") or foreign or "url(" in (value or "").replace("url(#", ""):
                raise PictureError(
                    f"{self.name}: {tag} has {key}, which no picture of this tool has: make it anew"
                )
        if tag not in _ELEMENTS:
            raise PictureError(f"{self.name} holds <{tag}>, which no picture of this tool does: make it anew")


def inline_svg(name: str, text: str) -> str:
    """The picture `name` as an element of a page; raises `PictureError` where it is none of ours.

    A picture is read back from a result folder, where anyone can have written: one that holds a script,
    an event handler or a reference to another file is refused.
    """
    if "<svg" not in text or "</svg>" not in text:
        raise PictureError(f"{name} is no SVG picture: make it anew, or delete the file")
    _Elements(name).feed(text)
    text = _COMMENT.sub("", _STYLE.sub("", _HEAD.sub("", text)))
    start, end = text.index("<svg"), text.index(">") + 1
    text = _ONLY_FILES.sub("", text[start:end]) + text[end:]
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = re.sub(r"url\(#", f"url(#{name}-", text)
    for role, colour in COLOURS.items():
        text = text.replace(colour.light, f"var(--{role})")
    return text.strip()


def colour_properties(*, dark: bool) -> str:
    """CSS declarations of every colour role, for a light or a dark page."""
    return " ".join(f"--{role}: {colour.dark if dark else colour.light};" for role, colour in COLOURS.items())

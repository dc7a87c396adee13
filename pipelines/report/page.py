"""report.html: everything a campaign gave, on one page that needs no network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def report_page(
    *,
    name: str,
    robot: Mapping[str, Any] | None = None,
    design: Mapping[str, Any] | None = None,
    diagram: Mapping[str, Any] | None = None,
    comparison: Mapping[str, Any] | None = None,
    manifest: Mapping[str, Any] | None = None,
    truth: Mapping[str, Any] | None = None,
    fit_report: str | None = None,
    figures: Mapping[str, str] | None = None,
    axis: str = "rotary",
    simulated: bool = False,
) -> str:
    """The page, from results as they are read back; `figures` maps "figure2" ... to SVG text. All parts optional."""
    raise NotImplementedError

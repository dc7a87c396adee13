"""Table 1, as it was fitted, beside the paper's: as CSV for programs, Markdown and LaTeX for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def table1_csv(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """One row a parameter and direction. `robot` and `truth` as robot.json and truth.json hold them."""
    raise NotImplementedError


def table1_markdown(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """For people: one row a parameter, a column a direction."""
    raise NotImplementedError


def table1_tex(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """A `tabular` in the layout of the paper's Table 1."""
    raise NotImplementedError

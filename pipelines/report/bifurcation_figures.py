"""Figures 9 and 10: where the loop ends up over the compensation gain, predicted and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from pipelines.report.drawn_values import DrawnDiagram
from pipelines.report.style import styled


@styled
def figure9(
    diagram: DrawnDiagram,
    *,
    title: str = "Predicted bifurcation diagram",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Equilibrium sets filled, limit cycles by max|x1|, unstable equilibria dashed; (I), (II), (III) as printed."""
    raise NotImplementedError


@styled
def figure10(
    comparison: Mapping[str, Any],
    *,
    fitted: DrawnDiagram | None = None,
    symmetric: DrawnDiagram | None = None,
    title: str = "Recorded runs over the prediction",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """Recorded runs and onsets, as comparison.json holds them, over the diagrams of the fitted and the mean robot."""
    raise NotImplementedError

"""Figures 6 and 7: one motion of the closed loop, over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from data.recording import FloatArray
from pipelines.report.drawn_values import History
from pipelines.report.style import styled


@styled
def figure6(
    exact: History,
    perturbed: History,
    *,
    perturbation: str,
    title: str = "Limit cycle below the critical observer gain",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """The exact solution and a perturbed one from the same start; `perturbation` names what was added."""
    raise NotImplementedError


@styled
def figure7(
    history: History,
    *,
    torque: FloatArray | None = None,
    title: str = "Performance above the critical observer gain",
    subtitle: str = "",
    axis: str = "rotary",
    simulated: bool = False,
) -> Figure:
    """The motion, the estimate and its error, and the torque (n,) where it is given."""
    raise NotImplementedError

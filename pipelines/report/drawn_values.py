"""What a picture needs to know of the values it draws.

The pictures take results of the rooms below as they are; these shapes name the few fields that are read, so
that a picture can also be drawn from values read back from a result file.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from data.recording import FloatArray


class History(Protocol):
    """A closed-loop motion."""

    @property
    def time(self) -> FloatArray:
        """(n,) [s]."""

    @property
    def state(self) -> FloatArray:
        """(n, 3): x1 [rad], x2 and x3 [rad/s]."""


class DrawnPoint(Protocol):
    """One friction measurement: a run's mean torque at its mean velocity, or a breakaway."""

    @property
    def protocol(self) -> str:
        """What was asked of the rig; "breakaway" stands at zero velocity."""

    @property
    def direction(self) -> str:
        """Direction of motion, "positive" or "negative"."""

    @property
    def velocity(self) -> float:
        """[rad/s]; its magnitude is drawn, on the side that `direction` says."""

    @property
    def torque(self) -> float:
        """[N m]; likewise."""

    @property
    def stderr(self) -> float | None:
        """[N m]."""

    @property
    def used(self) -> bool:
        """Whether the fit used it."""


class BranchPoint(Protocol):
    """One parameter value on a branch."""

    @property
    def value(self) -> float:
        """The bifurcation parameter."""

    @property
    def x1_min(self) -> float:
        """[rad]."""

    @property
    def x1_max(self) -> float:
        """[rad]."""

    @property
    def amplitude(self) -> float | None:
        """max|x1| [rad]."""


class DrawnBranch(Protocol):
    """A branch of a bifurcation diagram."""

    @property
    def kind(self) -> str:
        """One of "equilibrium_set", "limit_cycle", "equilibrium"."""

    @property
    def stable(self) -> bool:
        """Whether a loop that starts near it stays."""

    @property
    def points(self) -> Sequence[BranchPoint]:
        """Along the branch."""


class DrawnBifurcation(Protocol):
    """Where branches meet or change."""

    @property
    def value(self) -> float:
        """The bifurcation parameter."""

    @property
    def kind(self) -> str:
        """Its name."""


class DrawnDiagram(Protocol):
    """A bifurcation diagram."""

    @property
    def parameter(self) -> str:
        """Over what: "r" or "L"."""

    @property
    def branches(self) -> Sequence[DrawnBranch]:
        """All branches."""

    @property
    def bifurcations(self) -> Sequence[DrawnBifurcation]:
        """All bifurcations."""

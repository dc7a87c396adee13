"""What the axes are called: a rotary joint's units and a linear axis's, as campaign.toml's `axis` says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class AxisUnits:
    """Words and units of one kind of axis."""

    position: str
    velocity: str
    torque: str
    damping: str
    inertia: str
    effort: str  # what `torque` is called


ROTARY: Final = AxisUnits("rad", "rad/s", "N m", "N m s/rad", "kg m²", "torque")
LINEAR: Final = AxisUnits("m", "m/s", "N", "N s/m", "kg", "force")


def units_of(axis: str) -> AxisUnits:
    """The units of `axis`, "rotary" or "linear"."""
    return LINEAR if axis == "linear" else ROTARY

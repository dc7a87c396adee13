"""Which law is fitted: a block of parameters for each law, and the law that each direction points to.

A law is F_c, dF = F_s - F_c, v_s, b and beta. With a law for each direction there are two blocks, with a
direction missing there is one, and with one law for both directions there is one block and a torque offset:
the magnitude of the torque in direction s is then the law's plus s times the offset.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

Direction = Literal["positive", "negative"]
LawName = Literal["positive", "negative", "mean"]
DIRECTIONS: Final[tuple[Direction, Direction]] = ("positive", "negative")
SIGN: Final[Mapping[Direction, int]] = {"positive": 1, "negative": -1}
BLOCK: Final = ("coulomb_torque", "stribeck_torque", "stribeck_velocity", "viscous_damping", "stribeck_shape")
COMMON: Final = ("inertia", "torque_offset")


def direction_of(sign: float) -> Direction:
    """The direction of a signed velocity, torque or +1 and -1."""
    return "positive" if sign > 0 else "negative"


@dataclass(frozen=True)
class LawModel:
    """The laws, those whose beta is free, and those that are lines."""

    laws: tuple[LawName, ...] = DIRECTIONS  # or one direction, or ("mean",), which has an offset
    free_shape: tuple[LawName, ...] = ()
    lines: tuple[LawName, ...] = ()  # without Stribeck effect: dF raises their breakaways alone

    @property
    def has_offset(self) -> bool:
        """Whether a constant torque offset is fitted: only beside one law for both directions."""
        return self.laws == ("mean",)

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions that have a law."""
        return tuple(direction for direction in DIRECTIONS if self.law_of(direction) is not None)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All parameters: 'inertia', 'torque_offset', 'positive_coulomb_torque', ..., block after block."""
        return (*COMMON, *(f"{law}_{name}" for law in self.laws for name in BLOCK))

    def law_of(self, direction: Direction) -> LawName | None:
        """The law that holds in a direction; None where the direction is missing."""
        if self.has_offset:
            return "mean"
        return direction if direction in self.laws else None

    def signs(self, law: LawName) -> tuple[int, ...]:
        """+1, -1 or both: the directions that a law holds in."""
        return tuple(SIGN[direction] for direction in self.directions if self.law_of(direction) == law)

    def place(self, law: LawName) -> int:
        """Where the block of a law begins among `names`."""
        return len(COMMON) + len(BLOCK) * self.laws.index(law)

    def is_free(self, name: str, *, inertia: bool) -> bool:
        """Whether a parameter is fitted; `inertia`: whether the data know one."""
        if name == "inertia":
            return inertia
        if name == "torque_offset":
            return self.has_offset
        law, _, parameter = name.partition("_")
        if parameter == "stribeck_shape":
            return law in self.free_shape and law not in self.lines
        return parameter != "stribeck_velocity" or law not in self.lines


EACH: Final = LawModel()

"""What an identification hands on: values with intervals, or reasons why there is none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from data.findings import Finding
from data.protocols import ProtocolName
from data.recording import FloatArray
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot

CURVE_PARAMETERS = (
    "static_torque",
    "coulomb_torque",
    "stribeck_velocity",
    "stribeck_shape",
    "viscous_damping",
)


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value [in `unit`] with a 95 % interval, or why it is withheld.

    `interval95` is None for a fixed parameter; an open end is None.
    """

    value: float | None
    unit: str
    stderr: float | None = None
    interval95: tuple[float | None, float | None] | None = None
    withheld: str | None = None
    fixed: bool = False


@dataclass(frozen=True)
class RunUse:
    """Whether a log was used, and if not, why."""

    log: str
    sha256: str
    protocol: ProtocolName
    used: bool
    why: str | None = None


@dataclass(frozen=True)
class Covariance:
    """Joint covariance of the free parameters, named 'inertia', 'positive.static_torque', ...

    One law for both directions is named 'mean.static_torque', ..., with 'torque_offset'.
    """

    names: tuple[str, ...]
    matrix: FloatArray  # (k, k) [product of the two parameters' units]


@dataclass(frozen=True)
class ProfilePoints:
    """Points of a profile likelihood, by value; where the rise is 0 lies the estimate."""

    value: FloatArray  # (k,) [unit of the parameter]
    rise: FloatArray  # (k,) of chi-square over its least, all other parameters refitted [-]


@dataclass(frozen=True)
class IdentifiedRobot:
    """The fit, as robot.json holds it."""

    inertia: Estimate
    positive: Mapping[str, Estimate]  # the five of CURVE_PARAMETERS
    negative: Mapping[str, Estimate]
    mean: Mapping[str, Estimate]
    torque_offset: Estimate
    runs: tuple[RunUse, ...]
    notes: tuple[Finding, ...]
    covariance: Covariance
    inertia_sources: Mapping[str, Estimate] = field(default_factory=dict)  # by protocol, for comparison
    # Named as `covariance`, and 'mean. ...'.
    profiles: Mapping[str, ProfilePoints] = field(default_factory=dict)
    axis: str = "rotary"
    simulated: bool = False

    @property
    def one_law(self) -> bool:
        """Whether one law for both directions was fitted: the mean holds it, and neither direction."""
        directions = (*self.positive.values(), *self.negative.values())
        return all(entry.value is None for entry in directions) and any(
            entry.value is not None for entry in self.mean.values()
        )

    def laws(self) -> Mapping[str, Mapping[str, Estimate]]:
        """The laws that were fitted, by name: that of each direction, or the mean alone."""
        return {"mean": self.mean} if self.one_law else {"positive": self.positive, "negative": self.negative}

    def robot(self) -> OneLinkRobot | None:
        """The fitted robot, or None where a parameter that it needs is withheld."""
        curves = [_curve(law) for law in self.laws().values()]
        positive, negative = curves[0], curves[-1]
        if self.inertia.value is None or positive is None or negative is None:
            return None
        return OneLinkRobot(self.inertia.value, StribeckFriction(positive=positive, negative=negative))

    def curves(self) -> dict[int, StribeckCurve]:
        """The law of each direction (+1, -1) as far as it is known: F_c + b v without its Stribeck part."""
        laws = list(self.laws().values())
        known = {1: _curve(laws[0]) or _line(laws[0]), -1: _curve(laws[-1]) or _line(laws[-1])}
        return {sign: curve for sign, curve in known.items() if curve is not None}

    def draws(self, n: int, generator: np.random.Generator) -> tuple[OneLinkRobot, ...]:
        """Robots drawn from the joint normal of the estimate; those that break a rule of the law are redrawn.

        Empty where the robot itself is not identified.
        """
        centre = self.robot()
        if centre is None:
            return ()
        where = [k for k, name in enumerate(self.covariance.names) if name != "torque_offset"]
        names = [self.covariance.names[k] for k in where]
        matrix = self.covariance.matrix[np.ix_(where, where)]
        centres = np.array([_value(centre, name) for name in names])
        robots: list[OneLinkRobot] = []
        for _ in range(100 * n):
            if len(robots) == n:
                break
            drawn = generator.multivariate_normal(centres, matrix)
            candidate = _replaced(centre, dict(zip(names, map(float, drawn), strict=True)))
            if candidate is not None:
                robots.append(candidate)
        return tuple(robots)


def _line(estimates: Mapping[str, Estimate]) -> StribeckCurve | None:
    coulomb, damping = (estimates[name].value for name in ("coulomb_torque", "viscous_damping"))
    return None if coulomb is None or damping is None else StribeckCurve(coulomb, coulomb, 1.0, damping, 1.0)


def _curve(estimates: Mapping[str, Estimate]) -> StribeckCurve | None:
    values = {name: estimates[name].value for name in CURVE_PARAMETERS}
    known = {name: value for name, value in values.items() if value is not None}
    return StribeckCurve(**known) if len(known) == len(values) else None


def _value(robot: OneLinkRobot, name: str) -> float:
    if name == "inertia":
        return robot.inertia
    law, parameter = name.split(".")
    curve = robot.friction.negative if law == "negative" else robot.friction.positive  # the mean is both
    return float(getattr(curve, parameter))


def _replaced(robot: OneLinkRobot, values: Mapping[str, float]) -> OneLinkRobot | None:
    curves = {}
    for direction in ("positive", "negative"):
        own = {
            p: values.get(f"{direction}.{p}", values.get(f"mean.{p}", _value(robot, f"{direction}.{p}")))
            for p in CURVE_PARAMETERS
        }
        if own["coulomb_torque"] < 0 or own["static_torque"] < own["coulomb_torque"]:
            return None
        if own["stribeck_velocity"] <= 0 or own["stribeck_shape"] <= 0 or own["viscous_damping"] < 0:
            return None
        curves[direction] = StribeckCurve(**own)
    inertia = values.get("inertia", robot.inertia)
    if inertia <= 0:
        return None
    return OneLinkRobot(inertia, StribeckFriction(**curves))

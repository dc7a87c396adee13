"""Numbers of a design with their intervals: how the errors of the fit reach them, and what is withheld.

Intervals are the 2.5 and 97.5 % quantiles over robots drawn from the fit's joint normal distribution. Where a
parameter is withheld, a number that needs it has the reason instead of a value; the others stand.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from compensation.coexistence import largest_compensation_with_rest
from compensation.controller import Controller
from compensation.design_criteria import (
    critical_observer_gain,
    critical_observer_gains,
    loop_decay,
    observer_error_decay,
)
from compensation.recommendation import ThresholdEnds, overcompensation_thresholds
from ident.estimate import CURVE_PARAMETERS, Estimate
from ident.model.friction import StribeckCurve
from ident.model.robot import OneLinkRobot
from pipelines.results.robot_file import RobotFile

CRITICAL_GAINS: Final = ("positive", "negative", "mean", "worst")
RESTS: Final = ("positive", "negative", "r_max")
RATES: Final = ("observer_error", "loop")


@dataclass(frozen=True)
class Quantity:
    """A number with its 95 % interval, or the reason why there is none; an open end is None."""

    value: float | None
    unit: str
    interval95: tuple[float | None, float | None] | None = None
    withheld: str | None = None


def drawn_robots(source: RobotFile, n: int, seed: int) -> tuple[OneLinkRobot, ...]:
    """Robots drawn from the fit; none without an uncertainty, or where a parameter is withheld."""
    if source.identified is None or not source.identified.covariance.names:
        return ()
    return source.identified.draws(n, np.random.default_rng(seed))


def _interval(samples: list[float]) -> tuple[float | None, float | None] | None:
    """2.5 and 97.5 % quantiles; an end that is not finite is open."""
    if not samples:
        return None
    low, high = (float(np.quantile(samples, q, method="nearest")) for q in (0.025, 0.975))
    return low if math.isfinite(low) else None, high if math.isfinite(high) else None


def critical_gains(robot: OneLinkRobot, drawn: tuple[OneLinkRobot, ...]) -> dict[str, Quantity]:
    """The critical gains of `robot` with the intervals that `drawn` gives them."""
    values = asdict(critical_observer_gains(robot))
    samples = [asdict(critical_observer_gains(one)) for one in drawn]
    return {name: _gain(values[name], [sample[name] for sample in samples]) for name in values}


def _gain(value: float, samples: list[float]) -> Quantity:
    if math.isinf(value):
        why = "beta < 1: the law is infinitely steep at rest, no finite gain is enough (eq 13)"
        return Quantity(None, "1/s", withheld=why)
    return Quantity(value, "1/s", interval95=_interval(samples))


def critical_gains_of_known_directions(source: RobotFile) -> dict[str, Quantity]:
    """The gain of a direction whose own parameters are all known, where another one is withheld."""
    gains = {name: Quantity(None, "1/s", withheld="; ".join(source.missing())) for name in CRITICAL_GAINS}
    if source.identified is None or source.identified.inertia.value is None:
        return gains
    for name, entries in (("positive", source.identified.positive), ("negative", source.identified.negative)):
        curve = _known_curve(entries)
        if curve is not None:
            gains[name] = _gain(critical_observer_gain(curve, inertia=source.identified.inertia.value), [])
    return gains


def _known_curve(entries: Mapping[str, Estimate]) -> StribeckCurve | None:
    values = {name: entries[name].value for name in CURVE_PARAMETERS}
    known = {name: value for name, value in values.items() if value is not None}
    return StribeckCurve(**known) if len(known) == len(values) else None


def decay_rates(
    moving: OneLinkRobot, controller: Controller, drawn: list[OneLinkRobot]
) -> dict[str, Quantity]:
    """L - L_c of the robot as it moves (negative: errors grow), and the decay without observer error."""
    error = _error_decay(moving, controller.gains.observer, drawn)
    return {"observer_error": error, "loop": Quantity(loop_decay(controller).rate, "1/s")}


def rests_beside_the_cycle(
    moving: OneLinkRobot, controller: Controller, drawn: list[OneLinkRobot]
) -> dict[str, Quantity]:
    """r_max of each direction of the estimate, and of both: the largest r with a rest off the set point."""
    found = _largest_rests(moving, controller)
    samples = [_largest_rests(one, controller) for one in drawn]
    return {
        name: Quantity(r, "1", interval95=_interval([sample[name] for sample in samples]))
        if math.isfinite(r)
        else Quantity(
            None, "1", withheld="nothing is compensated: the link can rest off the set point at any r"
        )
        for name, r in found.items()
    }


def _largest_rests(moving: OneLinkRobot, controller: Controller) -> dict[str, float]:
    found = largest_compensation_with_rest(moving, controller)
    return {"positive": found.positive.r, "negative": found.negative.r, "r_max": found.r_max}


def _error_decay(moving: OneLinkRobot, L: float, drawn: list[OneLinkRobot]) -> Quantity:
    if L == 0.0:
        return Quantity(None, "1/s", withheld="L = 0: the decay of the observer error needs L > 0 (eq 17)")
    rate = observer_error_decay(moving, L)
    if math.isinf(rate):
        return Quantity(None, "1/s", withheld="beta < 1: no observer gain makes the error contract")
    return Quantity(rate, "1/s", interval95=_interval([observer_error_decay(one, L) for one in drawn]))


def threshold_values(robot: OneLinkRobot) -> dict[str, dict[str, float | None]]:
    """For each compensator and direction the largest r that overcompensates nowhere [-]; None: none does."""
    models = {"per-direction": robot.friction, "mean": robot.friction.mean()}
    return {
        law: {
            direction: r if math.isfinite(r) else None
            for direction, r in overcompensation_thresholds(robot, model).items()
        }
        for law, model in models.items()
    }


def threshold_ends(robot: OneLinkRobot, drawn: tuple[OneLinkRobot, ...]) -> ThresholdEnds | None:
    """Lower 95 % ends of the thresholds, the smaller direction counting; None without draws."""
    if not drawn:
        return None
    ends = [
        float(np.quantile([min(overcompensation_thresholds(one, model).values()) for one in drawn], 0.025))
        for model in (robot.friction, robot.friction.mean())
    ]
    return ThresholdEnds(per_direction=ends[0], mean=ends[1])

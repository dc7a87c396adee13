r"""Which gains, and which compensator: the advice that follows from the design criteria.

*Observer gain.* It must exceed the robot's worst critical gain, upper end of the interval included, by a
margin in which the error decays faster than the loop moves: L = max(L_c, 0) + max(5 % of L_c, twice the
loop's own decay rate). Where the proportional and derivative gains are not known, the loop's rate is not
either: the 5 % alone are the margin then, and the advice says so.

*Compensation gain.* Overcompensation makes the loop cycle; undercompensation leaves a rest error that shrinks
as r grows. So: as much as is surely not too much. A compensator with r g^(s) <= g(s) at every speed s nowhere
applies more than the friction; the largest such r is min_s g(s)/g^(s), over the directions the
*overcompensation threshold*. At s = 0 it is F_s/F_s^, the value at which equilibria cease to touch the set
point. What counts is its lower end, with the errors of the fit.

*Compensator.* One law for both directions overcompensates the weaker direction before it reaches the
stronger: it can never do away with the stronger direction's equilibria. A compensator with each direction's
own law can, so it is recommended wherever the directions differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains, loop_decay
from compensation.equilibria import DIRECTIONS, Direction, curve_of, equilibrium_set
from ident.model.friction import ModelError, StribeckFriction
from ident.model.numbers import is_number, is_number_or_inf
from ident.model.robot import OneLinkRobot

Law = Literal["per-direction", "mean"]

ASSUMED_UNCERTAINTY = 0.01  # of the friction, where no interval is known [-]
_GAIN_MARGIN = 0.05  # of L_c [-]
_SPEEDS = np.concatenate(([0.0], np.geomspace(1e-5, 50.0, 800), [np.inf]))  # in Stribeck velocities


@dataclass(frozen=True)
class Advice:
    """Gains for one compensator, and the largest rest error [rad] that they leave."""

    compensator: Law
    observer_gain: float | None  # [1/s]; None: no finite gain will do
    compensation_gain: float  # [-]
    largest_rest_error: float | None  # [rad], of the fitted robot; None without L, n1 and n2
    why: str


@dataclass(frozen=True)
class ThresholdEnds:
    """Lower 95 % ends of the overcompensation threshold [-] of each compensator."""

    per_direction: float
    mean: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (is_number_or_inf(value) and value >= 0.0):
                raise ModelError(
                    f"{field.name} threshold is {value!r}: r >= 0, inf where nothing limits it (eq 6)"
                )


def overcompensation_thresholds(robot: OneLinkRobot, model: StribeckFriction) -> dict[Direction, float]:
    """For each direction the largest r [-] with r g^(s) <= g(s) at every speed s; infinite if g^ = 0."""
    return {
        "positive": _threshold(robot.friction, model, "positive"),
        "negative": _threshold(robot.friction, model, "negative"),
    }


def recommend(
    robot: OneLinkRobot,
    *,
    proportional: float | None,
    derivative: float | None,
    worst_gain_high: float | None = None,
    thresholds: ThresholdEnds | None = None,
) -> tuple[Advice, ...]:
    """Advice for each compensator, the recommended one first; a symmetric robot has one law only.

    `worst_gain_high` [1/s] is the upper 95 % end of the worst critical gain, `thresholds` the lower ends of
    the overcompensation thresholds; without them 1 % of uncertainty is assumed for r, and none for L. Raises
    `ModelError` for what is no gain.
    """
    for name, gain in (("proportional", proportional), ("derivative", derivative)):
        if gain is not None and not is_number(gain):
            raise ModelError(f"{name} gain is {gain!r}: a finite number (eq 5)")
    if worst_gain_high is not None and not is_number_or_inf(worst_gain_high):
        raise ModelError(
            f"worst_gain_high is {worst_gain_high!r} 1/s: a number, inf where no gain is enough (eq 11)"
        )
    pd = None if proportional is None or derivative is None else (proportional, derivative)
    symmetric = robot.friction.positive == robot.friction.negative
    laws: tuple[Law, ...] = ("mean",) if symmetric else ("per-direction", "mean")
    return tuple(
        _advice(robot, law, pd, worst_gain_high=worst_gain_high, thresholds=thresholds) for law in laws
    )


def _advice(
    robot: OneLinkRobot,
    law: Law,
    pd: tuple[float, float] | None,
    *,
    worst_gain_high: float | None,
    thresholds: ThresholdEnds | None,
) -> Advice:
    model = robot.mean() if law == "mean" else robot
    limits = overcompensation_thresholds(robot, model.friction)
    weaker = _weaker(limits)
    if thresholds is None:
        r, doubt = limits[weaker] * (1.0 - ASSUMED_UNCERTAINTY), "assuming 1 % of uncertainty in the friction"
    else:
        r = min(limits[weaker], thresholds.mean if law == "mean" else thresholds.per_direction)
        doubt = "the lower 95 % end of the fit"
    r = math.floor(1e4 * r) / 1e4 if math.isfinite(r) else 1.0
    high = critical_observer_gains(robot).worst if worst_gain_high is None else worst_gain_high
    rate = 0.0
    if pd is not None:
        rate = loop_decay(Controller(Gains(*pd, observer=0.0, compensation=r), model)).rate
    L = None if math.isinf(high) else max(high, 0.0) + max(_GAIN_MARGIN * high, 2.0 * rate)
    error = None
    if L is not None and pd is not None:
        error = equilibrium_set(
            robot, Controller(Gains(*pd, observer=L, compensation=r), model)
        ).largest_error
    return Advice(
        compensator=law,
        observer_gain=L,
        compensation_gain=r,
        largest_rest_error=error if error is None or math.isfinite(error) else None,
        why=_reason(robot, model, law, limits, r=r, doubt=doubt, high=high, L=L) + _pace(pd),
    )


def _pace(pd: tuple[float, float] | None) -> str:
    if pd is not None:
        return ""
    return (
        " The loop's own speed and the rest error that remains are not known without the proportional and "
        "derivative gains: with them L may have to be larger."
    )


def _reason(
    robot: OneLinkRobot,
    model: OneLinkRobot,
    law: Law,
    limits: dict[Direction, float],
    *,
    r: float,
    doubt: str,
    high: float,
    L: float | None,
) -> str:
    if L is None:
        observer = "no finite observer gain makes the error contract: beta < 1 is infinitely steep at rest. "
    else:
        observer = (
            f"L = {L:.4g} 1/s lies above the robot's worst critical gain, {high:.4g} 1/s at its upper end, "
            "by a margin in which the observer is faster than the loop. "
        )
    if model == robot:
        which = "Each direction's own law" if law == "per-direction" else "The one law of both directions"
        return (
            f"{observer}{which} leaves only the fit's error: r = {r:.4g} undercompensates by it ({doubt}), "
            "so the link comes to rest near the set point instead of cycling."
        )
    weaker = _weaker(limits)
    other = DIRECTIONS[1 - DIRECTIONS.index(weaker)]
    rest_limit = static_ratio(robot, model, other)
    return (
        f"{observer}The mean law overcompensates the {weaker} direction from r = {limits[weaker]:.4g} on, so "
        f"r = {r:.4g} stays below it ({doubt}); rests in the {other} direction remain up to "
        f"r = {rest_limit:.4g}, for any observer gain."
    )


def _weaker(limits: dict[Direction, float]) -> Direction:
    return "positive" if limits["positive"] <= limits["negative"] else "negative"


def static_ratio(robot: OneLinkRobot, model: OneLinkRobot, direction: Direction) -> float:
    """F_s / F_s^ of a direction [-]: the r at which equilibria cease to touch the set point."""
    held = curve_of(robot.friction, direction).static_torque
    applied = curve_of(model.friction, direction).static_torque
    return held / applied if applied > 0.0 else math.inf


def _threshold(true: StribeckFriction, model: StribeckFriction, direction: Direction) -> float:
    own, believed = curve_of(true, direction), curve_of(model, direction)
    speeds = _SPEEDS * max(own.stribeck_velocity, believed.stribeck_velocity)
    applied = believed.dry(speeds)
    ratios = own.dry(speeds)[applied > 0.0] / applied[applied > 0.0]
    return float(np.min(ratios)) if ratios.size else math.inf

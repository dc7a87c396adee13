r"""What the theory of section 4 certifies, for which compensator, and what it does not.

Two laws meet in the loop: the robot's and the compensator's. Each statement below names the law that the
compensator carries, the hypothesis, and by how much it holds or fails. The statements are:

* *contraction*: L > L_c(worst) of the robot, and L > 0, which the theorem asks of the observer even where
  damping alone would do (L_c < 0). For given x2(t) (and x1(t), where J^ is not J) any two observer errors
  approach each other, eq (17). It says that errors forget their start, not that they vanish, and needs
  nothing of the compensator's law.
* *(a)* the error goes to zero for every x2(t): contraction, and e = 0 is a solution, which takes each
  direction's own law with r = 1 (a model of the robot that is exact, b and J included; without a Stribeck
  effect v_s and beta say nothing).
* *(b)* the loop without error is exponentially stable, A_II being Hurwitz (n1 > 0, b^ + n2 > 0).
* *(c)* S_II is input-to-state stable: a linear Hurwitz system is; with a damping for each direction it is
  homogeneous of degree one, for which exponential stability implies it too.
* *theorem*: (a), (b) and (c) make the set point globally exponentially stable.
* *local contraction*, in each direction: L > L_c of that direction, about creeping that way only.
* in each direction, r F_s^ >= F_s, without which a segment of equilibria touches the set point whatever L is;
  and r F_s^ <= F_s, without which the compensation alone breaks the link away.
* *single equilibrium*: no rest but the set point.
* *the paper's criterion*, L > L_c(mean): what the paper asks of its symmetric robot. A robot whose directions
  differ gets nothing from it, whichever law compensates.

For beta > 1 the critical gain is sufficient for a single equilibrium, not necessary; for beta < 1 it is
infinite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from compensation.controller import Controller
from compensation.design_criteria import critical_observer_gains, loop_decay
from compensation.equilibria import DIRECTIONS, Direction, curve_of, equilibrium_set
from ident.model.doors import expect
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot

NEEDS_GAIN: Final = "L = 0 1/s: fails, the theorem needs L > 0 (eq 17)"


@dataclass(frozen=True)
class Certificate:
    """One statement about one compensator law."""

    law: str  # what the compensator carries, in the caller's words: "per-direction", "mean"
    hypothesis: str
    holds: bool
    margin: float | None  # [unit] by how much; negative where it fails; None where no number says it
    unit: str
    says: str


def certificates(robot: OneLinkRobot, controller: Controller, *, law: str) -> tuple[Certificate, ...]:
    """All statements about `robot` under a controller whose model is called `law`."""
    expect("robot", robot, OneLinkRobot, "eq 1")
    expect("controller", controller, Controller, "eqs 5-7")
    contraction = _contraction(robot, controller, law)
    exact = _exactness(robot, controller, law)
    error = _error_vanishes(law, contraction, exact)
    hurwitz, stable_input = _loop(controller, law)
    theorem = Certificate(
        law=law,
        hypothesis="theorem: (a), (b) and (c)",
        holds=error.holds and hurwitz.holds and stable_input.holds,
        margin=None if error.margin is None or hurwitz.margin is None else min(error.margin, hurwitz.margin),
        unit="1/s",
        says="the set point is globally exponentially stable"
        if error.holds and hurwitz.holds
        else "not certified: " + "; ".join(c.says for c in (*exact, contraction, hurwitz) if not c.holds),
    )
    directions = [
        statement
        for direction in DIRECTIONS
        for statement in _static_statements(robot, controller, direction, law)
    ]
    single = _single_equilibrium(robot, controller, law)
    paper = _papers_criterion(robot, controller, law)
    return (contraction, *exact, error, hurwitz, stable_input, theorem, *directions, single, paper)


def _contraction(robot: OneLinkRobot, controller: Controller, law: str) -> Certificate:
    worst = critical_observer_gains(robot).worst
    gain = controller.gains.observer
    margin = _margin(gain, worst)
    holds = margin > 0.0
    if math.isinf(worst):
        says = (
            "beta < 1: the law is infinitely steep at rest, and no finite observer gain makes errors contract"
        )
    elif gain == 0.0:
        says = NEEDS_GAIN
    elif holds:
        says = f"observer errors contract at {gain - worst:.4g} 1/s for given x2(t); by itself not to zero"
    else:
        says = (
            f"L = {gain:.4g} 1/s is {worst - gain:.4g} 1/s short of {worst:.4g} 1/s: errors grow while the "
            "link creeps in the worse direction"
        )
    return Certificate(
        law,
        "contraction: L > L_c(worst) of the robot",
        holds,
        margin if math.isfinite(margin) else None,
        "1/s",
        says,
    )


def _margin(gain: float, critical: float) -> float:
    """What L [1/s] has beyond both a critical gain and 0; eq (17) needs it to be positive."""
    return gain - max(critical, 0.0)


def _exactness(robot: OneLinkRobot, controller: Controller, law: str) -> tuple[Certificate, Certificate]:
    same = _without_idle(controller.model) == _without_idle(robot)
    gap = 0.0 if same else law_gap(robot.friction, controller.model.friction)
    r = controller.gains.compensation
    own = Certificate(
        law=law,
        hypothesis="the compensator carries the robot's own law in each direction",
        holds=same,
        margin=0.0 - gap if same or gap > 0.0 else None,
        unit="N m",
        says="e = 0 is a solution if r = 1, as far as the fitted law is the robot's"
        if same
        else f"the compensator's model differs from the robot in {_differing(robot, controller.model)} (dry "
        f"friction by up to {gap:.4g}): e = 0 is no solution",
    )
    unity = Certificate(
        law=law,
        hypothesis="r = 1",
        holds=r == 1.0,
        margin=0.0 - abs(r - 1.0),
        unit="1",
        says="the law is compensated in full" if r == 1.0 else f"r = {r}: e = 0 is no solution",
    )
    return own, unity


def _without_idle(robot: OneLinkRobot) -> OneLinkRobot:
    """The same robot, with one v_s and beta for all curves that have no Stribeck effect."""
    curves = (curve_of(robot.friction, direction) for direction in DIRECTIONS)
    settled = (
        curve if curve.stribeck_torque > 0.0 else replace(curve, stribeck_velocity=1.0, stribeck_shape=1.0)
        for curve in curves
    )
    return replace(robot, friction=StribeckFriction(*settled))


def _differing(robot: OneLinkRobot, model: OneLinkRobot) -> str:
    """In what two robots that are not the same differ, in words."""
    pairs = [
        (curve_of(robot.friction, direction), curve_of(model.friction, direction)) for direction in DIRECTIONS
    ]
    names = [
        field.name.replace("_", " ")
        for field in fields(StribeckCurve)
        if any(getattr(one, field.name) != getattr(other, field.name) for one, other in pairs)
    ]
    return ", ".join([*names, *(["inertia"] if robot.inertia != model.inertia else [])])


def _error_vanishes(
    law: str, contraction: Certificate, exact: tuple[Certificate, Certificate]
) -> Certificate:
    holds = contraction.holds and all(statement.holds for statement in exact)
    failed = [statement.hypothesis for statement in (*exact, contraction) if not statement.holds]
    return Certificate(
        law=law,
        hypothesis="(a) the observer error vanishes for every x2(t)",
        holds=holds,
        margin=contraction.margin if all(statement.holds for statement in exact) else None,
        unit="1/s",
        says="e = 0 is globally exponentially stable" if holds else "fails: " + "; ".join(failed),
    )


def _loop(controller: Controller, law: str) -> tuple[Certificate, Certificate]:
    rate = loop_decay(controller).rate
    holds = rate > 0.0
    hurwitz = Certificate(
        law=law,
        hypothesis="(b) A_II is Hurwitz",
        holds=holds,
        margin=rate,
        unit="1/s",
        says=f"the loop without observer error decays at {rate:.4g} 1/s"
        if holds
        else "no damping: b^ + n2 = 0",
    )
    says = (
        "a vanishing observer error leaves no trace in the position"
        if holds
        else "does not follow without (b)"
    )
    return hurwitz, Certificate(law, "(c) S_II is input-to-state stable", holds, rate, "1/s", says)


def _static_statements(
    robot: OneLinkRobot, controller: Controller, direction: Direction, law: str
) -> tuple[Certificate, ...]:
    held = curve_of(robot.friction, direction).static_torque
    known = curve_of(controller.model.friction, direction).static_torque
    excess = controller.gains.compensation * known - held
    return (
        _local_contraction(robot, controller, direction, law),
        Certificate(
            law=law,
            hypothesis=f"r F_s^ >= F_s ({direction})",
            holds=excess >= 0.0,
            margin=excess,
            unit="N m",
            says="no equilibria touch the set point, whatever L is"
            if excess > 0.0
            else "equilibria touch the set point only below the compensator's critical gain"
            if excess == 0.0
            else f"a segment of equilibria touches the set point for every L, up to r = {held / known:.6g}"
            if known > 0.0
            else "a segment of equilibria touches the set point: nothing is compensated",
        ),
        Certificate(
            law=law,
            hypothesis=f"r F_s^ <= F_s ({direction})",
            holds=excess <= 0.0,
            margin=0.0 - excess,
            unit="N m",
            says="the compensation does not break the link away"
            if excess <= 0.0
            else "overcompensation: the least estimated velocity breaks the link away; expect cycling",
        ),
    )


def _papers_criterion(robot: OneLinkRobot, controller: Controller, law: str) -> Certificate:
    limit = critical_observer_gains(robot).mean
    margin = _margin(controller.gains.observer, limit)
    symmetric = robot.friction.positive == robot.friction.negative
    return Certificate(
        law=law,
        hypothesis="L > L_c(mean), the paper's criterion for a symmetric robot",
        holds=margin > 0.0,
        margin=margin if math.isfinite(margin) else None,
        unit="1/s",
        says=NEEDS_GAIN
        if controller.gains.observer == 0.0
        else "the robot is symmetric: this is the contraction above"
        if symmetric
        else "certifies nothing here: the robot's directions differ from their mean",
    )


def _local_contraction(
    robot: OneLinkRobot, controller: Controller, direction: Direction, law: str
) -> Certificate:
    critical = critical_observer_gains(robot)
    limit = critical.positive if direction == "positive" else critical.negative
    margin = _margin(controller.gains.observer, limit)
    return Certificate(
        law=law,
        hypothesis=f"local contraction: L > L_c ({direction})",
        holds=margin > 0.0,
        margin=margin if math.isfinite(margin) else None,
        unit="1/s",
        says=NEEDS_GAIN
        if controller.gains.observer == 0.0
        else f"errors {'shrink' if margin > 0.0 else 'grow'} while the link creeps that way",
    )


def _single_equilibrium(robot: OneLinkRobot, controller: Controller, law: str) -> Certificate:
    rests = equilibrium_set(robot, controller)
    reach = rests.largest_error
    return Certificate(
        law=law,
        hypothesis="the set point is the only equilibrium",
        holds=rests.is_single_point,
        margin=0.0 - reach if math.isfinite(reach) else None,
        unit="rad",
        says="no rest but the set point"
        if rests.is_single_point
        else f"the link can rest anywhere in {len(rests.segments)} segment(s) within "
        f"[{rests.x1_min:.4g}, {rests.x1_max:.4g}]",
    )


def law_gap(first: StribeckFriction, second: StribeckFriction) -> float:
    """Largest difference of two laws' dry friction magnitudes [N m], over both directions and all speeds."""
    expect("first", first, StribeckFriction, "eqs 2-4")
    expect("second", second, StribeckFriction, "eqs 2-4")
    gaps = [abs(first.positive.coulomb_torque - second.positive.coulomb_torque)]
    gaps.append(abs(first.negative.coulomb_torque - second.negative.coulomb_torque))
    for one, other in ((first.positive, second.positive), (first.negative, second.negative)):
        speeds = np.concatenate(
            ([0.0], np.geomspace(1e-4, 30.0, 500) * max(one.stribeck_velocity, other.stribeck_velocity))
        )
        gaps.append(float(np.max(np.abs(one.dry(speeds) - other.dry(speeds)))))
    return max(gaps)

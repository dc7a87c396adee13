"""design: what the identified friction asks of the compensator, eqs (9)-(17).

`design.json`, schema `stribeck/design/1`:

- `critical_observer_gain`: `positive`, `negative`, `mean`, `worst`, each `{"value", "interval95", "unit",
  "withheld"}`; a value that does not exist is `null`, with the reason in `withheld`;
- `decay_rate`: `observer_error` (L minus the worst critical gain of the robot as it moves; below 0 errors
  grow) and `loop` (without observer error), the same fields;
- `overcompensation_threshold`: by compensator and direction the largest r that overcompensates nowhere;
- `rests_beside_the_cycle`: `positive`, `negative` (direction of the velocity estimate) and `r_max`, the
  larger, the same fields: the largest r at which the link can still rest off the set point at the chosen L.
  Where it can cycle at such an r, too, its start decides between the two (`compensation.coexistence`);
- `equilibrium_sets`: for r = 0, r = 1 and the chosen r at the chosen L: `{"r", "observer_gain", "x1_min",
  "x1_max", "single_point", "segments"}`;
- `certificates`: `{"robot", "law", "hypothesis", "holds", "margin", "unit", "says"}`, for the
  compensator with each direction's own law and the one with the mean law on the robot, and for the mean law
  on the mean robot, the paper's analysis;
- `recommended`: `{"observer_gain", "compensation_gain", "compensator", "largest_rest_error",
  "why", "cautions", "alternatives"}`;
- `gains`, `law`, `compensator`, `draws`, `seed`, `withheld`: what was asked, and what could not be answered.

A campaign without set-point runs tells no gains of the loop, and `run` still designs what needs none: `gains`
is null then, `decay_rate` and `rests_beside_the_cycle` are withheld, `equilibrium_sets` and `certificates`
are empty, and `withheld` says why; the critical gains, the thresholds and the recommendation stand.

Intervals are 2.5 and 97.5 % quantiles over robots drawn from the fit's joint normal distribution. The
published robot has none: its intervals are null. It moves with the mean of Table 1's columns, and both
columns are reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Final

from compensation.certificates import Certificate, certificates
from compensation.controller import Controller, Gains
from compensation.design_criteria import critical_observer_gains
from compensation.equilibria import EquilibriumSet, equilibrium_set
from compensation.recommendation import Advice, recommend
from ident.model import published
from ident.model.robot import OneLinkRobot
from pipelines.design_quantities import (
    RATES,
    RESTS,
    Quantity,
    critical_gains,
    critical_gains_of_known_directions,
    decay_rates,
    drawn_robots,
    rests_beside_the_cycle,
    threshold_ends,
    threshold_values,
)
from pipelines.equilibrium_sweeps import FIGURE_8_GAINS, edges, extrema, observer_gain_axis, with_folds
from pipelines.results.folder import ResultFolder
from pipelines.results.robot_file import RobotFile
from pipelines.settings.loop import LawChoice

DESIGN_SCHEMA: Final = "stribeck/design/1"
DRAWS: Final = 1000
FAST_ENOUGH: Final = 0.2  # L h up to which a sampled observer is near the continuous one [-]


@dataclass(frozen=True)
class Design:
    """All of design.json, and what its figures need."""

    name: str
    gains: Gains | None  # None: not known
    law: LawChoice
    compensator: str
    critical: Mapping[str, Quantity]
    decay: Mapping[str, Quantity]
    coexistence: Mapping[str, Quantity]
    thresholds: Mapping[str, Mapping[str, float | None]]
    rests: tuple[tuple[float, EquilibriumSet], ...]  # (r, set)
    certificates: tuple[tuple[str, Certificate], ...]  # (robot, certificate)
    advice: tuple[Advice, ...]
    withheld: tuple[str, ...]
    draws: int
    seed: int
    moving: OneLinkRobot | None  # the robot as it moves; None where a parameter is withheld
    model: OneLinkRobot | None  # what its controller believes
    axis: str
    simulated: bool
    sample_period: float | None  # of the campaign's loop [s]; None: not known, 0: continuous


def design(
    source: RobotFile,
    gains: Gains | None,
    *,
    without_gains: str = "the gains of the loop are not known",
    law: LawChoice = "per-direction",
    compensator: LawChoice | None = None,
    draws: int = DRAWS,
    seed: int = 0,
) -> Design:
    """The design of a robot file; what a withheld parameter leaves open is null with the reason.

    So is what needs gains where they are None: `without_gains` says why they are.
    """
    if source.published:
        law = "mean"  # the paper's robot is the mean of its columns
    robot = published.asymmetric_robot() if source.published else source.fitted
    nothing = Design(
        name=source.name,
        gains=gains,
        law=law,
        compensator=_compensator_name(source, compensator),
        critical=critical_gains_of_known_directions(source),
        decay={name: Quantity(None, "1/s", withheld="; ".join(source.missing())) for name in RATES},
        coexistence={name: Quantity(None, "1", withheld="; ".join(source.missing())) for name in RESTS},
        thresholds={},
        rests=(),
        certificates=(),
        advice=(),
        withheld=tuple(source.missing()),
        draws=0,
        seed=seed,
        moving=None,
        model=None,
        axis="rotary" if source.identified is None else source.identified.axis,
        simulated=source.simulated,
        sample_period=source.loop.sample_period,
    )
    if robot is None:
        return nothing
    drawn = drawn_robots(source, draws, seed)
    critical = critical_gains(robot, drawn)
    moving, model = source.moving(law), source.compensating(compensator)
    worst_high = critical["worst"].interval95[1] if critical["worst"].interval95 is not None else None
    unpaced = replace(
        nothing,
        critical=critical,
        decay={name: Quantity(None, "1/s", withheld=without_gains) for name in RATES},
        coexistence={name: Quantity(None, "1", withheld=without_gains) for name in RESTS},
        thresholds=threshold_values(robot),
        advice=recommend(
            robot,
            proportional=None if gains is None else gains.proportional,
            derivative=None if gains is None else gains.derivative,
            worst_gain_high=worst_high,
            thresholds=threshold_ends(robot, drawn),
        ),
        draws=len(drawn),
        moving=moving,
        model=model,
    )
    if gains is None:
        return replace(unpaced, withheld=(*nothing.withheld, without_gains))
    controller = Controller(gains, model)
    moved = [one.mean() if law == "mean" else one for one in drawn]
    return replace(
        unpaced,
        decay=decay_rates(moving, controller, moved),
        coexistence=rests_beside_the_cycle(moving, controller, moved),
        rests=tuple(
            (r, equilibrium_set(moving, Controller(replace(gains, compensation=r), model)))
            for r in sorted({0.0, 1.0, gains.compensation})
        ),
        certificates=_all_certificates(robot, gains),
    )


def write_design(result: Design, folder: ResultFolder) -> None:
    """design.json, and figure4.svg and figure8.svg where the robot and the gains are known."""
    folder.write_json("design.json", DESIGN_SCHEMA, _document(result))
    if result.moving is None or result.model is None or result.gains is None:
        return
    from pipelines.report.equilibrium_figures import figure4, figure8  # noqa: PLC0415  (matplotlib)
    from pipelines.report.style import svg_text  # noqa: PLC0415

    gains, moving, model = result.gains, result.moving, result.model
    limit = critical_observer_gains(moving).worst
    swept = with_folds(
        observer_gain_axis(limit, gains.observer), moving, model, gains, compensation_gains=FIGURE_8_GAINS
    )
    critical = limit if math.isfinite(limit) and limit > 0 else None
    subtitle = f"{result.name}: n1 = {gains.proportional:g}, n2 = {gains.derivative:g}; {_loop_words(result)}"
    exact, none = (
        extrema(moving, model, gains, compensation_gain=r, observer_gain=swept) for r in (1.0, 0.0)
    )
    drawn_4 = figure4(
        swept,
        exact,
        none,
        critical_gain=critical,
        subtitle=subtitle,
        axis=result.axis,
        simulated=result.simulated,
    )
    folder.write_text("figure4.svg", svg_text(drawn_4))
    drawn_8 = figure8(
        swept,
        {r: edges(moving, model, gains, compensation_gain=r, observer_gain=swept) for r in FIGURE_8_GAINS},
        critical_gain=critical,
        subtitle=subtitle,
        axis=result.axis,
        simulated=result.simulated,
    )
    folder.write_text("figure8.svg", svg_text(drawn_8))


def _compensator_name(source: RobotFile, choice: LawChoice | None) -> str:
    if choice is None and source.loop.compensator is not None:
        return "as the campaign says"
    return choice or "mean"


def _loop_words(result: Design) -> str:
    moves = "each direction's own friction" if result.law == "per-direction" else "the mean friction"
    return f"{moves}, compensator: {result.compensator}"


def _all_certificates(robot: OneLinkRobot, gains: Gains) -> tuple[tuple[str, Certificate], ...]:
    mean = robot.mean()
    cases = (
        ("both directions", robot, robot, "per-direction"),
        ("both directions", robot, mean, "mean"),
        ("mean", mean, mean, "mean"),
    )
    return tuple(
        (name, certificate)
        for name, moving, model, law in cases
        for certificate in certificates(moving, Controller(gains, model), law=law)
    )


def _document(result: Design) -> dict[str, object]:
    return {
        "robot": result.name,
        "simulated": result.simulated,
        "gains": result.gains,
        "law": result.law,
        "compensator": result.compensator,
        "critical_observer_gain": result.critical,
        "decay_rate": result.decay,
        "rests_beside_the_cycle": result.coexistence,
        "overcompensation_threshold": result.thresholds,
        "equilibrium_sets": [
            _rest_document(r, found, result.gains) for r, found in result.rests if result.gains is not None
        ],
        "certificates": [
            {"robot": name, **asdict(one), "unit": _unit(one.unit, result.axis)}
            for name, one in result.certificates
        ],
        "recommended": _recommended(result),
        "draws": result.draws,
        "seed": result.seed,
        "withheld": result.withheld,
    }


def _unit(unit: str, axis: str) -> str:
    return {"N m": "N", "rad": "m"}.get(unit, unit) if axis == "linear" else unit


def _rest_document(r: float, found: EquilibriumSet, gains: Gains) -> dict[str, object]:
    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "r": r,
        "observer_gain": gains.observer,
        "x1_min": finite(found.x1_min),
        "x1_max": finite(found.x1_max),
        "single_point": found.is_single_point,
        "segments": [
            {"direction": s.direction, "x1_min": finite(s.x1_min), "x1_max": finite(s.x1_max)}
            for s in found.segments
        ],
    }


def _recommended(result: Design) -> dict[str, object]:
    if not result.advice:
        empty = dict.fromkeys(("observer_gain", "compensation_gain", "compensator", "largest_rest_error"))
        return {**empty, "why": "; ".join(result.withheld), "cautions": [], "alternatives": []}
    best, *others = (asdict(advice) for advice in result.advice)
    return {**best, "cautions": _cautions(result), "alternatives": others}


def _cautions(result: Design) -> list[str]:
    """Where a sampled controller cannot follow the recommended gain."""
    gain, period = result.advice[0].observer_gain, result.sample_period
    if gain is None or not period or gain * period <= FAST_ENOUGH:
        return []
    return [
        f"L h = {gain * period:.3g} at the sample period h = {period:g} s: the sampled observer lags and "
        "overshoots (Euler's rule diverges from L h = 2 on). Sample every "
        f"{FAST_ENOUGH / gain:.2g} s or faster"
    ]

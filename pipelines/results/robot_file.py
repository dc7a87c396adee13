"""robot.json: the fitted robot as a file, and back.

Schema `stribeck/robot/1`. Each parameter is `{"value", "stderr", "interval95", "unit", "withheld", "fixed"}`:
`inertia`, those of `positive`, `negative` and `mean`, and `torque_offset`. `runs` holds every log with
whether it was used and why not, `notes` the findings. Beside these, for the questions that come later:

- `axis` ("rotary" or "linear") and `simulated` (the logs came from a virtual rig);
- `covariance`: `{"names": ["inertia", "positive.static_torque", ...], "matrix": [[...]]}`, the joint
  covariance of the free parameters in the units of their product, from which prediction intervals are drawn;
  where one law for both directions was fitted its names are "mean.static_torque", ..., "torque_offset";
- `profiles`: by name as in `covariance`, and for those of `mean`, `{"value": [...], "rise": [...]}`: points
  of the profile likelihood, from low values to high, and the rise of chi-square over its least, all other
  parameters refitted. A 95 % interval ends where it has risen by the square of Student's quantile;
- `inertia_sources`: the inertia by each protocol that gave one;
- `breakaways`: how F_s was measured, one entry a direction: `{"direction", "used", "censored", "torque",
  "spread", "ramp_rates", "places"}`, pairs of the least and the greatest;
- `validation`: how well runs that the fit had not seen are predicted (`pipelines.results.validation_entry`);
- `campaign`: `{"name", "rig", "loop"}`, where `loop` holds the gains, the sampling and the compensator of the
  campaign's set-point runs, so far as one value holds for all of them, else null.

Only `schema`, `inertia`, `positive` and `negative` must be there. The word `paper` stands for the published
symmetric robot, in the continuous loop of figures 7 to 9.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

import numpy as np
from pydantic import ValidationError

from data.findings import Finding
from ident.estimate import (
    CURVE_PARAMETERS,
    Covariance,
    Estimate,
    IdentifiedRobot,
    ProfilePoints,
    RunUse,
)
from ident.fit.breakaway_summary import BreakawaySummary
from ident.model import published
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from ident.validation.summary import Validation
from pipelines.exit_status import RefusalError
from pipelines.results.folder import Owner, ResultFolder
from pipelines.results.robot_schema import (
    CampaignEntry,
    CompensatorEntry,
    CurveEntry,
    EstimateEntry,
    RobotDocument,
)
from pipelines.results.validation_entry import validation_entry
from pipelines.settings.loop import Compensator, LawChoice, LoopDefaults

ROBOT_SCHEMA: Final = "stribeck/robot/1"
PAPER: Final = "paper"
LARGEST_FILE: Final = 50_000_000  # bytes; a robot file is a few kB


class RobotFileError(RefusalError):
    """A robot file that cannot be used: the message names the file, the key, the rule and the remedy."""


@dataclass(frozen=True)
class RobotFile:
    """A robot to ask questions about, and the loop that its campaign ran it in."""

    name: str  # how a message calls it
    owner: Owner
    fitted: OneLinkRobot | None  # None: a parameter that it needs is withheld
    identified: IdentifiedRobot | None  # None for the paper, which has no uncertainty
    loop: LoopDefaults
    path: Path | None = None  # None for the paper

    @property
    def published(self) -> bool:
        """Whether this is the word `paper`."""
        return self.identified is None

    @property
    def simulated(self) -> bool:
        """Whether the logs behind it came from a virtual rig."""
        return self.identified is not None and self.identified.simulated

    def moving(self, law: LawChoice = "per-direction") -> OneLinkRobot:
        """The robot as it moves; raises `RobotFileError` where a parameter that it needs is withheld."""
        if self.fitted is None:
            raise RobotFileError(f"{self.name}: {'; '.join(self.missing())}")
        return self.fitted.mean() if law == "mean" else self.fitted

    def compensating(self, choice: LawChoice | None = None) -> OneLinkRobot:
        """What its controller believes; by default the campaign's compensator, else the mean law."""
        robot = self.moving()
        if choice == "per-direction":
            return robot
        if choice is None and self.loop.compensator is not None:
            return self.loop.compensator.model(robot)
        return robot.mean()

    def missing(self) -> list[str]:
        """A sentence for each reason for which something is withheld."""
        return [] if self.identified is None else withheld_parameters(self.identified)


def withheld_parameters(robot: IdentifiedRobot) -> list[str]:
    """A sentence for each reason for which parameters that the robot needs are withheld."""
    entries = {"inertia": robot.inertia}
    entries |= {f"{key}.{name}": law[name] for key, law in robot.laws().items() for name in CURVE_PARAMETERS}
    reasons: dict[str | None, list[str]] = {}
    for name, entry in entries.items():
        if entry.value is None:
            reasons.setdefault(entry.withheld, []).append(name)
    return [
        f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} withheld: {why}"
        for why, names in reasons.items()
    ]


def paper_robot() -> RobotFile:
    """The published symmetric robot in the continuous loop of figures 7 to 9, with r = 1."""
    loop = LoopDefaults(
        proportional=published.PROPORTIONAL_GAIN,
        derivative=published.DERIVATIVE_GAIN,
        observer=published.OBSERVER_GAIN,
        compensation=1.0,
        sample_period=0.0,
        resolution=0.0,
    )
    return RobotFile(
        name=PAPER, owner=Owner(PAPER), fitted=published.symmetric_robot(), identified=None, loop=loop
    )


def read_robot(source: str | Path) -> RobotFile:
    """Read a robot.json, or give the paper's robot for the word `paper`; raises `RobotFileError`."""
    if str(source) == PAPER:
        return paper_robot()
    path = Path(source)
    document = _parsed(path)
    identified = _identified(document, path)
    try:
        fitted = identified.robot()
        campaign = document.campaign
        loop = LoopDefaults() if campaign is None else _loop(campaign)
    except ModelError as broken:
        raise RobotFileError(f"{path}: {broken}") from None
    name = path.stem if campaign is None else campaign.name
    rig = "" if campaign is None else campaign.rig
    return RobotFile(
        name=path.name, owner=Owner(name, rig), fitted=fitted, identified=identified, loop=loop, path=path
    )


def write_robot(
    folder: ResultFolder,
    robot: IdentifiedRobot,
    loop: LoopDefaults,
    *,
    breakaways: Sequence[BreakawaySummary] = (),
    validation: Validation | None = None,
) -> Path:
    """Write robot.json into the folder of the robot's campaign."""
    estimates: dict[str, object] = {"inertia": robot.inertia}
    for direction, entries in (
        ("positive", robot.positive),
        ("negative", robot.negative),
        ("mean", robot.mean),
    ):
        estimates[direction] = {name: entries[name] for name in CURVE_PARAMETERS}
    values = {
        "axis": robot.axis,
        "simulated": robot.simulated,
        **estimates,
        "torque_offset": robot.torque_offset,
        "inertia_sources": robot.inertia_sources,
        "covariance": {"names": robot.covariance.names, "matrix": robot.covariance.matrix},
        "profiles": robot.profiles,
        "campaign": {"name": folder.owner.campaign, "rig": folder.owner.rig, "loop": loop},
        "breakaways": list(breakaways),
        "validation": None if validation is None else validation_entry(validation),
        "runs": robot.runs,
        "notes": robot.notes,
    }
    return folder.write_json("robot.json", ROBOT_SCHEMA, values)


def _parsed(path: Path) -> RobotDocument:
    """The file as a checked document; raises `RobotFileError` with file, key path and rule."""
    remedy = "`stribeck identify` writes one; or say `paper`"
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise RobotFileError(f"{path}: larger than any robot file ({LARGEST_FILE} bytes). {remedy}")
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except OSError as failure:
        raise RobotFileError(f"{path}: cannot be read ({failure.strerror}); {remedy}") from None
    except (ValueError, RecursionError) as failure:
        raise RobotFileError(f"{path}: not a JSON file ({failure}); {remedy}") from None
    if not isinstance(content, dict) or content.get("schema") != ROBOT_SCHEMA:
        found = content.get("schema") if isinstance(content, dict) else type(content).__name__
        raise RobotFileError(f"{path}: schema is {found!r}, a robot file has {ROBOT_SCHEMA!r}; {remedy}")
    try:
        return RobotDocument.model_validate_json(json.dumps(content))
    except ValidationError as failure:
        first = failure.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"])) or "the file"
        rule = first["msg"].removeprefix("Value error, ")
        raise RobotFileError(f"{path}: {key}: {rule}; {remedy}") from None


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is no JSON number")


def _identified(document: RobotDocument, path: Path) -> IdentifiedRobot:
    """The document as the value that `ident` handed on."""
    positive, negative = _curve(document.positive), _curve(document.negative)
    mean = _curve(document.mean) if document.mean is not None else _mean(positive, negative)
    names: tuple[str, ...] = ()
    matrix = np.zeros((0, 0))
    if document.covariance is not None:
        names = document.covariance.names
        matrix = np.array(document.covariance.matrix, dtype=np.float64).reshape(len(names), len(names))
    return IdentifiedRobot(
        inertia=_estimate(document.inertia),
        positive=positive,
        negative=negative,
        mean=mean,
        torque_offset=_estimate(document.torque_offset),
        runs=tuple(RunUse(**run.model_dump()) for run in document.runs),
        notes=tuple(Finding(**note.model_dump()) for note in document.notes),
        covariance=Covariance(names, matrix),
        inertia_sources={name: _estimate(entry) for name, entry in document.inertia_sources.items()},
        profiles={
            name: ProfilePoints(np.array(entry.value), np.array(entry.rise))
            for name, entry in document.profiles.items()
        },
        axis=document.axis,
        simulated=document.simulated,
    )


def _estimate(entry: EstimateEntry) -> Estimate:
    return Estimate(**entry.model_dump())


def _curve(entry: CurveEntry) -> dict[str, Estimate]:
    return {name: _estimate(getattr(entry, name)) for name in CURVE_PARAMETERS}


def _mean(positive: Mapping[str, Estimate], negative: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The means of the two directions, where a file holds only the two; errors add in quadrature."""
    means = {}
    for name in CURVE_PARAMETERS:
        ahead, back = positive[name], negative[name]
        if ahead.value is None or back.value is None:
            means[name] = Estimate(None, ahead.unit, withheld="a direction is withheld")
            continue
        known = ahead.stderr is not None and back.stderr is not None
        means[name] = Estimate(
            0.5 * (ahead.value + back.value),
            ahead.unit,
            stderr=0.5 * math.hypot(ahead.stderr or 0.0, back.stderr or 0.0) if known else None,
        )
    return means


def _loop(campaign: CampaignEntry) -> LoopDefaults:
    values = campaign.loop.model_dump(exclude={"compensator"})
    return LoopDefaults(**values, compensator=_compensator(campaign.loop.compensator))


def _compensator(entry: CompensatorEntry | None) -> Compensator | None:
    if entry is None:
        return None
    curves = {
        direction: StribeckCurve(**getattr(entry.friction, direction).model_dump())
        for direction in ("positive", "negative")
    }
    return Compensator(friction=StribeckFriction(**curves), inertia=entry.inertia)

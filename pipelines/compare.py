"""compare: recorded set-point runs laid over what was predicted of them, run by run and onset by onset.

`comparison.json`, schema `stribeck/comparison/1`:

- `runs`: `{"log", "r", "start", "verdict", "position_error", "amplitude", "period", "why", "predicted",
  "predicted_ideal", "predicted_symmetric"}`; a prediction is `{"verdict", "x1_min", "x1_max", "amplitude",
  "period", "why"}` (`pipelines.run_outcomes` says what the three are);
- `onset`: an entry for each start and set of gains (`pipelines.onset`): `{"start", "gains", "runs",
  "recorded", "reversals", "predicted", "predicted_interval95", "ideal", "symmetric", "why"}`; a missing end
  is null, and `why` holds the reason by field;
- `agreement`: `verdicts`, the share of the decided runs whose predicted verdict is the recorded one;
  `amplitude_rms`, of predicted less recorded amplitude where both cycle [rad];
  `equilibria_inside_predicted_set`, the share of the recorded rests that lie in the fitted robot's
  equilibrium set, give or take an encoder count;
- `excluded`, `robot`, `simulated`, `draws`, `seed`.

`comparison.csv` holds the runs, a row each, predictions with a prefix.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from compensation.bifurcation import Diagram, diagram
from compensation.closed_loop import ClosedLoop
from compensation.equilibria import equilibrium_set
from compensation.sampled_loop import Map
from data.recording import Axis, FloatArray
from ident.estimate import RunUse
from ident.model.robot import OneLinkRobot
from pipelines.onset import (
    DECIDED,
    Bracket,
    Found,
    JudgedRun,
    drawn_onsets,
    groups,
    interval95,
    middle,
    recorded_bracket,
    scanned_gains,
    smallest_cycling,
)
from pipelines.progress import Progress, Silent
from pipelines.recordings import SetPointRun
from pipelines.results.folder import ResultFolder
from pipelines.results.robot_file import RobotFile
from pipelines.run_outcomes import (
    SPENT,
    Budget,
    LoopAsRun,
    Outcome,
    Verdicts,
    as_run,
    ideal_outcomes,
    position_error,
    recorded_outcome,
    sampled_outcomes,
    unpredicted,
)
from pipelines.settings.loop import LawChoice

COMPARISON_SCHEMA: Final = "stribeck/comparison/1"
DRAWS: Final = 40
ONSET_SAMPLES: Final = 24_000_000  # that the searches for all onsets may run: seconds of computing
DIAGRAM_POINTS: Final = 101
PREDICTIONS: Final = ("predicted", "predicted_ideal", "predicted_symmetric")


@dataclass(frozen=True)
class ComparedRun:
    """A recorded run beside its three predictions."""

    judged: JudgedRun
    predicted: Outcome
    predicted_ideal: Outcome
    predicted_symmetric: Outcome

    def row(self) -> dict[str, object]:
        """As comparison.json holds it."""
        seen = self.judged.seen
        return {
            "log": self.judged.run.recording.log,
            "r": self.judged.gain,
            "start": self.judged.start,
            "verdict": seen.verdict,
            "position_error": rest_of(self),
            "amplitude": seen.amplitude,
            "period": seen.period,
            "why": seen.why,
            "predicted": self.predicted,
            "predicted_ideal": self.predicted_ideal,
            "predicted_symmetric": self.predicted_symmetric,
        }


@dataclass(frozen=True)
class Onset:
    """Recorded and predicted onset for a start and a set of gains."""

    group: tuple[JudgedRun, ...]
    recorded: Bracket
    predicted: Found
    interval: tuple[float | None, float | None] | None
    interval_why: str | None
    ideal: Found
    symmetric: Found

    def row(self) -> dict[str, object]:
        """As comparison.json holds it."""
        run = middle(self.group)
        setting = run.run.set_point
        missing = {
            "recorded": self.recorded.why,
            "predicted": self.predicted.why,
            "predicted_interval95": self.interval_why,
            "ideal": self.ideal.why,
            "symmetric": self.symmetric.why,
        }
        return {
            "start": run.start,
            "gains": {
                "proportional_gain": setting.proportional_gain,
                "derivative_gain": setting.derivative_gain,
                "observer_gain": setting.observer_gain,
            },
            "runs": len(self.group),
            "recorded": (self.recorded.resting, self.recorded.cycling),
            "reversals": self.recorded.reversals,
            "predicted": self.predicted.r,
            "predicted_interval95": self.interval,
            "ideal": self.ideal.r,
            "symmetric": self.symmetric.r,
            "why": {field: why for field, why in missing.items() if why is not None},
        }


@dataclass(frozen=True)
class Comparison:
    """All of comparison.json."""

    robot: str
    runs: tuple[ComparedRun, ...]
    onsets: tuple[Onset, ...]
    excluded: tuple[RunUse, ...]
    agreement: dict[str, object]
    diagrams: tuple[Diagram, ...]  # of the fitted and of the symmetric robot, continuous
    simulated: bool
    draws: int
    seed: int
    withheld: tuple[str, ...]


def compare(
    runs: Sequence[SetPointRun],
    source: RobotFile,
    *,
    map: Map = map,
    law: LawChoice = "per-direction",
    compensator: LawChoice | None = None,
    excluded: tuple[RunUse, ...] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Classify the recorded runs, predict each from its own start, and find the onsets.

    `map` spreads the predictions of loops as they ran. What a withheld parameter leaves open has no
    prediction, and the reason.
    """
    withheld = source.missing()
    judged = tuple(_judged(run, source, law, compensator) for run in runs)
    predictions = (
        _predictions(judged, partial(sampled_outcomes, map=map))
        if not withheld
        else _nothing(judged, "; ".join(withheld))
    )
    compared = tuple(ComparedRun(*row) for row in zip(judged, *predictions, strict=True))
    generator = np.random.default_rng(seed)
    drawn = () if source.identified is None else source.identified.draws(DRAWS, generator)
    if law == "mean":
        drawn = tuple(robot.mean() for robot in drawn)
    grouped = groups(judged)
    tick = (progress or Silent()).stage("finding onsets", len(grouped))
    onsets = []
    for group in grouped:
        budget = Budget(ONSET_SAMPLES // len(grouped))
        sampled = partial(sampled_outcomes, map=map, budget=budget)
        onsets.append(_onset(group, drawn, sampled, budget, "; ".join(withheld)))
        tick(1)
    return Comparison(
        robot=source.name,
        runs=compared,
        onsets=tuple(onsets),
        excluded=excluded,
        agreement=_agreement(compared),
        diagrams=() if withheld else _diagrams(judged),
        simulated=any(run.recording.simulated for run in runs),
        draws=len(drawn),
        seed=seed,
        withheld=tuple(withheld),
    )


def _judged(run: SetPointRun, source: RobotFile, law: LawChoice, compensator: LawChoice | None) -> JudgedRun:
    seen = recorded_outcome(run)
    start = float(position_error(run)[0])
    if source.fitted is None:
        return JudgedRun(run, seen, start, None)
    fitted = source.fitted
    model = fitted if compensator == "per-direction" else fitted.mean()
    if compensator is None and run.compensator is not None:
        model = run.compensator.model(fitted)
    return JudgedRun(run, seen, start, as_run(run, source.moving(law), model))


def _predictions(runs: Sequence[JudgedRun], sampled: Verdicts) -> Sequence[tuple[Outcome, ...]]:
    """As it ran, ideal, symmetric; of each run."""
    loops = [run.loop for run in runs if run.loop is not None]
    return sampled(loops), ideal_outcomes(loops), ideal_outcomes([_symmetric(loop) for loop in loops])


def _nothing(runs: Sequence[JudgedRun], why: str) -> Sequence[tuple[Outcome, ...]]:
    return [tuple(unpredicted(why) for _ in runs) for _ in PREDICTIONS]


def _symmetric(loop: LoopAsRun) -> LoopAsRun:
    return loop.moved_by(loop.robot.mean())


def write_comparison(folder: ResultFolder, comparison: Comparison) -> dict[str, object]:
    """Write comparison.json and comparison.csv; returns what the first holds."""
    rows = [run.row() for run in comparison.runs]
    values: dict[str, object] = {
        "robot": comparison.robot,
        "simulated": comparison.simulated,
        "runs": rows,
        "onset": [onset.row() for onset in comparison.onsets],
        "agreement": comparison.agreement,
        "excluded": [{"log": use.log, "why": use.why} for use in comparison.excluded],
        "draws": comparison.draws,
        "seed": comparison.seed,
    }
    folder.write_json("comparison.json", COMPARISON_SCHEMA, values)
    own = ("log", "r", "start", "verdict", "position_error", "amplitude", "period", "why")
    parts = ("verdict", "x1_min", "x1_max", "amplitude", "period")
    folder.write_csv(
        "comparison.csv",
        [*own, *(f"{prediction}_{part}" for prediction in PREDICTIONS for part in parts)],
        [
            [*(row[name] for name in own), *(getattr(row[p], part) for p in PREDICTIONS for part in parts)]
            for row in rows
        ],
    )
    return values


def write_figure10(folder: ResultFolder, comparison: Comparison, *, axis: Axis) -> None:
    """figure10.svg: the runs as comparison.json has them, over the diagrams."""
    from pipelines.report.comparison_figure import figure10  # noqa: PLC0415  (matplotlib)
    from pipelines.report.style import svg_text  # noqa: PLC0415

    document = json.loads((folder.path / "comparison.json").read_text(encoding="utf-8"))
    fitted, symmetric = comparison.diagrams if comparison.diagrams else (None, None)
    picture = figure10(
        document, fitted=fitted, symmetric=symmetric, axis=axis, simulated=comparison.simulated
    )
    folder.write_text("figure10.svg", svg_text(picture))


def _onset(
    group: tuple[JudgedRun, ...],
    drawn: Sequence[OneLinkRobot],
    sampled: Verdicts,
    budget: Budget,
    withheld: str,
) -> Onset:
    loop, recorded = middle(group).loop, recorded_bracket(group)
    if loop is None:
        unknown = Found(None, withheld)
        return Onset(group, recorded, unknown, None, withheld, unknown, unknown)
    gains = scanned_gains(group)
    predicted = smallest_cycling(loop, gains, sampled)
    interval, why = None, predicted.why
    if predicted.r is not None and not drawn:
        why = "the robot has no uncertainty to draw from"
    elif predicted.r is not None:
        limits = (float(gains[0]), float(gains[-1]))
        ends = interval95(drawn_onsets(loop, drawn, sampled, around=predicted.r, limits=limits))
        interval, why = (None, SPENT) if budget.left <= 0 else (ends, None)
        if interval is not None and None in interval:
            why = "an end lies beyond the r that were searched"
    ideal = smallest_cycling(loop, gains, ideal_outcomes)
    symmetric = smallest_cycling(_symmetric(loop), gains, ideal_outcomes)
    return Onset(group, recorded, predicted, interval, why, ideal, symmetric)


def _diagrams(runs: Sequence[JudgedRun]) -> tuple[Diagram, ...]:
    """The diagrams of the fitted and of the symmetric robot over the recorded r; none without two r."""
    loop = next((run.loop for run in runs if run.loop is not None), None)
    recorded = [run.gain for run in runs]
    if loop is None or min(recorded) == max(recorded):
        return ()
    values = np.linspace(min(recorded), max(recorded), DIAGRAM_POINTS)
    return tuple(
        diagram(ClosedLoop(robot, loop.controller), "r", values) for robot in (loop.robot, loop.robot.mean())
    )


def _agreement(runs: Sequence[ComparedRun]) -> dict[str, object]:
    decided = [run for run in runs if run.judged.seen.verdict in DECIDED and run.predicted.verdict in DECIDED]
    same = [run for run in decided if run.judged.seen.verdict == run.predicted.verdict]
    cycles = [(run.predicted.amplitude, run.judged.seen.amplitude) for run in same if run.judged.seen.cycles]
    gaps: FloatArray = np.array([a - b for a, b in cycles if a is not None and b is not None])
    rests = [run for run in runs if run.predicted.verdict is not None and rest_of(run) is not None]
    return {
        "verdicts": len(same) / len(decided) if decided else None,
        "verdicts_same": len(same),
        "verdicts_compared": len(decided),
        "amplitude_rms": float(np.sqrt(np.mean(gaps**2))) if gaps.size else None,
        "equilibria_inside_predicted_set": sum(map(_inside, rests)) / len(rests) if rests else None,
    }


def rest_of(run: ComparedRun) -> float | None:
    """Where a recorded run rests, x1 [rad]; None where it does not."""
    return run.judged.seen.x1_min if run.judged.seen.verdict == "equilibrium" else None


def _inside(run: ComparedRun) -> bool:
    """Whether a recorded rest lies in the equilibrium set of the fitted robot, give or take a count."""
    loop, error = run.judged.loop, rest_of(run)
    if error is None or loop is None:
        return False
    spare = max(loop.sampling.resolution, 1e-9)
    segments = equilibrium_set(loop.robot, loop.controller).segments
    return any(segment.x1_min - spare <= error <= segment.x1_max + spare for segment in segments)

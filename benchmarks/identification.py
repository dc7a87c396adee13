"""How true the whole way is: simulated campaigns, recorded, identified and compared, against the truth.

    python -m benchmarks.identification [--quick] [--json]

Each round records the demo's campaign with another seed of its noise, runs everything on it, and compares
with the truth that the virtual rig kept: errors of the nine free values, how
many of them lie inside their 95 % intervals, whether every set-point run's verdict is as predicted, and how
far the predicted onset lies outside the recorded bracket.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.rows import Row, figure, show
from pipelines.progress import shown_progress, told
from pipelines.results.folder import Owner, open_results
from pipelines.settings.campaign import load_campaign
from pipelines.virtual.demo_campaign import demo_campaign_text
from pipelines.virtual_rig import record
from pipelines.whole_run import RunOptions, run_campaign

ROUNDS: Final = 5
TARGETS: Final = {  # largest relative error
    "static_torque": 0.02,
    "coulomb_torque": 0.02,
    "viscous_damping": 0.04,
    "stribeck_velocity": 0.08,
}
INERTIA_TARGET: Final = 0.02
INSIDE_TARGET: Final = 8  # of the nine free values
ONSET_TARGET: Final = 0.02  # in r, outside the recorded bracket


def rows(quick: bool) -> list[Row]:
    """Worst figures over the rounds."""
    found = [_round(seed, quick) for seed in range(1, 2 if quick else ROUNDS + 1)]
    cases = found[0].keys()
    worst = {case: (min if case.startswith("inside") else max)(one[case] for one in found) for case in cases}
    return [figure(f"demo {case}", worst[case], _target(case), _unit(case)) for case in cases]


def main() -> None:
    """As a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.identification")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="one small campaign")
    asked = parser.parse_args()
    show(rows(asked.quick), as_json=asked.json)


def _round(seed: int, quick: bool) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "demo"
        path = out / "campaign" / "campaign.toml"
        path.parent.mkdir(parents=True)
        text = re.sub(r"(?m)^seed( *)= \d+", rf"seed\1= {seed}", demo_campaign_text(quick))
        path.write_text(text, encoding="utf-8")
        with shown_progress(quiet=True) as progress:
            record(load_campaign(path, logs_exist=False), path.parent, told(progress, "recording"))
            folder = open_results(out, Owner("demo", "benchmark"), force=True)
            run_campaign(load_campaign(path), folder, RunOptions(), command="run", progress=progress)
        truth = json.loads((path.parent / "truth.json").read_text(encoding="utf-8"))
        robot = json.loads((out / "robot.json").read_text(encoding="utf-8"))
        comparison = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    return dict(_judged(robot, truth)) | _compared(comparison)


def _judged(robot: dict[str, Any], truth: dict[str, Any]) -> Iterator[tuple[str, float]]:
    inside = int(_holds(robot["inertia"], truth["inertia"]))
    yield "error inertia", _error(robot["inertia"], truth["inertia"])
    for direction in ("positive", "negative"):
        for name in TARGETS:
            estimate, true = robot[direction][name], truth[direction][name]
            inside += int(_holds(estimate, true))
            yield f"error {direction} {name}", _error(estimate, true)
    yield "inside 95 % intervals, of 9", inside


def _compared(comparison: dict[str, Any]) -> dict[str, float]:
    runs: Sequence[dict[str, Any]] = comparison["runs"]
    wrong = sum(run["verdict"] != run["predicted"]["verdict"] for run in runs)
    outside = [_outside(onset["predicted"], onset["recorded"]) for onset in comparison["onset"]]
    symmetric = [_outside(onset["symmetric"], onset["recorded"]) for onset in comparison["onset"]]
    return {
        f"verdicts other than predicted, of {len(runs)}": wrong,
        "onset outside the recorded bracket": max(outside),
        "symmetric onset outside the recorded bracket": max(symmetric),
    }


def _error(estimate: dict[str, Any], true: float) -> float:
    return abs(float(estimate["value"]) / true - 1.0)


def _holds(estimate: dict[str, Any], true: float) -> bool:
    low, high = estimate["interval95"]
    return (low is None or low <= true) and (high is None or true <= high)


def _outside(predicted: float, recorded: Sequence[float]) -> float:
    low, high = recorded
    return max(0.0, low - predicted, predicted - high)


def _target(case: str) -> float | None:
    if case == "error inertia":
        return INERTIA_TARGET
    if case.startswith("inside"):
        return INSIDE_TARGET
    if case.startswith("verdicts"):
        return 0
    if case.startswith("onset"):
        return ONSET_TARGET
    return TARGETS.get(case.rsplit(" ", maxsplit=1)[-1])


def _unit(case: str) -> str:
    if "onset" in case:
        return "r"
    return "relative" if case.startswith("error") else "count"


if __name__ == "__main__":
    main()

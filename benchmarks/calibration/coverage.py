"""Whether 95 % intervals hold the truth in 95 % of campaigns, and what plain lmfit's hold on the same.

    python -m benchmarks.calibration --only coverage

Coverage counts over all campaigns of a design: a withheld parameter claims nothing, an open interval is an
interval. Beside each share stand the parts of the campaigns in which the parameter was withheld and in which
its interval had two ends, and how many of the latter miss. lmfit is given the same points and asked as its
manual's first page does: least squares, a start read off the map, the covariance scaled by chi-square, and
value +- 1.96 stderr.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Final

import lmfit
import numpy as np
from scipy.stats import beta

from benchmarks.calibration.synthetic import DESIGNS, Campaign, Design, campaign
from benchmarks.rows import Row, figure
from data.recording import FloatArray
from ident.estimate import Estimate
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import Assumptions
from ident.fit.law_model import DIRECTIONS, SIGN, Direction
from ident.fit.one_stage import explain

CAMPAIGNS: Final = 1000  # a design
QUICK: Final = 10
PLAIN: Final = 300  # campaigns of a design that lmfit gets
SEED: Final = 4
CURVE: Final = ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping")
UNKNOWABLE: Final[Mapping[str, frozenset[str]]] = {
    "no-low-speeds": frozenset({"static_torque", "stribeck_velocity"})
}


@dataclass(frozen=True)
class Claim:
    """What was said of one parameter of one campaign."""

    design: str
    direction: str
    parameter: str
    held: bool  # the interval holds the truth; a withheld one claims nothing that could be wrong
    withheld: bool
    bounded: bool  # an interval with two ends was given


def rows(quick: bool) -> list[Row]:
    """A row for each cell, and the summaries."""
    number = QUICK if quick else CAMPAIGNS
    ours, plain = claims(DESIGNS, number, plain=min(number, PLAIN))
    return [*cell_rows("coverage", ours), *_summaries(ours), *cell_rows("lmfit coverage", plain)]


def claims(designs: Sequence[Design], number: int, *, plain: int) -> tuple[list[Claim], list[Claim]]:
    """Ours of `number` campaigns a design, and plain lmfit's of the first `plain` of them."""
    tasks = [(design, seed) for design in designs for seed in range(number)]
    ours: list[Claim] = []
    theirs: list[Claim] = []
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        for mine, peers in pool.imap_unordered(partial(_judged, plain=plain), tasks, chunksize=5):
            ours += mine
            theirs += peers
    return ours, theirs


def drawn(design: Design, seed: int) -> Campaign:
    """Campaign number `seed` of a design: the same in any process and any order."""
    return campaign(design, np.random.default_rng([SEED, zlib.crc32(design.name.encode()), seed]))


def cell_rows(case: str, found: Sequence[Claim]) -> list[Row]:
    """A row for each design, direction and parameter."""
    cells: dict[tuple[str, str, str], list[Claim]] = {}
    for claim in found:
        cells.setdefault((claim.design, claim.direction, claim.parameter), []).append(claim)
    return [_row(f"{case} {' '.join(cell)}", members) for cell, members in sorted(cells.items())]


def identified(claim: Claim) -> bool:
    """Whether the design tells this parameter."""
    return claim.parameter not in UNKNOWABLE.get(claim.design, frozenset())


def _summaries(found: Sequence[Claim]) -> list[Row]:
    good = [claim for claim in found if claim.design == "good"]
    blind = [claim for claim in found if claim.design == "no-low-speeds"]
    velocity = [claim for claim in blind if claim.parameter == "stribeck_velocity"]
    bounded = [claim for claim in found if claim.bounded]
    return [
        _row("coverage all", [claim for claim in found if identified(claim)]),
        figure("withheld on the good design", _share([c.withheld for c in good]), 0.02, "-"),
        figure("v_s withheld without low speeds", _share([c.withheld for c in velocity]), 0.9, "-"),
        figure("bounded intervals that miss", _share([not c.held for c in bounded]), 0.05, "-"),
    ]


def _row(case: str, members: Sequence[Claim]) -> Row:
    held, n = sum(claim.held for claim in members), len(members)
    low, high = binomial_interval(held, n)
    bounded = [claim for claim in members if claim.bounded]
    return {
        **figure(case, held / n, 0.95, "-"),
        "n": n,
        "withheld": _share([claim.withheld for claim in members]),
        "low": low,
        "high": high,
        "bounded": len(bounded) / n,
        "bounded_misses": _share([not claim.held for claim in bounded]),
    }


def binomial_interval(held: int, n: int) -> tuple[float, float]:
    """95 % interval of a share (Clopper and Pearson 1934)."""
    low = float(beta.ppf(0.025, held, n - held + 1)) if held else 0.0
    high = float(beta.ppf(0.975, held + 1, n - held)) if held < n else 1.0
    return low, high


def _share(flags: Sequence[bool]) -> float:
    return float(np.mean(flags)) if flags else 0.0


def _judged(task: tuple[Design, int], *, plain: int) -> tuple[list[Claim], list[Claim]]:
    design, seed = task
    made = drawn(design, seed)
    ours = list(judge(design, made))
    return ours, list(judge_plain(design, made)) if seed < plain else []


def judge(design: Design, made: Campaign) -> Iterator[Claim]:
    """What identification says of a campaign."""
    assumptions = Assumptions(shape="free" if design.free_beta else "fixed")
    values = explain(made.evidence, axis="rotary", assumptions=assumptions).values
    yield _claim(design, "both", "inertia", values.inertia, made.robot.inertia)
    for direction in DIRECTIONS:
        truth = getattr(made.robot.friction, direction)
        for name in (*CURVE, "stribeck_shape") if design.free_beta else CURVE:
            yield _claim(design, direction, name, values.curves[direction][name], getattr(truth, name))


def _claim(design: Design, direction: str, name: str, estimate: Estimate, truth: float) -> Claim:
    low, high = estimate.interval95 or (None, None)
    held = (low is None or low <= truth) and (high is None or truth <= high)
    bounded = low is not None and high is not None
    return Claim(design.name, direction, name, held, estimate.value is None, bounded)


def judge_plain(design: Design, made: Campaign) -> Iterator[Claim]:
    """What lmfit's standard errors say of a campaign."""
    for direction in DIRECTIONS:
        truth = getattr(made.robot.friction, direction)
        result = _plain_fit(made.evidence, direction, free_beta=design.free_beta)
        for name in (*CURVE, "stribeck_shape") if design.free_beta else CURVE:
            value, error = result.params[name].value, result.params[name].stderr
            known = error is not None and bool(np.isfinite(error))
            held = not known or abs(value - getattr(truth, name)) <= 1.96 * error
            yield Claim(design.name, direction, name, bool(held), not known, known)


def _plain_fit(
    evidence: Evidence, direction: Direction, *, free_beta: bool
) -> lmfit.minimizer.MinimizerResult:
    sign = SIGN[direction]
    runs = [run for run in evidence.used_runs if run.direction == sign]
    starts = [start for start in evidence.used_starts if start.direction == sign]
    speed = np.array([abs(run.velocity) for run in runs] + [0.0] * len(starts))
    torque = sign * np.array([run.torque for run in runs] + [start.torque for start in starts])
    slope = float((torque[speed.argmax()] - torque.min()) / speed.max())
    asked = lmfit.Parameters()
    asked.add("static_torque", value=float(torque.max()), min=0.0)
    asked.add("coulomb_torque", value=float(torque.min()), min=0.0)
    asked.add("stribeck_velocity", value=0.05 * float(speed.max()), min=1e-9)
    asked.add("viscous_damping", value=max(slope, 1e-3 * float(torque.max() / speed.max())), min=0.0)
    asked.add("stribeck_shape", value=1.0, min=0.05, max=8.0, vary=free_beta)

    def misfit(at: lmfit.Parameters) -> FloatArray:
        v = at.valuesdict()
        fading = np.exp(-((speed / v["stribeck_velocity"]) ** v["stribeck_shape"]))
        dry = v["coulomb_torque"] + (v["static_torque"] - v["coulomb_torque"]) * fading
        return np.asarray(torque - dry - v["viscous_damping"] * speed)

    with np.errstate(all="ignore"):
        return lmfit.minimize(misfit, asked)

"""Advice against what the advised runs really bring, and against what is plainly true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.advice import Advice, advise
from ident.evidence.gathering import Evidence
from ident.fit.friction_fit import FrictionFit, fit_friction
from ident.fit.law_model import EACH
from ident.fit.weighting import Weighted, settle
from tests.ident.test_coverage import ROBOT, synthetic_map

FAST_ONLY = np.asarray(np.linspace(0.15, 2.0, 12), dtype=np.float64)
SPREAD = 2e-3


@pytest.fixture(scope="module")
def settled() -> tuple[Evidence, Weighted]:
    evidence = synthetic_map(FAST_ONLY, SPREAD, np.random.default_rng(2))
    return evidence, settle(evidence, EACH)


def of(advice: tuple[Advice, ...], quantity: str, direction: str = "positive") -> Advice:
    return next(one for one in advice if one.quantity == quantity and one.direction == direction)


def test_where_the_bend_is_missing_slow_speeds_are_asked_for(settled: tuple[Evidence, Weighted]) -> None:
    advice = of(advise(*settled), "stribeck_velocity")
    speeds = [run.speed for run in advice.runs if run.speed is not None]
    assert min(speeds) < FAST_ONLY.min()
    assert all(run.direction == "positive" for run in advice.runs)
    assert advice.reduction is None or advice.reduction > 0.3
    widths = [run.half_width for run in advice.runs]
    assert widths == sorted(widths, reverse=True)


def test_breakaways_are_asked_for_where_the_static_torque_is(settled: tuple[Evidence, Weighted]) -> None:
    runs = of(advise(*settled), "static_torque", "negative").runs
    assert {run.protocol for run in runs} == {"breakaway"}
    assert sum(run.times for run in runs) == 6


def test_without_an_inertia_no_critical_gain_is_promised(settled: tuple[Evidence, Weighted]) -> None:
    advice = of(advise(*settled), "critical_observer_gain")
    assert advice.runs == ()
    assert advice.why_none is not None
    assert "inertia" in advice.why_none


def test_the_promised_error_is_the_one_that_comes(settled: tuple[Evidence, Weighted]) -> None:
    """The advised runs are added to the data with the same errors: the fit's own error is as foretold."""
    evidence, weighted = settled
    advice = of(advise(evidence, weighted), "stribeck_velocity")
    data, curve = weighted.data, ROBOT.friction.positive
    error = float(np.median(data.run_stderr))
    for run in advice.runs:
        if run.speed is None:
            continue
        more = np.full(run.times, run.speed)
        data = replace(
            data,
            run_direction=np.append(data.run_direction, np.ones(run.times, dtype=np.int64)),
            speed=np.append(data.speed, more),
            torque=np.append(data.torque, curve.total(more)),
            acceleration=np.append(data.acceleration, 0.0 * more),
            run_stderr=np.append(data.run_stderr, 0.0 * more + error),
        )
    after = fit_friction(data, start=weighted.fit)
    promised = float(advice.half_width_then or 0.0) / float(advice.half_width_now or np.inf)
    assert _error(after) / _error(weighted.fit) == pytest.approx(promised, rel=0.25)


def _error(fit: FrictionFit) -> float:
    where = fit.free.index("positive_stribeck_velocity")
    return float(np.sqrt(fit.covariance[where, where])) / fit.values["positive_stribeck_velocity"]

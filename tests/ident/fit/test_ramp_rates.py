"""The trend of F_s over ramp rates: no false alarms, and the truth at zero rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.evidence.breakaway import RampLine
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import DEFAULT
from ident.fit.map_points import friction_map
from ident.fit.one_stage import explain
from ident.fit.ramp_rates import rate_trend, trend_finding
from tests.ident.test_coverage import ROBOT, _start, synthetic_map

SPREAD = 0.005
Law = Callable[[FloatArray], FloatArray]
LINEAR: Law = lambda rate: np.asarray(0.1 * rate)  # noqa: E731
LOGARITHMIC: Law = lambda rate: np.asarray(0.03 * np.log1p(rate / 0.05))  # noqa: E731


def _ramps(
    effect: Law, rates: tuple[float, ...], generator: np.random.Generator, *, each: int = 3
) -> tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray, FloatArray]:
    direction = np.repeat(np.array([1, -1], dtype=np.int64), len(rates) * each)
    rate = np.tile(np.repeat(rates, each), 2)
    torque = 0.55 + effect(rate) + SPREAD * generator.standard_normal(rate.size)
    return direction, rate, torque, np.full(rate.size, SPREAD), np.zeros(rate.size)


def test_no_trend_is_seen_where_there_is_none() -> None:
    generator = np.random.default_rng(1)
    seen = [rate_trend(*_ramps(np.zeros_like, (0.05, 0.1, 0.3), generator)) for _ in range(250)]
    assert sum(trend is not None for trend in seen) <= 5


@pytest.mark.parametrize(("effect", "shape"), [(LINEAR, "linear"), (LOGARITHMIC, "logarithmic")])
def test_the_value_at_zero_rate_lies_where_its_error_says(effect: Law, shape: str) -> None:
    generator = np.random.default_rng(2)
    trends = [rate_trend(*_ramps(effect, (0.02, 0.05, 0.12, 0.3, 0.7), generator)) for _ in range(60)]
    zero = [trend.zero[1] for trend in trends if trend is not None]
    assert len(zero) == 60
    assert np.mean([abs(own.torque - 0.55) < 2.06 * own.stderr for own in zero]) > 0.88
    assert sum(trend is not None and trend.shape == shape for trend in trends) > 45
    assert all(own.widening > 1.0 for own in zero)


def test_a_delay_that_is_wrong_in_all_ramps_is_no_trend() -> None:
    late: Law = lambda rate: np.asarray(0.05 * rate)  # noqa: E731
    direction, rate, torque, stderr, none = _ramps(late, (0.05, 0.1, 0.4), np.random.default_rng(5), each=6)
    assert rate_trend(direction, rate, torque, stderr, none) is not None
    assert rate_trend(direction, rate, torque, stderr, 0.01 * rate / 0.4) is None


def test_one_rate_tells_no_trend() -> None:
    generator = np.random.default_rng(3)
    assert rate_trend(*_ramps(LINEAR, (0.1, 0.105), generator, each=6)) is None


def _campaign(effect: Law, generator: np.random.Generator) -> Evidence:
    starts = []
    for sign, curve in ((1, ROBOT.friction.positive), (-1, ROBOT.friction.negative)):
        for rate in np.repeat([0.05, 0.15, 0.4], 3):
            torque = curve.static_torque + float(effect(rate)) + 3e-3 * float(generator.standard_normal())
            line = RampLine(sign * torque, 1e-4, sign * float(rate), 0.0)
            starts.append(replace(_start(sign, sign * torque), line=line, travel=1e-9))
    speeds = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)
    return replace(synthetic_map(speeds, 3e-3, generator), starts=tuple(starts))


def test_the_fit_takes_the_value_at_zero_rate_and_says_so() -> None:
    found = explain(_campaign(LINEAR, np.random.default_rng(4)), axis="rotary", assumptions=DEFAULT)
    trend = found.weighted.data.trend
    assert trend is not None
    assert trend.zero[1].rise == pytest.approx(0.04, rel=0.3)
    told = [finding.text for finding in found.findings if finding.code == "E-CREEP"]
    assert told == [trend_finding(trend, unit="N m").text]
    for direction, curve in (("positive", ROBOT.friction.positive), ("negative", ROBOT.friction.negative)):
        estimate = found.values.curves[direction]["static_torque"]  # type: ignore[index]  # both are keys
        assert estimate.stderr is not None
        assert estimate.value == pytest.approx(curve.static_torque, abs=4 * estimate.stderr)


def test_the_friction_map_keeps_what_was_measured_beside_what_is_fitted() -> None:
    evidence = _campaign(LINEAR, np.random.default_rng(4))
    weighted = explain(evidence, axis="rotary", assumptions=DEFAULT).weighted
    points = [point for point in friction_map(evidence, weighted) if point.protocol == "breakaway"]
    assert [point.torque for point in points] == pytest.approx([start.torque for start in evidence.starts])
    taken_off = [point.direction * (point.torque - (point.fitted or 0.0)) for point in points]
    rates = np.array([abs(start.line.rate) for start in evidence.starts])
    assert taken_off == pytest.approx(LINEAR(rates), abs=0.015)
    assert max(taken_off[:3]) < min(taken_off[6:9])

"""Intervals hold what they promise: synthetic friction maps, fitted over and over.

A smaller copy of what the calibration benchmark is for; both directions of a map are two trials.
"""

from __future__ import annotations

import numpy as np

from data.recording import FloatArray
from ident.evidence.breakaway import Breakaway, RampLine
from ident.evidence.friction_map import SteadyRun
from ident.evidence.gathering import Evidence
from ident.evidence.hunting import Swing
from ident.fit.law_model import EACH
from ident.fit.parameters import parameters
from ident.fit.weighting import settle
from ident.model.published import asymmetric_robot

MAPS = 24
NAMES = ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping")
ROBOT = asymmetric_robot()


def _run(velocity: float, torque: float, white: float) -> SteadyRun:
    return SteadyRun(
        log=f"{velocity:.4g}",
        velocity=velocity,
        velocity_stderr=1e-6 * abs(velocity),
        torque=torque,
        acceleration=0.0,
        white_stderr=white,
        block_ratio=1.0,
        travel=5.0 * abs(velocity),
        swing=Swing(0.0, 0.0, 1e-3),
        start_time=0.0,
        end_time=5.0,
    )


def _start(direction: int, torque: float) -> Breakaway:
    return Breakaway(
        log="ramp",
        direction=direction,
        line=RampLine(torque, 1e-4, direction * 1e-9, 0.0),  # so slow that detection costs nothing
        travel=1e-6,
        travel_stderr=0.0,
        place=0.0,
        onset_time=1.0,
        onset=1000,
        end=1001,
        end_time=1.001,
    )


def synthetic_map(speeds: FloatArray, spread: float, generator: np.random.Generator) -> Evidence:
    runs, starts = [], []
    for sign, curve in ((1, ROBOT.friction.positive), (-1, ROBOT.friction.negative)):
        error = spread * generator.standard_normal(speeds.size)
        runs += [
            _run(sign * float(v), sign * (float(curve.total(v)) + float(e)), 2e-4)
            for v, e in zip(speeds, error, strict=True)
        ]
        starts += [
            _start(sign, sign * (curve.static_torque + spread * float(generator.standard_normal())))
            for _ in range(5)
        ]
    return Evidence(tuple(runs), tuple(starts), (), None, {})


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    generator = np.random.default_rng(20)
    speeds = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)
    held, trials = 0, 0
    for _ in range(MAPS):
        weighted = settle(synthetic_map(speeds, 2e-3, generator), EACH)
        found = parameters(weighted.data, weighted.fit, axis="rotary")
        for direction, curve in (
            ("positive", ROBOT.friction.positive),
            ("negative", ROBOT.friction.negative),
        ):
            for name in NAMES:
                interval = found.curves[direction][name].interval95  # type: ignore[index]  # both are keys
                assert interval is not None
                low, high = interval
                assert low is not None
                assert high is not None
                held += low <= getattr(curve, name) <= high
                trials += 1
    # 95 % of 192 correlated trials, give or take two standard errors.
    assert 0.90 <= held / trials <= 0.99

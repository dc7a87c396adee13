"""The mean torque of a run whose speed swings is not the law at its mean speed, and is not taken for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.evidence.frequency_response import FrequencyInertia
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import DEFAULT
from ident.fit.one_stage import explain
from ident.fit.weighting import SWAY_TAKEN
from tests.ident.test_coverage import ROBOT, synthetic_map

SPEEDS = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(20)
SWING = 0.03  # [rad/s], as the torque's momentum has it
KNOWN = 0.026  # J [kg m^2]


def _swinging(told: bool) -> Evidence:
    """A map whose runs around v_s swing in speed; whether their momentum tells."""
    evidence = synthetic_map(SPEEDS, 2e-4, np.random.default_rng(3))
    runs = []
    for run in evidence.runs:
        curve = ROBOT.friction.positive if run.direction > 0 else ROBOT.friction.negative
        speed = abs(run.velocity)
        if speed < 0.06:
            runs.append(run)
            continue
        swung = speed + SWING * SWAY_TAKEN**0.5 * NODES
        mean = float(WEIGHTS @ curve.total(np.abs(swung)) / WEIGHTS.sum())
        more = run.direction * (mean - float(curve.total(np.array([speed]))[0]))
        momentum = (SWING * KNOWN) ** 2 if told else 0.0
        runs.append(replace(run, torque=run.torque + more, momentum_variance=momentum))
    return replace(evidence, runs=tuple(runs), response=FrequencyInertia(KNOWN, 1e-4 * KNOWN, 20, 2.0, ()))


@pytest.mark.parametrize("told", [True, False])
def test_a_swinging_speed_bends_no_law_where_the_torque_tells_of_it(told: bool) -> None:
    values = explain(_swinging(told), axis="rotary", assumptions=DEFAULT).values
    off = []
    for direction, curve in (("positive", ROBOT.friction.positive), ("negative", ROBOT.friction.negative)):
        estimate = values.curves[direction]["stribeck_velocity"]  # type: ignore[index]  # both are keys
        assert estimate.value is not None
        assert estimate.stderr is not None
        off.append(abs(estimate.value - curve.stribeck_velocity) / estimate.stderr)
    assert (max(off) < 3.0) is told

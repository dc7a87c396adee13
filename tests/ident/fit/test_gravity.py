"""Gravity that no single run shows is found between them, taken out, and leaves the law as it is."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.gathering import Evidence
from ident.evidence.ripple_correction import ripple_findings
from ident.fit.assumptions import DEFAULT
from ident.fit.gravity import without_gravity
from ident.fit.one_stage import explain
from tests.ident.test_coverage import ROBOT, synthetic_map

SPEEDS = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)
EXPLAIN = partial(explain, axis="rotary", assumptions=DEFAULT)


def _campaign(amplitude: float) -> tuple[list[Recording], Evidence]:
    """Runs that each stay at their own place, under amplitude sin(q + 0.5)."""
    generator = np.random.default_rng(1)
    evidence = synthetic_map(SPEEDS, 2e-3, generator)
    recordings, runs, starts = [], [], []

    def placed(log: str) -> float:
        place = float(generator.uniform(-3.0, 3.0))
        time = np.linspace(0.0, 5.0, 20)
        recordings.append(Recording(log, "constant_velocity", time, np.full(20, place), np.zeros(20)))
        return place

    for run in evidence.runs:
        more = amplitude * float(np.sin(placed(run.log) + 0.5))
        runs.append(replace(run, torque=run.torque + more))
    for number, start in enumerate(evidence.starts):
        log = f"ramp {number}"
        place = placed(log)
        line = replace(start.line, torque=start.torque + amplitude * float(np.sin(place + 0.5)))
        starts.append(replace(start, log=log, line=line, place=place))
    return recordings, replace(evidence, runs=tuple(runs), starts=tuple(starts))


def test_gravity_is_taken_out_with_its_size_and_the_law_stands() -> None:
    recordings, evidence = _campaign(0.02)
    corrected, explained = without_gravity(recordings, evidence, EXPLAIN)
    (wave,) = corrected.waves
    assert wave.amplitude == pytest.approx(0.02, rel=0.1)
    a, b = wave.coefficients[1]
    assert np.arctan2(a, b) == pytest.approx(0.5, abs=0.1)
    (said,) = ripple_findings(corrected.waves, "rotary")
    assert said.code == "E-POSITION"
    assert "gravity" in said.text
    for direction, curve in (("positive", ROBOT.friction.positive), ("negative", ROBOT.friction.negative)):
        for name in ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping"):
            estimate = explained.values.curves[direction][name]  # type: ignore[index]  # both are keys
            assert estimate.stderr is not None
            assert estimate.value == pytest.approx(getattr(curve, name), abs=4 * estimate.stderr), name
    plain = EXPLAIN(evidence).values.curves["positive"]["coulomb_torque"].stderr
    better = explained.values.curves["positive"]["coulomb_torque"].stderr
    assert plain is not None
    assert better is not None
    assert better < 0.5 * plain


def test_without_gravity_nothing_is_taken_out() -> None:
    recordings, evidence = _campaign(0.0)
    corrected, _ = without_gravity(recordings, evidence, EXPLAIN)
    assert corrected is evidence

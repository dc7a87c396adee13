"""Held-out errors are as large as their standard errors say, and larger where the law is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.gathering import Evidence
from ident.fit.law_model import EACH
from ident.fit.weighting import settle
from ident.validation.held_out import FOLDS, CrossValidation, cross_validate
from tests.ident.test_coverage import synthetic_map

SPEEDS = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)


def _validated(evidence: Evidence) -> CrossValidation:
    still = np.zeros(2)
    logs = {run.log for run in evidence.runs} | {start.log for start in evidence.starts}
    recordings = [
        Recording(
            log=log, protocol="constant_velocity", time=np.array([0.0, 5.0]), position=still, torque=still
        )
        for log in logs
    ]
    return cross_validate(recordings, evidence, settle(evidence, EACH))


def test_errors_of_prediction_are_of_the_size_that_is_claimed() -> None:
    generator = np.random.default_rng(1)
    found = [_validated(synthetic_map(SPEEDS, 2e-3, generator)) for _ in range(4)]
    points = sum(len(own.points) for own in found)
    assert points == 4 * 2 * 19
    errors = [point.standardised for own in found for point in own.points]
    assert 0.85 < np.sqrt(np.mean(np.square(errors))) < 1.15
    assert 0.88 < sum(own.inside for own in found) / points <= 1.0
    for own in found:
        assert len(own.folds) == FOLDS
        assert own.torque_rms == pytest.approx(2e-3, rel=0.5)


def test_a_run_that_fits_nothing_falls_outside_of_its_interval() -> None:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(2))
    odd = replace(evidence.runs[7], torque=evidence.runs[7].torque + 0.05)
    found = _validated(replace(evidence, runs=(*evidence.runs[:7], odd, *evidence.runs[8:])))
    assert max(found.points, key=lambda point: abs(point.standardised)).velocity == odd.velocity


def test_nothing_is_held_out_where_the_data_are_too_few() -> None:
    evidence = synthetic_map(SPEEDS[::4], 2e-3, np.random.default_rng(3))
    few = replace(evidence, starts=tuple(evidence.starts[::5]))
    assert len(_validated(few).points) < 2 * 5

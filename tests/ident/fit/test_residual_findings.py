"""What residuals betray, injected one at a time into synthetic maps; and nothing where nothing is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from data.findings import Finding
from data.recording import FloatArray, Recording
from ident.evidence.gathering import Evidence
from ident.fit.circumstances import Circumstances, circumstances
from ident.fit.law_model import EACH
from ident.fit.residual_findings import residual_findings
from ident.fit.weighting import settle
from tests.ident.test_coverage import synthetic_map

SPREAD = 2e-3
SPEEDS = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)
Change = Callable[[FloatArray, Circumstances], FloatArray]  # of torques along the motion (n,)


def _seen(data: int, generator: np.random.Generator) -> Circumstances:
    place = generator.uniform(-3.0, 3.0, data)
    time = np.asarray(20.0 * generator.permutation(data), dtype=np.float64)
    return Circumstances(time, np.zeros(data, dtype=np.int64), np.sin(place), np.cos(place))


def _findings(change: Change, seed: int, *, speeds: FloatArray = SPEEDS) -> tuple[Finding, ...]:
    generator = np.random.default_rng(seed)
    evidence = synthetic_map(speeds, SPREAD, generator)
    seen = _seen(len(evidence.runs) + len(evidence.starts), generator)
    evidence = _changed(evidence, change(_sign(evidence), seen))
    return residual_findings(evidence, settle(evidence, EACH), seen, "rotary")


def _sign(evidence: Evidence) -> FloatArray:
    runs = [float(run.direction) for run in evidence.runs]
    return np.array(runs + [float(start.direction) for start in evidence.starts])


def _changed(evidence: Evidence, more: FloatArray) -> Evidence:
    runs = [
        replace(run, torque=run.torque + run.direction * float(own))
        for run, own in zip(evidence.runs, more, strict=False)
    ]
    starts = [
        replace(start, line=replace(start.line, torque=start.torque + start.direction * float(own)))
        for start, own in zip(evidence.starts, more[len(runs) :], strict=True)
    ]
    return replace(evidence, runs=tuple(runs), starts=tuple(starts))


def _nothing(sign: FloatArray, seen: Circumstances) -> FloatArray:
    return np.zeros_like(sign)


def _warming(sign: FloatArray, seen: Circumstances) -> FloatArray:
    return np.asarray(-0.02 * (seen.time / seen.time.max() - 0.5))


def _creeping_zero(sign: FloatArray, seen: Circumstances) -> FloatArray:
    return np.asarray(0.02 * sign * (seen.time / seen.time.max() - 0.5))


def test_clean_maps_raise_nothing() -> None:
    assert sum(bool(_findings(_nothing, seed)) for seed in range(8)) <= 1  # a hundredth each, by design


@pytest.mark.parametrize(
    ("change", "code", "said"),
    [
        (_warming, "E-DRIFT", "friction changes by"),
        (_creeping_zero, "E-DRIFT", "an offset of the torque changes by +0.0"),
    ],
)
def test_what_is_injected_is_named(change: Change, code: str, said: str) -> None:
    for seed in range(3):
        found = _findings(change, seed)
        assert [(own.code, said in own.text) for own in found if own.code == code] == [(code, True)]


def test_the_size_of_a_drift_is_stated() -> None:
    (found,) = _findings(_warming, 1)
    percent = float(found.text.split("changes by ")[1].split(" %")[0])
    assert percent == pytest.approx(-100 * 0.02 / 0.5, rel=0.35)


def test_drift_is_not_told_where_speeds_were_run_in_order_and_the_law_imitates_it() -> None:
    generator = np.random.default_rng(3)
    evidence = replace(synthetic_map(SPEEDS, SPREAD, generator), starts=())
    n = len(evidence.runs)
    damping = np.array([abs(run.velocity) for run in evidence.runs])
    seen = Circumstances(damping, np.zeros(n, dtype=np.int64), np.zeros(n), np.zeros(n))
    changed = _changed(evidence, 0.02 * damping)
    found = residual_findings(changed, settle(changed, EACH), seen, "linear")
    assert "E-DRIFT" not in {own.code for own in found}


@pytest.mark.parametrize(("change", "told"), [(-0.03, True), (-0.005, False), (0.0, False)])
def test_runs_that_drift_alike_are_told_with_the_size(change: float, told: bool) -> None:
    generator = np.random.default_rng(4)
    evidence = synthetic_map(SPEEDS, SPREAD, generator)
    runs = [
        replace(run, torque_change=run.direction * (change + 0.004 * float(generator.standard_normal())))
        for run in evidence.runs
    ]
    evidence = replace(evidence, runs=tuple(runs))
    seen = _seen(len(runs) + len(evidence.starts), generator)
    found = residual_findings(evidence, settle(evidence, EACH), seen, "rotary")
    said = [own.text for own in found if own.code == "E-DRIFT" and "within each run" in own.text]
    assert bool(said) is told
    if told:
        assert float(said[0].split("changes by ")[1].split(" N m")[0]) == pytest.approx(change, abs=0.004)


def test_replicates_tell_a_law_that_does_not_fit() -> None:
    speeds = np.asarray(np.repeat(np.geomspace(0.005, 2.5, 10), 2), dtype=np.float64)
    bend = np.tile(np.repeat([0.03, 0.0, -0.03, 0.03, -0.03, 0.03, -0.03, 0.03, 0.0, -0.03], 2), 2)

    def bent(sign: FloatArray, seen: Circumstances) -> FloatArray:
        return np.concatenate([bend, np.zeros(sign.size - bend.size)])

    assert any("runs repeated" in own.text for own in _findings(bent, 1, speeds=speeds))
    assert not any("runs repeated" in own.text for own in _findings(_nothing, 1, speeds=speeds))


def test_a_speed_that_is_badly_known_is_said() -> None:
    evidence = synthetic_map(SPEEDS, SPREAD, np.random.default_rng(1))
    runs = tuple(
        replace(run, velocity_stderr=1e-3) if abs(run.velocity) < 0.02 else run for run in evidence.runs
    )
    evidence = replace(evidence, runs=runs)
    seen = _seen(len(runs) + len(evidence.starts), np.random.default_rng(2))
    found = residual_findings(evidence, settle(evidence, EACH), seen, "rotary")
    (said,) = [own.text for own in found if own.code == "E-SPEEDERR"]
    assert said.startswith("6 of 28 runs")


def test_times_of_logs_without_a_date_are_compared_within_logs_alone() -> None:
    evidence = synthetic_map(SPEEDS, SPREAD, np.random.default_rng(1))
    logs = {run.log for run in evidence.runs} | {start.log for start in evidence.starts}
    time = np.linspace(0.0, 5.0, 50)
    undated = [
        Recording(log, "constant_velocity", time, np.full(50, 0.5 * np.pi), np.zeros(50)) for log in logs
    ]
    seen = circumstances(undated, evidence)
    assert np.unique(seen.group).size == len(logs)
    np.testing.assert_allclose(seen.sine, 1.0)
    dated = [replace(own, begun=1.7e9 + 100.0 * number) for number, own in enumerate(undated)]
    known = circumstances(dated, evidence)
    assert np.unique(known.group).size == 1
    assert np.ptp(known.time) > 100.0 * (len(logs) - 2)

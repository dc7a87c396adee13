"""Ramps that end at the torque limit bound F_s and give no number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.evidence.breakaway import Breakaway
from ident.evidence.gathering import Evidence
from ident.fit.assumptions import DEFAULT
from ident.fit.censoring import least_static_torques
from ident.fit.law_model import EACH
from ident.fit.one_stage import explain
from tests.ident.test_coverage import synthetic_map

SPEEDS = np.asarray(np.geomspace(0.005, 2.5, 14), dtype=np.float64)


def _saturated(start: Breakaway) -> Breakaway:
    line = replace(start.line, torque=start.direction * 0.5)
    return replace(start, line=line, why="E-SAT: the link rests at the torque limit")


def _evidence(*, both: bool) -> Evidence:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(1))
    starts = [start for start in evidence.starts if start.direction < 0 or both]
    starts += [_saturated(start) for start in evidence.starts if start.direction > 0]
    return replace(evidence, starts=tuple(starts))


def test_where_every_ramp_saturates_the_static_torque_is_a_bound() -> None:
    evidence = _evidence(both=False)
    assert least_static_torques(evidence, EACH) == {"positive": 0.5}
    values = explain(evidence, axis="rotary", assumptions=DEFAULT).values
    static = values.curves["positive"]["static_torque"]
    assert static.value is None
    assert static.interval95 == (0.5, None)
    assert "F_s >= 0.5 N m" in str(static.withheld)
    assert values.mean["static_torque"].value is None
    assert values.curves["negative"]["static_torque"].value == pytest.approx(0.5121, abs=0.01)
    assert values.curves["positive"]["coulomb_torque"].value is not None


def test_other_breakaways_give_the_number() -> None:
    evidence = _evidence(both=True)
    assert least_static_torques(evidence, EACH) == {}
    values = explain(evidence, axis="rotary", assumptions=DEFAULT).values
    assert values.curves["positive"]["static_torque"].value == pytest.approx(0.5735, abs=0.01)

"""Evidence becomes parameters, or reasons: one law, a missing direction, the shape by AICc, two minima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.advice import advise
from ident.estimate import CURVE_PARAMETERS
from ident.evidence.gathering import Evidence, IdentificationError
from ident.fit.assumptions import Assumptions
from ident.fit.cross_check import bootstrap_table
from ident.fit.map_points import friction_map
from ident.fit.one_stage import Explained, explain
from ident.model.friction import StribeckCurve
from tests.ident.test_coverage import ROBOT, synthetic_map

SPEEDS = np.geomspace(0.005, 2.5, 14)


def _explained(evidence: Evidence, **said: str) -> Explained:
    return explain(evidence, axis="rotary", assumptions=Assumptions(**said))  # type: ignore[arg-type]


def _codes(found: Explained) -> set[str]:
    return {finding.code for finding in found.findings}


def _bent(shape: float, seed: int, ways: tuple[int, ...] = (1, -1)) -> Evidence:
    """A map whose law has another beta in some directions."""
    evidence = synthetic_map(SPEEDS, 1e-3, np.random.default_rng(seed))
    runs = []
    for run in evidence.runs:
        own = ROBOT.friction.positive if run.velocity > 0 else ROBOT.friction.negative
        other = StribeckCurve(**{**vars(own), "stribeck_shape": shape})
        change = float(other.total(abs(run.velocity)) - own.total(abs(run.velocity)))
        moved = run.torque + run.direction * change * (run.direction in ways)
        runs.append(replace(run, torque=moved))
    return replace(evidence, runs=tuple(runs))


def test_a_missing_direction_is_withheld_and_the_other_stands() -> None:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(1))
    runs = tuple(run for run in evidence.runs if run.velocity > 0)
    found = _explained(replace(evidence, runs=runs))
    alone = tuple(start for start in evidence.starts if start.direction > 0)
    single = _explained(replace(evidence, runs=runs, starts=alone))
    for name in CURVE_PARAMETERS:
        assert found.values.curves["positive"][name] == single.values.curves["positive"][name]
        reason = str(found.values.curves["negative"][name].withheld)
        assert "5 breakaway(s) that way are not enough" in reason
        assert found.values.mean[name].value is None
    assert "E-DIRECTION" in _codes(found)
    assert found.values.torque_offset.value is None


def test_one_law_stands_in_the_mean_with_its_offset() -> None:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(2))
    offset = 0.02
    pushed = tuple(replace(run, torque=run.torque + offset) for run in evidence.runs)
    starts = tuple(replace(s, line=replace(s.line, torque=s.line.torque + offset)) for s in evidence.starts)
    first = _explained(evidence, laws="one").values
    second = _explained(replace(evidence, runs=pushed, starts=starts), laws="one").values
    for name in CURVE_PARAMETERS:
        for curve in second.curves.values():
            assert curve[name].withheld == "one law for both directions was fitted: see mean"
        assert second.mean[name].value == pytest.approx(first.mean[name].value, rel=1e-3)
    known = [float(values.torque_offset.value or 0.0) for values in (first, second)]
    assert known[1] - known[0] == pytest.approx(offset, rel=1e-3)
    assert second.torque_offset.interval95 is not None
    assert set(second.covariance.names) >= {"torque_offset", "mean.static_torque"}
    assert "E-OFFSET" not in {finding.code for finding in second.findings}
    explained = _explained(replace(evidence, runs=pushed, starts=starts), laws="one")
    for point in friction_map(explained.evidence, explained.weighted):
        assert point.torque - (point.fitted or 0.0) == pytest.approx(known[1], rel=0.01)


def test_one_law_that_does_not_hold_both_ways_is_told() -> None:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(2))
    asymmetric = _explained(evidence, laws="one")
    assert any("Identify without --one-law" in finding.text for finding in asymmetric.findings)
    back = ROBOT.friction.negative
    mirrored = [
        replace(
            run,
            torque=-float(ROBOT.friction.positive.total(-run.velocity))
            + run.torque
            + float(back.total(-run.velocity)),
        )
        if run.velocity < 0
        else run
        for run in evidence.runs
    ]
    more = ROBOT.friction.positive.static_torque - back.static_torque
    starts = [
        replace(s, line=replace(s.line, torque=s.line.torque - more)) if s.direction < 0 else s
        for s in evidence.starts
    ]
    symmetric = _explained(replace(evidence, runs=tuple(mirrored), starts=tuple(starts)), laws="one")
    assert "E-LACKOFFIT" not in _codes(symmetric)


def test_one_law_of_one_direction_has_no_offset() -> None:
    evidence = synthetic_map(SPEEDS, 2e-3, np.random.default_rng(3))
    found = _explained(replace(evidence, runs=tuple(r for r in evidence.runs if r.velocity < 0)), laws="one")
    assert found.values.torque_offset.value is None
    assert found.values.curves["negative"]["coulomb_torque"].value is not None


@pytest.mark.parametrize(
    ("shape", "ways", "free"),
    [(1.0, (1, -1), ()), (2.0, (1, -1), ("positive", "negative")), (2.0, (1,), ("positive",))],
)
def test_aicc_frees_the_beta_that_is_not_1(
    shape: float, ways: tuple[int, ...], free: tuple[str, ...]
) -> None:
    found = _explained(_bent(shape, 4, ways), shape="chosen")
    for direction, curve in found.values.curves.items():
        assert curve["stribeck_shape"].fixed == (direction not in free)
    assert "by AICc" in found.report
    assert found.report.count("beta") >= 8
    (told,) = [finding.text for finding in found.findings if "AICc" in finding.text]
    assert "weight" in told


def test_a_beta_far_from_1_is_told_where_it_is_fixed() -> None:
    assert "E-LACKOFFIT" in _codes(_explained(_bent(2.0, 5)))
    assert "E-LACKOFFIT" not in _codes(_explained(_bent(1.0, 5)))


def test_as_many_data_as_parameters_are_refused() -> None:
    evidence = synthetic_map(SPEEDS[::5], 2e-3, np.random.default_rng(6))
    few = tuple(start for start in evidence.starts if start.direction < 0)
    with pytest.raises(IdentificationError, match=r"E-FEW: positive direction: 3 .* 0 breakaway"):
        _explained(replace(evidence, starts=few))


def test_every_parameter_has_a_profile_around_its_value() -> None:
    found = _explained(synthetic_map(SPEEDS, 2e-3, np.random.default_rng(7)), shape="free").values
    for way, curve in (*found.curves.items(), ("mean", found.mean)):
        for name, estimate in curve.items():
            profile = found.profiles[f"{way}.{name}"]
            assert profile.value[np.argmin(profile.rise)] == pytest.approx(estimate.value, rel=1e-6)
            low, high = estimate.interval95 or (None, None)
            assert estimate.value is not None
            assert low is None or low < estimate.value
            assert high is None or high > estimate.value


def test_the_bootstrap_stands_beside_the_profiles() -> None:
    found = _explained(synthetic_map(SPEEDS, 2e-3, np.random.default_rng(8)))
    table = bootstrap_table(found.weighted.data, found.values, np.random.default_rng(1))
    (line,) = [line for line in table.splitlines() if "positive.coulomb_torque" in line]
    _, value, low, _, high, drawn_low, _, drawn_high = line.split()
    estimate = found.values.curves["positive"]["coulomb_torque"]
    assert float(value) == pytest.approx(estimate.value, rel=1e-4)
    assert (float(low), float(high)) == pytest.approx(estimate.interval95, rel=1e-4)
    assert float(low) < float(drawn_high)
    assert float(drawn_low) < float(high)
    assert "stribeck_torque" not in table


@pytest.mark.parametrize("laws", ["one", "each"])
def test_advice_is_given_whatever_the_layout(laws: str) -> None:
    evidence = synthetic_map(SPEEDS[6:], 2e-3, np.random.default_rng(9))
    runs = evidence.runs if laws == "one" else tuple(run for run in evidence.runs if run.velocity > 0)
    found = _explained(replace(evidence, runs=runs), laws=laws)
    advice = advise(found.evidence, found.weighted)
    assert {one.direction for one in advice} == set(found.weighted.data.model.directions)
    assert all(one.runs for one in advice if one.quantity == "static_torque")

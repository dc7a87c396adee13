"""compare: what a small recorded campaign shows, beside what is predicted of it."""

from __future__ import annotations

import csv

import pytest

from tests.pipelines.conftest import Finished


def test_every_verdict_is_predicted(finished: Finished) -> None:
    comparison = finished.document("comparison.json")
    verdicts = {run["r"]: run["verdict"] for run in comparison["runs"]}
    assert verdicts == {0.9: "equilibrium", 0.98: "equilibrium", 1.05: "limit_cycle", 1.2: "limit_cycle"}
    assert all(run["predicted"]["verdict"] == run["verdict"] for run in comparison["runs"])
    agreement = comparison["agreement"]
    assert (agreement["verdicts"], agreement["verdicts_compared"]) == (1.0, 4)
    assert agreement["equilibria_inside_predicted_set"] == 1.0


def test_where_a_run_ends_up_is_predicted(finished: Finished) -> None:
    """Where in its equilibrium set a run stops hangs on the rig's ripple, which no model here has."""
    for run in finished.document("comparison.json")["runs"]:
        predicted = run["predicted"]
        assert run["start"] == pytest.approx(0.6, abs=1e-4)
        if run["verdict"] == "equilibrium":
            assert (
                predicted["x1_min"] == predicted["x1_max"] == pytest.approx(run["position_error"], abs=0.06)
            )
            assert (run["amplitude"], run["period"]) == (None, None)
        else:
            assert predicted["amplitude"] == pytest.approx(run["amplitude"], rel=0.03)
            if run["r"] > 1.1:  # near 1.05 the mode sequence changes, and with it the period at once
                assert predicted["period"] == pytest.approx(run["period"], rel=0.03)
            largest = max(abs(predicted["x1_min"]), abs(predicted["x1_max"]))
            assert predicted["amplitude"] == pytest.approx(largest, rel=0.02)


def test_the_onset_is_predicted_within_the_recorded_bracket(finished: Finished) -> None:
    (onset,) = finished.document("comparison.json")["onset"]
    low, high = onset["recorded"]
    assert (low, high) == (0.98, 1.05)
    assert low - 0.02 <= onset["predicted"] <= high + 0.02
    assert onset["predicted_interval95"][0] <= onset["predicted"] <= onset["predicted_interval95"][1]
    assert onset["symmetric"] == pytest.approx(1.0, abs=0.005)
    assert onset["ideal"] == pytest.approx(onset["predicted"], abs=0.01)
    assert (onset["reversals"], onset["why"]) == ([], {})


def test_the_table_holds_the_same_runs(finished: Finished) -> None:
    runs = finished.document("comparison.json")["runs"]
    with (finished.out / "comparison.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["log"] for row in rows] == [run["log"] for run in runs]
    for row, run in zip(rows, runs, strict=True):
        assert float(row["r"]) == run["r"]
        assert row["predicted_ideal_verdict"] == run["predicted_ideal"]["verdict"]
        assert row["amplitude"] == ("" if run["amplitude"] is None else repr(run["amplitude"]))

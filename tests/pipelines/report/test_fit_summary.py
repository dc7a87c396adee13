"""The head of fit_report.txt says what was found, what was not, and how far to trust it."""

from __future__ import annotations

from pipelines.report.fit_summary import fit_report
from tests.pipelines.report import examples


def test_everything_an_engineer_asks_for_stands_before_lmfits_own_report() -> None:
    text = fit_report(examples.robot(), "[[Fit Statistics]]\n    chi-square = 12")
    summary, own = text.split("[[Fit Statistics]]")
    assert own == "\n    chi-square = 12\n"
    titles = [line for line in text.splitlines() if line and set(line) == {"="}]
    assert len(titles) == 6
    flat = " ".join(summary.split())
    for said in (
        "F_s static friction 0.5735 [0.5500, ∞) N m",
        "v_s Stribeck velocity withheld",
        "v_s (negative): E-LOWSPEED: run 0.01 to 0.05 rad/s",
        "constant velocity: 1 of 2 logs used",
        "left out: slow.csv: E-STICKSLIP",
        "6 breakaways under ramps of 0.05 to 0.2 N m/s, at places from −1 to 2 rad",
        "1 ramps ended at the torque limit",
        "F_s, negative direction: 0 breakaways",
        "5 lie in their 95 % prediction intervals",
        "3.2 −0.0200 1.5 0.003 125 velocity/p0.10.csv",
        "E-OFFSET (warn): seen",
    ):
        assert said in flat, said
    assert flat.index("E-STICKSLIP (withhold)") < flat.index("E-OFFSET (warn)")
    assert max(map(len, summary.splitlines())) <= 110


def test_control_characters_of_logs_do_not_reach_the_report() -> None:
    text = fit_report(examples.robot(examples.HOSTILE), "")
    assert "\x1b" not in text
    assert "\u202e" not in text


def test_a_robot_without_validation_has_no_such_section() -> None:
    robot = {key: value for key, value in examples.robot().items() if key not in ("validation", "breakaways")}
    assert "Prediction" not in fit_report(robot, "x")

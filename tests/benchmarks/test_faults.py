"""A few campaigns of each fault, and clean ones: the small copy of `benchmarks.calibration.faults`."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.calibration.clean_campaigns import Campaign, random_rig
from benchmarks.calibration.faults import findings_of, is_right, said_of
from benchmarks.calibration.injected_faults import FAULTS, any_log

LOGS = ("E-WRAP", "E-SPIKE", "E-GAP", "E-CLOCK", "E-SAT", "E-SIGN", "E-QUANT", "E-STEADY", "E-STICKSLIP")
FITS = ("E-OFFSET", "E-FEW", "E-DIRECTION")


@pytest.mark.parametrize("code", LOGS)
def test_faults_of_a_log_get_their_code_and_severity(code: str) -> None:
    assert [seed for seed in range(100, 106) if not is_right(code, seed)] == []


@pytest.mark.parametrize("code", FITS)
def test_faults_of_a_campaign_get_their_code_and_severity(code: str) -> None:
    assert is_right(code, 100)


def test_clean_logs_raise_nothing() -> None:
    for seed in range(20):
        generator = np.random.default_rng(seed)
        rig = random_rig(generator)
        assert said_of(Campaign(rig, (any_log(rig, generator),)), "log") == {}


@pytest.mark.parametrize("code", ["E-SPIKE", "E-CLOCK", "E-STICKSLIP"])
def test_a_finding_says_where_and_how_much(code: str) -> None:
    injected = FAULTS[code](np.random.default_rng(1))
    said = findings_of(injected.campaign, injected.stage)
    assert said
    assert all(injected.campaign.logs[0].log in (finding.log or finding.text) for finding in said)
    assert all(any(sign.isdigit() for sign in finding.text) for finding in said)


def test_every_code_has_an_injection() -> None:
    assert len(FAULTS) == 23

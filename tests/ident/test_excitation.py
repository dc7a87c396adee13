"""Identification from excitation logs: alone, and beside others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.estimate import Covariance, Estimate
from ident.evidence.gathering import IdentificationError
from ident.excitation.excited_law import ExcitedLaw, excited_law
from ident.fit.assumptions import Assumptions
from ident.from_excitation import with_excitation
from ident.identification import identify
from ident.identified import Identification
from tests.ident.excitation.loop_rig import followed, swings
from tests.ident.excitation.test_excited_law import PLAIN, rig_of

RIG = rig_of(PLAIN, PLAIN)
RECORDING = followed(RIG, swings(RIG, duration=8.0), np.random.default_rng(5), offset=0.05)


def test_excitation_alone_gives_one_law_and_withholds_what_it_does_not_show() -> None:
    found = identify([RECORDING])
    robot = found.robot
    assert robot.one_law
    assert robot.robot() is None  # F_s is not in the data
    assert robot.inertia.value == pytest.approx(0.026, rel=0.01)
    assert robot.mean["coulomb_torque"].value == pytest.approx(0.4, rel=0.02)
    assert robot.torque_offset.value == pytest.approx(0.05, abs=0.01)
    assert robot.inertia_sources["excitation"] == robot.inertia
    (use,) = robot.runs
    assert use.used
    codes = {note.code for note in robot.notes}
    assert {"E-TESTS", "E-NOSTRIBECK"} <= codes
    assert found.weighted is None
    assert "held out" in found.fit_report


def test_a_law_for_each_direction_has_no_offset() -> None:
    robot = identify([RECORDING], assumptions=Assumptions(laws="each")).robot
    assert not robot.one_law
    assert robot.torque_offset.value is None
    ahead, back = robot.positive["coulomb_torque"].value, robot.negative["coulomb_torque"].value
    assert ahead is not None
    assert back is not None
    assert 0.5 * (ahead - back) == pytest.approx(0.05, abs=0.01)  # the offset shows as an asymmetry


def test_a_torque_of_the_wrong_sign_is_refused() -> None:
    with pytest.raises(IdentificationError, match="E-SIGN"):
        identify([replace(RECORDING, torque=-RECORDING.torque)])


def test_a_free_beta_is_told_to_have_no_effect_on_motion_alone() -> None:
    notes = identify([RECORDING], assumptions=Assumptions(shape="free")).robot.notes
    assert any("beta stays 1" in note.text for note in notes)
    assert not any("beta stays 1" in note.text for note in identify([RECORDING]).robot.notes)


def test_beside_other_logs_the_inertia_stands_where_there_is_no_other() -> None:
    alone = identify([RECORDING])
    excited = excited_law([RECORDING], law="one", axis="rotary")
    assert isinstance(excited, ExcitedLaw)
    robot = replace(
        alone.robot,
        inertia=Estimate(None, "kg m^2", withheld="E-TESTS"),
        inertia_sources={},
        covariance=Covariance(("positive.coulomb_torque",), np.array([[1e-6]])),
        notes=(),
    )
    without: Identification = replace(alone, robot=robot)
    found = with_excitation(without, excited).robot
    assert found.inertia.value == alone.robot.inertia.value
    assert found.covariance.names == ("inertia", "positive.coulomb_torque")
    other = Estimate(0.03, "kg m^2", stderr=1e-5, interval95=(0.02998, 0.03002))
    with_other = replace(without, robot=replace(robot, inertia=other))
    found = with_excitation(with_other, excited).robot
    assert found.inertia == other
    assert found.inertia_sources["excitation"].value == alone.robot.inertia.value
    assert [note.code for note in found.notes] == ["E-LACKOFFIT"]

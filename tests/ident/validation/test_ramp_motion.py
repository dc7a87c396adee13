"""The motion after a breakaway, simulated by the true law and by a wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ident.evidence.gathering import gather
from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import EACH
from ident.validation.held_out import CrossValidation, Fold
from ident.validation.ramp_motion import RampMotion, predicted_motions
from tests.ident.rigs import Rig

RIG = Rig(torque_noise=0.002)
LOG = RIG.ramps([0.1, -0.2], np.random.default_rng(1))


def _true_fit() -> FrictionFit:
    values = {"inertia": RIG.robot.inertia, "torque_offset": 0.0}
    for direction in ("positive", "negative"):
        curve = getattr(RIG.robot.friction, direction)
        values |= {
            f"{direction}_coulomb_torque": curve.coulomb_torque,
            f"{direction}_stribeck_torque": curve.stribeck_torque,
            f"{direction}_stribeck_velocity": curve.stribeck_velocity,
            f"{direction}_viscous_damping": curve.viscous_damping,
            f"{direction}_stribeck_shape": 1.0,
        }
    return FrictionFit(EACH, values, (), np.zeros((0, 0)), 0.0, None)


def _motions(fit: FrictionFit) -> tuple[RampMotion, ...]:
    held_out = CrossValidation((), (Fold(frozenset({LOG.log}), fit),), 2.0, ())
    return predicted_motions([LOG], gather([LOG]), held_out)


def test_the_true_law_starts_in_time_and_follows_the_motion() -> None:
    found = _motions(_true_fit())
    assert [motion.direction for motion in found] == [1, -1]
    for motion in found:
        assert abs(motion.onset_error) < 0.02
        assert motion.travel > 1.4
        assert motion.position_rms < 0.003 * motion.travel
        assert motion.counts_rms == pytest.approx(motion.position_rms / RIG.resolution)


def test_a_heavier_link_is_seen_not_to_follow() -> None:
    fit = _true_fit()
    heavier = replace(fit, values={**fit.values, "inertia": 1.1 * fit.values["inertia"]})
    for motion, true in zip(_motions(heavier), _motions(fit), strict=True):
        assert motion.position_rms > 5 * true.position_rms


def test_a_log_that_no_fold_left_out_is_not_predicted() -> None:
    assert predicted_motions([LOG], gather([LOG]), CrossValidation((), (), 2.0, ())) == ()

"""The momentum of the motion after breakaway is balanced by the true law and by no other inertia."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ident.evidence.breakaway import breakaways
from ident.evidence.momentum import Momentum, momentum
from tests.ident.rigs import Rig


def _momentum(rig: Rig, rate: float) -> Momentum:
    recording = rig.ramps([rate], np.random.default_rng(1))
    motion = momentum(recording, breakaways(recording)[0])
    assert motion is not None
    return motion


@pytest.mark.parametrize("rate", [0.1, 0.3, -0.1, -0.3])
@pytest.mark.parametrize("counts", [20_000, 2**20])
def test_the_true_law_balances_every_window(rate: float, counts: int) -> None:
    rig = Rig(torque_noise=0.0, resolution=2 * math.pi / counts)
    motion = _momentum(rig, rate)
    curve = rig.robot.friction.positive if rate > 0 else rig.robot.friction.negative
    law = (curve.coulomb_torque, curve.stribeck_torque, curve.stribeck_velocity, curve.viscous_damping, 1.0)
    left = motion.residual(rig.robot.inertia, law)
    errors = rig.robot.inertia * np.sqrt(np.diag(motion.speed_covariance))
    assert np.all(np.abs(left) < 5 * errors + 0.004 * rig.robot.inertia * motion.gain)
    inertia = rig.robot.inertia + float(left.sum() / motion.gain.sum())
    error = rig.robot.inertia * math.sqrt(float(motion.speed_covariance.sum())) / float(motion.gain.sum())
    assert inertia == pytest.approx(rig.robot.inertia, abs=4 * error + 1e-3 * rig.robot.inertia)


def test_a_motion_too_short_for_speeds_gives_none() -> None:
    rig = Rig(resolution=0.1, torque_noise=0.0)
    recording = rig.ramps([0.3], np.random.default_rng(2), travel=0.5)
    assert all(momentum(recording, start) is None for start in breakaways(recording))

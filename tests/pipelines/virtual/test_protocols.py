"""What the virtual rig plays fits the robot that it is played on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ident.model.published import asymmetric_robot
from ident.model.robot import OneLinkRobot
from ident.response import plant_array, respond
from pipelines.settings.virtual_rig import VirtualRig
from pipelines.virtual.bench import Bench, play_ramps
from pipelines.virtual.protocols import constant_speeds, multisines, odd_lines, speed_loop


def rig_of(inertia: float, torque: float, velocity: float, damping: float) -> VirtualRig:
    curve = {
        "static_torque": torque,
        "coulomb_torque": 0.7 * torque,
        "stribeck_velocity": velocity,
        "viscous_damping": damping,
    }
    return VirtualRig.model_validate({"robot": {"inertia": inertia, "positive": curve, "negative": curve}})


def bench_for(robot: OneLinkRobot, resolution: float = 2 * math.pi / 2**18, limit: float = math.inf) -> Bench:
    return Bench(plant_array(robot), 1e-3, resolution, limit)


def test_table_1_s_speed_loop_is_the_known_one() -> None:
    loop = speed_loop(VirtualRig())
    gains = (loop.damping, loop.stiffness, loop.integral, loop.filter)
    assert gains == pytest.approx((3.0, 60.0, 100.0, 300.0), rel=0.005)


@pytest.mark.parametrize(
    ("rig", "resolution"),
    [
        (VirtualRig(), 2 * math.pi / 2**18),
        (rig_of(2.5, 20.0, 0.02, 8.0), 1e-6),
        (rig_of(1e-4, 0.006, 0.15, 3e-4), 2 * math.pi / 2**18),
        (rig_of(0.3, 2.0, 0.1, 0.0), 2 * math.pi / 2**18),
    ],
)
def test_the_slowest_speeds_do_not_stick_on_any_robot(rig: VirtualRig, resolution: float) -> None:
    bench = bench_for(rig.true_robot(), resolution)
    runs = [run for run in constant_speeds(rig, bench) if run.label.startswith("n")]
    speeds = [-float(run.metadata["speed"]) for run in runs]
    scale = rig.true_robot().mean().friction.positive.stribeck_velocity
    assert sum(s < scale for s in speeds) >= 3
    assert sum(s > 3 * scale for s in speeds) >= 3
    motion = runs[0].play(np.random.default_rng(1))
    assert np.all(motion.velocity < 0)
    assert motion.velocity.std() < 0.1 * speeds[0]


def test_ramps_are_the_robot_s_own_response_to_their_torque() -> None:
    robot = asymmetric_robot()
    motion = play_ramps(bench_for(robot), rate=-0.4, ramps=2, travel=0.5, start=0.2)
    position, velocity = respond(robot, start=(0.2, 0.0), torque=motion.torque[:-1], period=1e-3)
    # the last sample of a ramp is at rest, and the next begins there: one sample shared
    first = int(np.flatnonzero((motion.torque[:-1] == 0) & (motion.torque[1:] < 0))[1])
    np.testing.assert_array_equal(position[:first], motion.position[:first])
    np.testing.assert_array_equal(velocity[:first], motion.velocity[:first])
    rising = motion.torque < 0
    np.testing.assert_allclose(np.diff(motion.torque)[rising[1:] & rising[:-1]], -4e-4, rtol=1e-9)


def test_a_ramp_that_meets_the_torque_limit_is_given_up() -> None:
    motion = play_ramps(bench_for(asymmetric_robot(), limit=0.4), rate=0.4, ramps=1, travel=0.5, start=0.0)
    assert np.ptp(motion.position) == 0.0
    assert motion.torque.max() == 0.4
    assert motion.torque[-1] == 0.0


def test_lines_are_odd_sparse_and_in_range() -> None:
    lines = odd_lines(2.0, 80.0, 20)
    assert np.all(lines % 2 == 1)
    assert np.all(np.diff(lines) >= 2)
    assert lines[0] == 3
    assert lines[-1] <= 80
    assert 12 <= lines.size <= 20


def test_a_multisine_keeps_below_the_torque_limit() -> None:
    bench = bench_for(asymmetric_robot(), limit=1.2)
    motion = next(iter(multisines(VirtualRig(), bench))).play(np.random.default_rng(4))
    assert 1.0 < motion.torque.max() < 1.2
    assert motion.velocity.mean() == pytest.approx(3.0, rel=2e-3)

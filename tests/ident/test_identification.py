"""The whole identification on rigs of several sizes, and its refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from data.recording import Recording
from ident.estimate import CURVE_PARAMETERS, Estimate
from ident.evidence.gathering import IdentificationError
from ident.fit.assumptions import Assumptions
from ident.identification import identify
from ident.identified import Identification
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot
from tests.ident.rigs import Rig, multisine

TOLERANCE = {
    "static_torque": 0.02,
    "coulomb_torque": 0.02,
    "viscous_damping": 0.04,
    "stribeck_velocity": 0.08,
}


def _robot(inertia: float, static: float, velocity: float, damping: float) -> OneLinkRobot:
    forward = StribeckCurve(static, 0.7 * static, velocity, damping)
    backward = StribeckCurve(0.85 * static, 0.62 * static, 1.15 * velocity, 0.9 * damping)
    return OneLinkRobot(inertia, StribeckFriction(forward, backward))


RIGS = {
    "bench": Rig(ripple=0.002, torque_noise=0.01),
    "coarse": Rig(resolution=2 * math.pi / 2000, torque_noise=0.02),
    "heavy": Rig(
        robot=_robot(100.0, 50.0, 0.05, 30.0), period=0.01, resolution=6e-6, torque_noise=0.1, ripple=0.2
    ),
    "light": Rig(robot=_robot(3e-4, 0.05, 0.5, 2e-3), period=1e-3, resolution=1e-4, torque_noise=0.005),
    "linear": Rig(robot=_robot(95.0, 30.0, 0.02, 200.0), resolution=1e-6, torque_noise=0.5),
}


def _speeds(
    rig: Rig, generator: np.random.Generator, directions: tuple[int, ...] = (1, -1)
) -> list[Recording]:
    slow = rig.robot.friction.positive.stribeck_velocity
    counted = 40 * rig.resolution / (0.08 * slow)
    speeds = slow * np.geomspace(0.08, 35.0, 12)
    return [
        rig.speeds(
            [direction * speed],
            generator,
            log=f"velocity {direction * speed:.4g}",
            duration=max(4.0, counted if speed < slow else 0.0),
            start=generator.uniform(-3.0, 3.0),
        )
        for direction in directions
        for speed in speeds
    ]


def _ramps(rig: Rig, generator: np.random.Generator) -> list[Recording]:
    friction = rig.robot.friction.positive
    return [
        rig.ramps(
            [sign * rate * friction.static_torque for sign in (1, -1)],
            generator,
            log=f"ramps {number} {rate}",
            start=generator.uniform(-3.0, 3.0),
            travel=20 * friction.stribeck_velocity,
        )
        for number in range(3)
        for rate in (0.1, 0.3)
    ]


def _responses(rig: Rig, generator: np.random.Generator, *, bias: float = 40.0) -> list[Recording]:
    friction = rig.robot.friction.positive
    speed = bias * friction.stribeck_velocity
    lowest = 2 * math.pi * 2 / (2000 * rig.period)
    lines = range(2, 120, 3)
    swing = 0.2 * speed * rig.robot.inertia * lowest * math.sqrt(len(lines))
    strength = min(swing, 0.3 * friction.static_torque)
    held = float(friction.total(speed))
    return [
        rig.torque_driven(
            held + np.tile(multisine(length=2000, amplitude=strength, lines=lines, generator=generator), 5),
            generator,
            log=f"response {number}",
            speed=speed,
            delay=1,
        )
        for number in range(3)
    ]


def _estimates(found: Identification, rig: Rig) -> list[tuple[str, Estimate, float]]:
    robot, truth = found.robot, rig.robot
    listed = [("inertia", robot.inertia, truth.inertia)]
    for direction, curve in (("positive", truth.friction.positive), ("negative", truth.friction.negative)):
        listed += [(name, getattr(robot, direction)[name], getattr(curve, name)) for name in TOLERANCE]
    return listed


def _inside(estimate: Estimate, truth: float) -> bool:
    low, high = estimate.interval95 or (None, None)
    return (low is None or low <= truth) and (high is None or truth <= high)


@pytest.mark.parametrize(
    ("name", "with_response"),
    [(name, name != "bench") for name in RIGS] + [("bench", True)],
)
def test_the_truth_is_recovered(name: str, with_response: bool) -> None:
    rig, generator = RIGS[name], np.random.default_rng(11)
    logs = [*_speeds(rig, generator), *_ramps(rig, generator)]
    logs += _responses(rig, generator) if with_response else []
    found = identify(logs)
    listed = _estimates(found, rig)
    for parameter, estimate, truth in listed:
        assert estimate.value == pytest.approx(truth, rel=TOLERANCE.get(parameter, 0.02)), parameter
        assert estimate.stderr is not None
        assert estimate.stderr > 0
    assert sum(_inside(estimate, truth) for _, estimate, truth in listed) >= 7
    refused = [use.log for use in found.robot.runs if not use.used]
    assert all("response" in log for log in refused)  # a coarse encoder may not resolve the shortest
    assert "breakaway" in found.robot.inertia_sources
    assert "frequency_response" not in found.robot.inertia_sources or with_response
    validation = found.validation
    assert validation is not None
    held_out = validation.held_out
    assert len(held_out.points) == len(found.friction_map)
    assert held_out.standardised_rms is not None
    assert 0.4 < held_out.standardised_rms < 1.5
    assert len(validation.ramps) == 12


def test_one_log_of_all_speeds_and_one_of_all_ramps_are_enough() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(12)
    speeds = np.geomspace(0.006, 2.5, 12)
    staircase = rig.speeds([*speeds, *-speeds], generator, rest=0.4)
    ramps = rig.ramps([sign * rate for rate in (0.06, 0.2) for sign in (1, -1)] * 2, generator)
    found = identify([staircase, ramps])
    assert len(found.friction_map) == 2 * speeds.size + 8
    for parameter, estimate, truth in _estimates(found, rig):
        assert estimate.value == pytest.approx(truth, rel=TOLERANCE.get(parameter, 0.03)), parameter


def test_beta_is_fixed_unless_it_is_freed() -> None:
    rig, generator = Rig(torque_noise=0.005), np.random.default_rng(13)
    logs = [*_speeds(rig, generator), *_ramps(rig, generator)]
    fixed = identify(logs).robot.positive["stribeck_shape"]
    assert fixed.fixed
    assert fixed.value == 1.0
    freed = identify(logs, assumptions=Assumptions(shape="free")).robot.positive["stribeck_shape"]
    assert not freed.fixed
    assert freed.value == pytest.approx(1.0, abs=0.1)
    assert _inside(freed, 1.0)


def test_the_covariance_is_in_the_laws_own_parameters() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(14)
    robot = identify([*_speeds(rig, generator), *_ramps(rig, generator)]).robot
    names = robot.covariance.names
    assert set(names) == {"inertia"} | {
        f"{direction}.{name}"
        for direction in ("positive", "negative")
        for name in CURVE_PARAMETERS
        if name != "stribeck_shape"
    }
    where = names.index("positive.static_torque")
    stderr = robot.positive["static_torque"].stderr
    assert stderr == pytest.approx(math.sqrt(robot.covariance.matrix[where, where]))
    assert len(robot.draws(5, generator)) == 5


def test_a_missing_direction_is_withheld_and_never_copied() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(15)
    found = identify([*_speeds(rig, generator, (1,)), *_ramps(rig, generator)])
    robot = found.robot
    assert robot.robot() is None
    for name in CURVE_PARAMETERS:
        assert str(robot.negative[name].withheld).startswith("E-DIRECTION: no usable constant-velocity run")
        assert robot.mean[name].value is None
    for name, truth in vars(rig.robot.friction.positive).items():
        assert robot.positive[name].value == pytest.approx(truth, rel=TOLERANCE.get(name, 1e-9)), name
    assert robot.inertia.value == pytest.approx(rig.robot.inertia, rel=0.02)
    backward = [point for point in found.friction_map if point.direction < 0]
    assert backward
    assert not any(point.used for point in backward)


def test_nothing_to_identify_is_refused() -> None:
    with pytest.raises(IdentificationError, match="no recordings"):
        identify([])


def test_a_torque_of_the_wrong_sign_is_refused() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(16)
    turned = [replace(log, torque=-log.torque) for log in _speeds(rig, generator)]
    with pytest.raises(IdentificationError, match="E-SIGN"):
        identify(turned)


@pytest.mark.parametrize("unit", [1e3, 1e-6])
def test_times_in_another_unit_are_refused_where_no_velocity_tells(unit: float) -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(16)
    logs = [*_speeds(rig, generator), rig.ramps([0.1, -0.1], generator)]
    with pytest.raises(IdentificationError, match=r"E-UNIT.*implied inertia"):
        identify([replace(log, time=log.time * unit) for log in logs])


def test_too_few_speeds_are_refused() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(17)
    few = [rig.speeds([speed, -speed], generator, log=f"{speed}") for speed in (0.02, 0.1, 0.5, 2.0)]
    with pytest.raises(IdentificationError, match="E-FEW"):
        identify(few)


def test_without_ramps_and_response_the_inertia_is_withheld_and_the_law_stands() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(18)
    robot = identify(_speeds(rig, generator)).robot
    assert robot.inertia.value is None
    assert "E-TESTS" in str(robot.inertia.withheld)
    assert robot.positive["coulomb_torque"].value == pytest.approx(0.399, rel=0.02)
    assert robot.robot() is None
    assert {note.code for note in robot.notes} >= {"E-TESTS"}


def test_without_slow_speeds_and_ramps_the_bend_is_withheld() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(19)
    speeds = np.linspace(0.6, 2.5, 9)
    logs = [rig.speeds([s * v], generator, log=f"{s * v:.2f}") for s in (1, -1) for v in speeds]
    robot = identify(logs).robot
    for curve in (robot.positive, robot.negative):
        assert curve["stribeck_velocity"].value is None
        assert curve["static_torque"].value is None
        assert curve["viscous_damping"].value == pytest.approx(0.081, rel=0.06)


def test_a_response_in_the_stribeck_range_is_withheld_as_a_source() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(20)
    logs = [*_speeds(rig, generator), *_ramps(rig, generator), *_responses(rig, generator, bias=6.0)]
    robot = identify(logs).robot
    source = robot.inertia_sources["frequency_response"]
    assert source.value is None
    assert "Raise the bias speed" in str(source.withheld)
    assert robot.inertia.value == pytest.approx(rig.robot.inertia, rel=0.02)


def test_a_stick_slip_run_is_left_out_and_listed() -> None:
    rig, generator = RIGS["bench"], np.random.default_rng(21)
    logs = [*_speeds(rig, generator), *_ramps(rig, generator)]
    time = 1e-3 * np.arange(8000)
    phase = (time / 0.25) % 1.0
    velocity = np.where(phase < 0.4, 0.0, 0.2 * np.sin(np.pi * (phase - 0.4) / 0.6))
    jerky = rig.recorded(
        "jerky",
        "constant_velocity",
        position=np.cumsum(velocity) * 1e-3,
        torque=np.full(time.size, 0.7),
        generator=generator,
    )
    robot = identify([*logs, jerky]).robot
    (use,) = [use for use in robot.runs if use.log == "jerky"]
    assert not use.used
    assert "E-STICKSLIP" in str(use.why)
    assert robot.positive["coulomb_torque"].value == pytest.approx(0.399, rel=0.01)


def test_noisy_positions_spoil_neither_the_inertia_nor_the_steady_law() -> None:
    rig, generator = Rig(torque_noise=0.005), np.random.default_rng(22)
    logs = [
        replace(log, position=log.position + 5e-4 * generator.standard_normal(log.position.size))
        for log in [*_speeds(rig, generator), *_ramps(rig, generator)]
    ]
    found = identify(logs)
    for parameter, estimate, truth in _estimates(found, rig):
        assert estimate.value == pytest.approx(truth, rel=TOLERANCE.get(parameter, 0.02)), parameter


def test_a_torque_logged_late_does_not_bend_the_steady_law() -> None:
    rig, generator = Rig(torque_noise=0.005), np.random.default_rng(23)
    late = 15
    logs = [
        replace(log, torque=np.concatenate([np.full(late, log.torque[0]), log.torque[:-late]]))
        for log in [*_speeds(rig, generator), *_ramps(rig, generator)]
    ]
    found = identify(logs)
    for parameter, estimate, truth in _estimates(found, rig):
        assert estimate.value == pytest.approx(truth, rel=TOLERANCE.get(parameter, 0.04)), parameter


def test_an_unknown_inertia_is_not_taken_for_one() -> None:
    rig, generator = RIGS["light"], np.random.default_rng(24)
    logs = [
        rig.speeds([log_speed], generator, log=f"{log_speed:.4g}", wobble=0.02, duration=4.1)
        for speed in rig.robot.friction.positive.stribeck_velocity * np.geomspace(0.08, 20.0, 12)
        for log_speed in (float(speed), -float(speed))
    ]
    found = identify(logs)
    assert found.robot.inertia.value is None
    for parameter, estimate, truth in _estimates(found, rig)[1:]:
        assert estimate.value == pytest.approx(truth, rel=2 * TOLERANCE[parameter]), parameter


def test_without_a_stribeck_effect_a_line_is_fitted_and_v_s_withheld() -> None:
    curve = StribeckCurve(0.4, 0.4, 0.05, 0.1)
    robot = OneLinkRobot(0.026, StribeckFriction(curve, StribeckCurve(0.36, 0.36, 0.05, 0.09)))
    rig, generator = Rig(robot=robot, torque_noise=0.004), np.random.default_rng(25)
    found = identify([*_speeds(rig, generator), *_ramps(rig, generator)]).robot
    for direction, truth in (("positive", robot.friction.positive), ("negative", robot.friction.negative)):
        estimates = getattr(found, direction)
        assert str(estimates["stribeck_velocity"].withheld).startswith("E-NOSTRIBECK")
        for name in ("static_torque", "coulomb_torque", "viscous_damping"):
            estimate = estimates[name]
            assert estimate.value == pytest.approx(getattr(truth, name), rel=0.01), name
            assert abs(estimate.value - getattr(truth, name)) < 4 * estimate.stderr, name
    assert not {"E-LOWSPEED", "E-BOUND", "E-LOCAL"} & {note.code for note in found.notes}


@pytest.mark.parametrize(("shape", "told"), [(2.0, True), (1.0, False)])
def test_a_stribeck_curve_of_another_shape_is_reported(shape: float, told: bool) -> None:
    curve = StribeckCurve(0.58, 0.4, 0.07, 0.08, shape)
    rig = Rig(robot=OneLinkRobot(0.026, StribeckFriction(curve, curve)), torque_noise=0.005)
    generator = np.random.default_rng(26)
    notes = identify([*_speeds(rig, generator), *_ramps(rig, generator)]).robot.notes
    assert any("--free-beta" in note.text for note in notes if note.code == "E-LACKOFFIT") == told

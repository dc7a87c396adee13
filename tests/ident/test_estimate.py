import numpy as np

from ident.estimate import CURVE_PARAMETERS, Covariance, Estimate, IdentifiedRobot

LAW = {"static_torque": 0.5, "coulomb_torque": 0.4, "stribeck_velocity": 0.1, "stribeck_shape": 1.0}


def one_law(**changed: float | None) -> IdentifiedRobot:
    values = {**LAW, "viscous_damping": 0.08, **changed}
    mean = {
        name: Estimate(values[name], "", withheld=None if values[name] is not None else "not seen")
        for name in CURVE_PARAMETERS
    }
    absent = {name: Estimate(None, "", withheld="one law") for name in CURVE_PARAMETERS}
    names = ("inertia", "mean.static_torque", "mean.coulomb_torque", "torque_offset")
    return IdentifiedRobot(
        inertia=Estimate(0.026, "kg m^2"),
        positive=absent,
        negative=absent,
        mean=mean,
        torque_offset=Estimate(0.02, "N m"),
        runs=(),
        notes=(),
        covariance=Covariance(names, np.diag([1e-8, 1e-6, 1e-6, 1e-6])),
    )


def test_one_law_moves_both_directions() -> None:
    robot = one_law().robot()
    assert robot is not None
    assert robot.friction.positive == robot.friction.negative
    assert robot.friction.positive.static_torque == 0.5
    assert list(one_law().laws()) == ["mean"]


def test_draws_of_one_law_keep_both_directions_alike() -> None:
    drawn = one_law().draws(50, np.random.default_rng(1))
    assert len(drawn) == 50
    assert all(robot.friction.positive == robot.friction.negative for robot in drawn)
    assert 5e-4 < np.std([robot.friction.positive.static_torque for robot in drawn]) < 2e-3


def test_a_withheld_parameter_of_the_one_law_leaves_no_robot() -> None:
    assert one_law(static_torque=None).robot() is None
    assert one_law(static_torque=None).one_law


def test_a_law_is_drawn_as_far_as_it_is_known() -> None:
    assert one_law().curves()[1].static_torque == 0.5
    line = one_law(static_torque=None, stribeck_velocity=None).curves()
    assert {curve.total(np.array([2.0]))[0] for curve in line.values()} == {0.4 + 2.0 * 0.08}
    assert one_law(viscous_damping=None).curves() == {}

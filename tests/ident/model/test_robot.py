"""The robot's own rules and its mean."""

import math

import pytest

from ident.model import published
from ident.model.friction import ModelError
from ident.model.robot import OneLinkRobot
from tests.bad_values import NO_NUMBERS, each_refused


@pytest.mark.parametrize("inertia", [0.0, -0.1, math.nan, math.inf])
def test_an_inertia_is_positive_and_finite(inertia: float) -> None:
    with pytest.raises(ModelError, match="inertia"):
        OneLinkRobot(inertia, published.symmetric_robot().friction)


def test_the_mean_robot_is_symmetric_and_its_own_mean() -> None:
    mean = published.asymmetric_robot().mean()
    assert mean.friction.positive == mean.friction.negative
    assert mean.mean() == mean


def test_what_is_no_robot_is_refused_by_name() -> None:
    given = {"inertia": 0.026, "friction": published.symmetric_robot().friction}
    each_refused(OneLinkRobot, given, {"inertia": NO_NUMBERS, "friction": (None, published.POSITIVE)})

"""The robot's own rules and its mean."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ident.model import published
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
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


def test_single_precision_goes_no_further_than_the_values_themselves() -> None:
    """A model made of numpy's single numbers computes as one made of the same numbers in double."""

    def robot(kind: Callable[[Any], Any]) -> OneLinkRobot:
        values = [kind(np.float32(value)) for value in (0.5, 0.38, 0.1, 0.08)]
        law = StribeckFriction.symmetric(StribeckCurve(*values))
        return OneLinkRobot(kind(np.float32(0.026)), law)

    single, double = robot(np.float32), robot(float)
    assert single == double
    for value in (single.inertia, single.friction.positive.steepest_fall):
        assert type(value) is float
    assert single.friction.positive.steepest_fall == double.friction.positive.steepest_fall


def test_what_is_no_robot_is_refused_by_name() -> None:
    given = {"inertia": 0.026, "friction": published.symmetric_robot().friction}
    each_refused(OneLinkRobot, given, {"inertia": NO_NUMBERS, "friction": (None, published.POSITIVE)})

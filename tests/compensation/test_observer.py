"""The observer's two discrete forms against eq (7)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compensation.observer import believed_damping, euler_change, exact_change
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.response import law_array

MODEL = law_array(symmetric_robot())
L = 73.5
RATE = 0.0809 / 0.026 + L  # of v_hat with q held


@given(st.floats(-3, 3), st.floats(-1, 1), st.floats(1e-5, 0.02))
def test_the_exact_step_solves_the_linear_equation(estimate: float, feedback: float, period: float) -> None:
    rest = feedback / 0.026 / RATE
    after = rest + (estimate - rest) * math.exp(-RATE * period)
    assert estimate + exact_change(estimate, feedback, period, L, MODEL) == pytest.approx(after, abs=1e-13)


@given(st.floats(-3, 3), st.floats(-1, 1))
def test_both_steps_agree_to_first_order(estimate: float, feedback: float) -> None:
    h = 1e-7
    euler, exact = (change(estimate, feedback, h, L, MODEL) for change in (euler_change, exact_change))
    assert euler == pytest.approx(exact, rel=1e-5, abs=1e-18)


def test_the_damping_is_that_of_the_estimate_s_direction() -> None:
    model = law_array(asymmetric_robot())
    assert believed_damping(0.1, -1.0, model) == 0.0828
    assert believed_damping(-0.1, 1.0, model) == 0.0790
    assert (believed_damping(0.0, 1.0, model), believed_damping(0.0, -1.0, model)) == (0.0828, 0.0790)


def test_a_steady_motion_is_estimated_without_bias_by_euler() -> None:
    speed, damping, h = 0.4, 0.0809, 1e-3
    feedback = damping * speed  # the observer's model has no friction but b
    z, position = -L * 0.0, 0.0
    for k in range(2000):
        position = speed * h * k
        z += euler_change(z + L * position, feedback, h, L, MODEL)
    assert z + L * speed * h * 2000 == pytest.approx(speed, rel=1e-9)

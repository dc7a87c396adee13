"""The controller's own rules."""

from __future__ import annotations

import pytest

from compensation.controller import Controller, Gains, with_gain
from ident.model.published import symmetric_robot
from tests.bad_values import NO_NUMBERS, NO_WORDS, each_refused, refused

VALUES = {"proportional": 0.4, "derivative": 0.02, "observer": 73.5, "compensation": 1.0}
CONTROLLER = Controller(Gains(**VALUES), symmetric_robot())


@pytest.mark.parametrize("name", VALUES)
def test_a_gain_is_a_finite_number_from_0_on(name: str) -> None:
    each_refused(Gains, VALUES, {name: (*NO_NUMBERS, -1.0)})
    assert Gains(**{**VALUES, name: 2}) is not None


def test_what_is_no_controller_is_refused_by_name() -> None:
    each_refused(Gains, VALUES, {"proportional": (0.0,)})
    given = {"gains": CONTROLLER.gains, "model": CONTROLLER.model}
    each_refused(Controller, given, {"gains": (None, (0.4, 0.02, 73.5, 1.0)), "model": (None, CONTROLLER)})


def test_one_gain_is_changed_and_no_other() -> None:
    changed = with_gain(CONTROLLER, "L", 40.0)
    assert changed == Controller(Gains(0.4, 0.02, 40.0, 1.0), symmetric_robot())
    assert with_gain(changed, "L", 73.5) == CONTROLLER
    refused(lambda: with_gain(CONTROLLER, "z", 1.0), "parameter", "'z'")
    each_refused(with_gain, {"controller": CONTROLLER, "value": 1.0}, {"parameter": NO_WORDS})
    refused(lambda: with_gain(CONTROLLER, "r", -1.0), "compensation gain")

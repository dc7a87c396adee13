"""The gains over which equilibrium sets are drawn."""

import math

import numpy as np

from pipelines.equilibrium_sweeps import observer_gain_axis


def test_every_finite_mark_has_a_part_of_the_axis() -> None:
    for marks in ((73.07,), (73.07, 40.0), (73.07, 1e6), (1e-3, 73.07), (math.inf, 73.5), (math.inf, 0.0)):
        axis = observer_gain_axis(*marks)
        assert (np.diff(axis) > 0).all()
        for mark in marks:
            if 0 < mark < math.inf:
                assert 0.02 < np.mean(axis < mark) < 0.98

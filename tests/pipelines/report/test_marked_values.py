"""Names of marked values: each is readable, near ones too."""

from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from scipy.optimize import LinearConstraint, minimize

from data.recording import FloatArray
from pipelines.report.marked_values import mark_values, spread
from pipelines.report.style import new_figure

places = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6).map(lambda found: np.array(sorted(found)))


@given(places)
def test_places_keep_apart_and_on_the_axis(wanted: FloatArray) -> None:
    room = 0.15
    found = spread(wanted, room)
    assert (np.diff(found) >= room - 1e-12).all()
    assert found[0] >= 0.5 * room - 1e-12
    assert found[-1] <= 1.0 - 0.5 * room + 1e-12


def test_places_are_the_nearest_that_there_are() -> None:
    wanted, room = np.array([0.5, 0.52, 0.53, 0.9]), 0.1
    keep_apart = LinearConstraint(np.diff(np.eye(4), axis=0), room, np.inf)

    def missed(place: FloatArray) -> float:
        return float(np.sum((place - wanted) ** 2))

    best = minimize(missed, wanted, constraints=keep_apart, method="SLSQP")
    np.testing.assert_allclose(spread(wanted, room), best.x, atol=1e-6)


@pytest.mark.parametrize("count", [1, 3, 8, 30, 300])
def test_no_name_lies_on_another(count: int) -> None:
    figure = new_figure("marks", height=4.0)
    axes = figure.subplots()
    axes.set_xlim(0.8, 1.2)
    mark_values(axes, "r", list(1.0 + 2e-3 * np.arange(count) / max(count / 50, 1)))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    frame = axes.get_window_extent(renderer)
    boxes = [Text.get_window_extent(name, renderer) for name in axes.texts]
    assert boxes
    assert all(left.x1 <= right.x0 for left, right in pairwise(boxes))
    assert all(box.y0 >= frame.y1 for box in boxes)  # where no line crosses them
    assert len(axes.lines) == count

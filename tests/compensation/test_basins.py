"""Basins: published bistability, symmetry, and labels checked start by start."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from compensation.basins import Attractor, Rectangle, basins, where_it_settles
from compensation.closed_loop import ClosedLoop
from compensation.coexistence import largest_compensation_with_rest
from compensation.controller import Controller, Gains
from compensation.equilibria import equilibrium_set
from ident.model.friction import ModelError
from ident.model.published import asymmetric_robot, symmetric_robot
from ident.model.robot import OneLinkRobot
from ident.simulation.filippov_system import FloatArray
from tests.bad_values import NO_ARRAYS, each_refused


def loop(r: float, observer: float = 73.5, robot: OneLinkRobot | None = None) -> ClosedLoop:
    gains = Gains(proportional=0.4, derivative=0.02, observer=observer, compensation=r)
    return ClosedLoop(robot or symmetric_robot(), Controller(gains, symmetric_robot()))


def settled(case: ClosedLoop, x1: float) -> Attractor:
    found = where_it_settles(case, np.array([x1, 0.0, 0.0]))
    assert found is not None
    return found


def test_the_real_rig_is_bistable() -> None:
    case = loop(1.02, robot=asymmetric_robot())
    assert settled(case, -0.1).kind == "equilibrium_set"
    for x1 in (0.6, -0.6, 0.1):
        assert settled(case, x1).kind == "limit_cycle"
    found = basins(case, Rectangle((-0.3, 0.1), (-0.02, 0.02), (20, 3)))
    assert {attractor.kind for attractor in found.attractors} == {"limit_cycle", "equilibrium_set"}
    assert found.undecided_area == 0.0
    assert sum(found.areas) == pytest.approx(0.4 * 0.04)


def test_rests_that_coexist_with_the_cycle_below_the_critical_gain() -> None:
    """At L = 40 rests end at r_max = 1.03499: a start in one stays, 1e-6 beyond r_max there is none."""
    r_max = largest_compensation_with_rest(symmetric_robot(), loop(1.0, 40.0).controller).r_max
    case = loop(r_max - 1e-6, 40.0)
    segment = equilibrium_set(case.robot, case.controller).segments[0]
    x1 = 0.5 * (segment.x1_min + segment.x1_max)
    x2 = 0.5 * (segment.speed_min + segment.speed_max) * (1.0 if segment.direction == "positive" else -1.0)
    resting = where_it_settles(case, np.array([x1, x2, -x2]))
    assert resting is not None
    assert (resting.kind, resting.x1_min) == ("equilibrium_set", segment.x1_min)
    assert settled(case, 0.6).kind == "limit_cycle"
    beyond = where_it_settles(loop(r_max + 1e-6, 40.0), np.array([x1, x2, -x2]), duration=200.0)
    assert beyond is not None
    assert beyond.kind == "limit_cycle"


def test_a_symmetric_loop_has_symmetric_basins_and_takes_any_map() -> None:
    calls = []

    def backwards(
        function: Callable[[FloatArray], Attractor | None], items: Iterable[FloatArray], /
    ) -> Iterable[Attractor | None]:
        calls.append(1)
        return [function(item) for item in reversed(list(items))][::-1]

    starts = Rectangle((-1.0, 1.0), (-3.0, 3.0), (8, 6))
    found = basins(loop(0.95), starts, map=backwards)
    assert len(calls) == 1
    (rests,) = found.attractors
    assert rests.kind == "equilibrium_set"
    assert rests.x1_min == pytest.approx(-rests.x1_max)
    assert found.areas == pytest.approx((12.0,))
    np.testing.assert_array_equal(found.labels, basins(loop(0.95), starts).labels)


def test_mirrored_cycles_are_two_attractors_with_mirrored_basins() -> None:
    """At r - 1 = 1e-5 a pair of asymmetric cycles is left of the symmetric one."""
    case = loop(1.00001)
    found = basins(case, Rectangle((-0.002, 0.002), (-1e-5, 1e-5), (6, 2)), duration=80.0)
    assert [attractor.kind for attractor in found.attractors] == ["limit_cycle", "limit_cycle"]
    one, other = found.attractors
    assert one.x1_min == pytest.approx(-other.x1_max, rel=1e-6)
    np.testing.assert_array_equal(found.labels, 1 - found.labels[::-1])


def test_a_start_that_has_not_settled_is_undecided() -> None:
    found = basins(loop(1.1), Rectangle((0.5, 1.0), (-1.0, 1.0), (2, 2)), duration=0.5)
    assert found.attractors == ()
    assert set(found.labels) == {-1}
    assert found.undecided_area == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("x1", "cells", "said"),
    [((1.0, 0.0), (2, 2), "x1"), ((0.0, np.nan), (2, 2), "x1"), ((0.0, 1.0), (0, 2), "cells")],
)
def test_bad_rectangles_are_named(x1: tuple[float, float], cells: tuple[int, int], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        Rectangle(x1, (-1.0, 1.0), cells)


def test_what_is_no_number_is_refused_by_name() -> None:
    given = {"x1": (0.0, 1.0), "velocity": (0.0, 1.0), "cells": (2, 2)}
    spans = (*NO_ARRAYS, 1.0, (0.0, 1.0, 2.0), (0.0, np.inf), (1.0, 1.0))
    bad = {"x1": spans, "velocity": spans, "cells": (2, None, "22", (2,), (2.0, 2), (2, -1), (2, 2, 2))}
    each_refused(Rectangle, given, bad)

"""The event loop on a second system, a mass on a spring with dry friction, whose solution is closed form.

x' = v, v' = -x - mu sign(v), held while |x| <= mu: half turns are half circles about -+mu, each 2 mu shorter
than the last, until the mass rests.
"""

from typing import Final

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from ident.simulation.compiled import compiled, owning, passed
from ident.simulation.dormand_prince import DORMAND_PRINCE
from ident.simulation.filippov_system import (
    FilippovSystem,
    FloatArray,
    Signs,
    Surfaces,
    no_series,
    no_slide,
    no_slide_at,
)
from ident.simulation.integrate import (
    EQUILIBRIUM,
    TIME_REACHED,
    Progress,
    Record,
    Settings,
    integrate,
    memory_shape,
)
from ident.simulation.taylor import TAYLOR

MU: Final = 0.1


@compiled
def field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    out[0] = state[1]
    out[1] = -state[0] - parameters[0] * signs[0]


@compiled
def series(
    signs: Signs, state: FloatArray, parameters: FloatArray, order: int, c: FloatArray, work: FloatArray
) -> float:
    c[0, 0], c[1, 0] = state[0], state[1]
    for k in range(order):
        c[0, k + 1] = c[1, k] / (k + 1)
        c[1, k + 1] = (-c[0, k] - (parameters[0] * signs[0] if k == 0 else 0.0)) / (k + 1)
    return np.inf


@compiled
def slide(signs: Signs, state: FloatArray, parameters: FloatArray) -> tuple[float, int, int, int]:
    return np.inf, 0, 0, 0


@compiled
def slide_at(signs: Signs, state: FloatArray, parameters: FloatArray, time: float, out: FloatArray) -> None:
    out[0], out[1] = state[0], 0.0


SYSTEM = FilippovSystem(passed(field), passed(series), passed(slide), passed(slide_at))
ROWS = np.array([[0.0, 1.0, 0.0]])
PIVOTS = np.array([1])


@owning
def by_series(
    mu: FloatArray, settings: Settings, state: FloatArray, signs: Signs, contact: Signs, record: Record
) -> Progress:
    on, memory = Surfaces(ROWS, PIVOTS), np.full(memory_shape(2, 1), np.nan)
    return integrate(TAYLOR, SYSTEM, on, mu, settings, 0.0, state, signs, contact, record, memory)


@owning
def by_dormand_prince(
    mu: FloatArray, settings: Settings, state: FloatArray, signs: Signs, contact: Signs, record: Record
) -> Progress:
    on, memory = Surfaces(ROWS, PIVOTS), np.full(memory_shape(2, 1), np.nan)
    return integrate(DORMAND_PRINCE, SYSTEM, on, mu, settings, 0.0, state, signs, contact, record, memory)


def exact(time: FloatArray, start: float) -> tuple[NDArray[np.float64], float, float]:
    """x(t) from rest at `start` > mu; when and where it rests."""
    x = np.empty_like(time)
    begin, at, half = 0.0, start, 0
    while abs(at) > MU:
        centre = MU * np.sign(at)
        inside = (time >= begin) & (time <= begin + np.pi)
        x[inside] = centre + (at - centre) * np.cos(time[inside] - begin)
        at = 2 * centre - at
        begin += np.pi
        half += 1
    x[time > begin] = at
    return x, begin, at


@pytest.mark.parametrize("run", [by_series, by_dormand_prince])
@pytest.mark.parametrize("start", [1.0, 0.55, 0.11])
def test_dry_friction_oscillator(run: object, start: float) -> None:
    assert callable(run)
    time = np.linspace(0.0, 20.0, 301)
    events = 32
    record = Record(
        time, np.empty((301, 2)), np.empty(events), np.empty(events, np.int64),
        np.empty((events, 1), np.int64), np.empty((events, 2)),
    )  # fmt: skip
    state, signs, contact = np.array([start, 0.0]), np.array([-1]), np.array([1])
    end = run(np.array([MU]), Settings(1e-12, 20.0, 10_000, -1, 0, 0), state, signs, contact, record)
    x, rests_at, rest = exact(time, start)
    assert end.reason == EQUILIBRIUM
    assert end.time == pytest.approx(rests_at, abs=1e-10)
    assert state[0] == pytest.approx(rest, abs=1e-10)
    np.testing.assert_allclose(record.states[:, 0], x, atol=1e-9)
    np.testing.assert_allclose(
        record.event_times[: end.events], np.pi * np.arange(1, end.events + 1), atol=1e-10
    )


@pytest.mark.parametrize("run", [by_series, by_dormand_prince])
def test_without_friction_energy_is_kept(run: object) -> None:
    assert callable(run)
    none = Record(
        np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0, np.int64), np.empty((0, 1), np.int64),
        np.empty((0, 2)),
    )  # fmt: skip
    state, signs, contact = np.array([1.0, 0.0]), np.array([-1]), np.array([1])
    end = run(np.array([0.0]), Settings(1e-13, 100.0, 100_000, -1, 0, 0), state, signs, contact, none)
    assert end.reason == TIME_REACHED
    assert state == pytest.approx([np.cos(100.0), -np.sin(100.0)], abs=1e-9)


@pytest.mark.parametrize("power", [-700, -520, 500])
def test_steps_are_the_same_at_any_size_of_the_state(power: int) -> None:
    """Without friction the motion scales with its start: by a power of two bit for bit."""
    ends = []
    for size in (1.0, 2.0**power):
        none = Record(
            np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0, np.int64), np.empty((0, 1), np.int64),
            np.empty((0, 2)),
        )  # fmt: skip
        state, signs, contact = np.array([size, 0.0]), np.array([-1]), np.array([1])
        end = by_dormand_prince(
            np.array([0.0]), Settings(1e-10, 20.0, 2000, -1, 0, 0), state, signs, contact, none
        )
        assert end.reason == TIME_REACHED
        ends.append((end.steps, *(state / size)))
    assert ends[1] == ends[0]


@compiled
def braking_field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    """A sliding mass under friction that rises steeply at low speed: v' = -sign(v) (1 + 4 exp(-(v/w)^2))."""
    out[0] = state[1]
    out[1] = -signs[0] * (1.0 + 4.0 * np.exp(-((state[1] / parameters[0]) ** 2)))


BRAKING = FilippovSystem(passed(braking_field), passed(no_series), passed(no_slide), passed(no_slide_at))


@owning
def brake(
    width: FloatArray, settings: Settings, state: FloatArray, signs: Signs, contact: Signs, record: Record
) -> Progress:
    on, memory = Surfaces(ROWS, PIVOTS), np.full(memory_shape(2, 1), np.nan)
    return integrate(DORMAND_PRINCE, BRAKING, on, width, settings, 0.0, state, signs, contact, record, memory)


def lost(power: int) -> float:
    """Integral of u^power 4 exp(-u^2) / (1 + 4 exp(-u^2)): what the peak takes from the halt."""
    value: float = quad(lambda u: u**power * 4.0 / (np.exp(u * u) + 4.0), 0.0, 7.0, epsabs=1e-14)[0]
    return value


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("width", [0.1, 0.01, 0.001, 1e-4])
def test_a_halt_is_not_found_across_friction_that_no_stage_has_seen(width: float, tolerance: float) -> None:
    """From v = 1 the time to halt is the integral of dv / |v'|, the way that of v dv / |v'|."""
    state, signs, contact = np.array([0.0, 1.0]), np.array([1]), np.array([0])
    record = Record(
        np.empty(0), np.empty((0, 2)), np.empty(1), np.empty(1, np.int64), np.empty((1, 1), np.int64),
        np.empty((1, 2)),
    )  # fmt: skip
    end = brake(np.array([width]), Settings(tolerance, 5.0, 1000, -1, 0, 0), state, signs, contact, record)
    slack = 20.0 * tolerance + 1e-13
    assert end.events == 1
    assert record.event_times[0] == pytest.approx(1.0 - width * lost(0), abs=slack)
    assert record.event_states[0] == pytest.approx([0.5 - width**2 * lost(1), 0.0], abs=slack)


@compiled
def dipping_field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    """h'' = 2 on its own side of h = 0 and -2 beyond: a parabola that touches, or a way without return.

    The third component is 1 throughout: what a tolerance is relative to.
    """
    out[0] = state[1]
    out[1] = 2.0 * signs[0]
    out[2] = 0.0


@compiled
def dipping_series(
    signs: Signs, state: FloatArray, parameters: FloatArray, order: int, c: FloatArray, work: FloatArray
) -> float:
    for k in range(order + 1):
        c[0, k] = c[1, k] = c[2, k] = 0.0
    c[0, 0], c[0, 1], c[0, 2] = state[0], state[1], float(signs[0])
    c[1, 0], c[1, 1], c[2, 0] = state[1], 2.0 * signs[0], state[2]
    return np.inf


DIPPING = FilippovSystem(passed(dipping_field), passed(dipping_series), passed(no_slide), passed(no_slide_at))


@owning
def dip_by_series(
    settings: Settings, state: FloatArray, signs: Signs, contact: Signs, record: Record
) -> Progress:
    on, memory = (
        Surfaces(np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([0])),
        np.full(memory_shape(3, 1), np.nan),
    )
    return integrate(TAYLOR, DIPPING, on, np.empty(0), settings, 0.0, state, signs, contact, record, memory)


@owning
def dip_by_dormand_prince(
    settings: Settings, state: FloatArray, signs: Signs, contact: Signs, record: Record
) -> Progress:
    on, memory = (
        Surfaces(np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([0])),
        np.full(memory_shape(3, 1), np.nan),
    )
    return integrate(
        DORMAND_PRINCE, DIPPING, on, np.empty(0), settings, 0.0, state, signs, contact, record, memory
    )


@pytest.mark.parametrize("run", [dip_by_series, dip_by_dormand_prince])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("depth", "ends"), [(-1e-9, 0.0), (0.0, 0.0), (1e-13, 0.0), (1e-11, 0.0), (1e-9, -1.0)]
)
def test_a_crossing_shallower_than_the_tolerance_is_a_touch(
    run: object, side: int, depth: float, ends: float
) -> None:
    """h = (t - 1)^2 - depth turns back at t = 1, or goes on beyond from t = 1 - root without return."""
    assert callable(run)
    record = Record(
        np.array([2.0]), np.empty((1, 3)), np.empty(4), np.empty(4, np.int64), np.empty((4, 1), np.int64),
        np.empty((4, 3)),
    )  # fmt: skip
    state, signs, contact = side * np.array([1.0 - depth, -2.0, 1.0]), np.array([side]), np.array([0])
    end = run(Settings(1e-10, 2.0, 1000, -1, 0, 0), state, signs, contact, record)
    root = np.sqrt(max(depth, 0.0))
    after = 1.0 + root
    expected = [1.0, 2.0] if ends == 0.0 else [-(after**2) - 2.0 * root * after, -2.0 * after - 2.0 * root]
    assert end.reason == TIME_REACHED
    assert end.events in ((0,) if depth < 0.0 else (1,) if depth > 0.0 else (0, 1))
    assert side * state[:2] == pytest.approx(expected, abs=1e-8)
    assert end.time == 2.0
    if end.events:
        assert record.event_signs[0, 0] == (side if ends == 0.0 else -side)

"""Lanes know no robot: a mass on a spring, pushed to and fro by a relay, beside its closed form.

x'' = -x - mu sign(x): the relay switches where x = 0, always crossed with speed; between, the mass moves on
an arc around -mu or +mu. No mode slides.
"""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np
from numba import float64, int64, types
from numpy.typing import NDArray

from ident.simulation.compiled import address_of, calls, compiled, owning, passed
from ident.simulation.filippov_system import (
    FilippovSystem,
    FloatArray,
    Signs,
    Surfaces,
    no_slide,
    no_slide_at,
)
from ident.simulation.integrate import (
    TIME_REACHED,
    Progress,
    Record,
    Settings,
    integrate,
    memory_shape,
)
from ident.simulation.lanes import (
    LANES,
    Batch,
    LaneSystem,
    integrate_side_by_side,
    lanes_of,
    table_of,
)
from ident.simulation.packs import pack_at, place_pack, spread
from ident.simulation.taylor import ORDER, TAYLOR

ROWS: Final = np.array([[1.0, 0.0, 0.0]])
PIVOTS: Final = np.array([0])
TOLERANCE, END = 1e-13, 30.0


@compiled
def field(signs: Signs, state: FloatArray, parameters: FloatArray, out: FloatArray) -> None:
    out[0], out[1] = state[1], -state[0] - parameters[0, 0] * signs[0]


@compiled
def series(
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    order: int,
    coefficients: FloatArray,
    work: FloatArray,
) -> float:
    coefficients[0, 0], coefficients[1, 0] = state[0], state[1]
    for k in range(order):
        push = -parameters[0, 0] * signs[0] if k == 0 else 0.0
        coefficients[0, k + 1] = coefficients[1, k] / (k + 1)
        coefficients[1, k + 1] = (-coefficients[0, k] + push) / (k + 1)
    return inf


@compiled
def enter(signs: Signs, parameters: FloatArray, lane: int, modes: FloatArray) -> None:
    modes[0, lane] = -parameters[0, 0] * signs[0]


@compiled
def lane_series(
    modes: FloatArray, states: FloatArray, coefficients: FloatArray, work: FloatArray, reach: FloatArray
) -> None:
    row = (ORDER + 1) * LANES
    x, v, push = pack_at(8, states, 0), pack_at(8, states, LANES), pack_at(8, modes, 0)
    for k in range(ORDER + 1):
        place_pack(coefficients, k * LANES, x)
        place_pack(coefficients, row + k * LANES, v)
        share = spread(8, 1.0 / (k + 1))
        x, v = v * share, (push - x) * share
        push = spread(8, 0.0)
    for lane in range(LANES):
        reach[lane] = inf


SYSTEM = FilippovSystem(passed(field), passed(series), passed(no_slide), passed(no_slide_at))
PROGRESS = types.NamedTuple((float64, *4 * (int64,)), Progress)  # type: ignore[no-untyped-call]  # numba
ALONE = PROGRESS(
    float64[:, ::1], float64, float64, int64, float64, float64[::1], int64[::1], int64[::1], float64[::1],
    float64[:, ::1], int64[:, ::1],
)  # fmt: skip
alone_at = calls(ALONE)


@owning
def alone(
    table: FloatArray,
    tolerance: float,
    end: float,
    steps: int,
    time: float,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    times: FloatArray,
    states: FloatArray,
    no_modes: Signs,
) -> Progress:
    settings = Settings(tolerance, end, steps, -1, 0, 0)
    record = Record(times, states, times[:0], signs[:0], no_modes, states[:0])
    memory = np.full(memory_shape(2, 1), np.nan)
    on = Surfaces(ROWS, PIVOTS)
    return integrate(TAYLOR, SYSTEM, on, table, settings, time, state, signs, contact, record, memory)


@compiled
def go_on(
    run: int, batch: Batch, index: int, tolerance: float, end: float, steps: int, time: float, output: int
) -> Progress:
    table = batch.tables[table_of(batch, index)]
    now: Progress = alone_at(
        run,
        (
            table, tolerance, end, steps, time, batch.states[index], batch.signs[index],
            batch.contacts[index], batch.times[output:], batch.wanted[index, output:], batch.signs[:0],
        ),
    )  # fmt: skip
    return now


RELAY = LaneSystem(enter=passed(enter), series=passed(lane_series))
GO_ON = passed(go_on)


@owning
def side_by_side(run: int, batch: Batch, part: int, parts: int) -> None:
    at, memory = lanes_of(2, 1, 1)
    on = Surfaces(ROWS, PIVOTS)
    integrate_side_by_side(RELAY, GO_ON, run, on, batch, at, memory, part, parts, TOLERANCE, END, 10_000)


def exact(times: FloatArray, start: float, mu: float) -> NDArray[np.float64]:
    """x(t) from rest at `start` > 0: arcs around -mu and +mu, each of them entered and left at x = 0."""
    radius = start + mu
    first = np.arccos(mu / radius)  # until x = 0, from the top of the arc
    half = 2.0 * first
    swing = np.floor((times + first) / half)
    inside = times - half * swing
    x: NDArray[np.float64] = (-1.0) ** swing * (radius * np.cos(inside) - mu)
    return x


def test_lanes_follow_another_system_to_its_closed_form() -> None:
    count = 21  # no multiple of the lanes, cut into two parts
    mu = np.linspace(0.05, 2.0, count)
    starts = np.linspace(1.5, 0.3, count)
    times = np.linspace(0.0, END, 137)
    batch = Batch(
        tables=mu.reshape(count, 1, 1),
        times=times,
        wanted=np.full((count, times.size, 2), np.nan),
        states=np.column_stack([starts, np.zeros(count)]),
        signs=np.ones((count, 1), np.int64),
        contacts=np.zeros((count, 1), np.int64),
        end_times=np.zeros(count),
        reasons=np.full(count, -1),
    )
    for part in range(2):
        side_by_side(address_of(alone, ALONE), batch, part, 2)
    assert np.all(batch.reasons == TIME_REACHED)
    assert np.all(batch.end_times == END)
    for index in range(count):
        truth = exact(times, float(starts[index]), float(mu[index]))
        np.testing.assert_allclose(batch.wanted[index, :, 0], truth, atol=2e-11)
        np.testing.assert_allclose(batch.wanted[index, -1], batch.states[index], atol=1e-14)

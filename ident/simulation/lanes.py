"""Many trajectories side by side: eight at a time in the lanes of packs, each with its own step.

A lane takes those steps that provably meet no surface, which are nearly all, by a Taylor series that is a
pack wide (`packs`). Every other step, events and slides with it, is handed to `integrate` for that trajectory
alone, which gives it back where it moves inside a mode again. A lane whose trajectory has ended takes the
next one, so that all are busy until few are left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from ident.simulation.compiled import compiled, owning, specialised
from ident.simulation.filippov_system import FloatArray, Signs, Surfaces
from ident.simulation.integrate import STEP_LIMIT, TIME_REACHED, VANISHED, Progress
from ident.simulation.packs import (
    fused,
    larger,
    magnitude,
    pack_at,
    place_pack,
    smaller,
    spread,
)
from ident.simulation.taylor import ORDER, SMALLEST, true_length

LANES: Final = 8
WORK_SERIES: Final = 8  # rows of memory for a system's own series
ALONE_FIRST: Final = (
    4  # steps that a trajectory takes alone: to the surface, and off it; doubled if not enough
)
IDLE: Final = -1


class LaneSystem(NamedTuple):
    """The compiled functions of a system that can go side by side."""

    enter: Callable[[Signs, FloatArray, int, FloatArray], None]
    """enter(signs, parameters, lane, modes): the numbers of a mode into a column of `modes` (c, LANES)."""
    series: Callable[[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], None]
    """series(modes, states, coefficients, work, reach): as `FilippovSystem.series`, for all lanes.

    `states` (n, LANES), `coefficients` (n, ORDER + 1, LANES), `work` (WORK_SERIES, ORDER + 1, LANES), `reach`
    (LANES,).
    """


class Batch(NamedTuple):
    """Trajectories to be followed, and memory for where they go."""

    tables: FloatArray  # (1 or n, ...) parameters of all, or of each
    times: FloatArray  # (k,) ascending, at which states are wanted
    wanted: FloatArray  # (n, k, d) those states
    states: FloatArray  # (n, d) the starts, which become the ends
    signs: Signs  # (n, m)
    contacts: Signs  # (n, m)
    end_times: FloatArray  # (n,)
    reasons: Signs  # (n,)


class Lanes(NamedTuple):
    """Where the lanes stand."""

    who: Signs  # (LANES,) which trajectory, or IDLE
    time: FloatArray  # (LANES,)
    output: Signs  # (LANES,) the next of the wanted times
    steps: Signs  # (LANES,)
    states: FloatArray  # (n, LANES)
    modes: FloatArray  # (c, LANES) numbers of the modes
    sides: FloatArray  # (m, LANES) signs of the modes


class Memory(NamedTuple):
    """What the lanes need besides."""

    coefficients: FloatArray  # (n, ORDER + 1, LANES)
    work: FloatArray  # (WORK_SERIES, ORDER + 1, LANES)
    ends: FloatArray  # (n, LANES) states at the ends of the steps
    spreads: FloatArray  # (n, LANES) how far they may be from the beginnings, on the way
    given: FloatArray  # (n, LANES) outputs
    clear: FloatArray  # (m, LANES) distances from the surfaces
    left: FloatArray  # (LANES,) until the end
    lengths: FloatArray  # (LANES,) of the steps, 0 where none is taken
    reach: FloatArray  # (LANES,) of the series
    theta: FloatArray  # (LANES,) of the outputs


@owning
def lanes_of(n: int, m: int, columns: int) -> tuple[Lanes, Memory]:
    """Idle lanes for n states, m surfaces and `columns` numbers of a mode, and their memory."""
    return (
        Lanes(
            np.full(LANES, IDLE),
            np.zeros(LANES),
            np.zeros(LANES, np.int64),
            np.zeros(LANES, np.int64),
            np.zeros((n, LANES)),
            np.ones((columns, LANES)),
            np.ones((m, LANES)),
        ),
        Memory(
            np.zeros((n, ORDER + 1, LANES)),
            np.zeros((WORK_SERIES, ORDER + 1, LANES)),
            np.zeros((n, LANES)),
            np.zeros((n, LANES)),
            np.zeros((n, LANES)),
            np.zeros((m, LANES)),
            np.ones(LANES),
            np.zeros(LANES),
            np.zeros(LANES),
            np.zeros(LANES),
        ),
    )


@specialised
def integrate_side_by_side(
    system: LaneSystem,
    go_on: Callable[..., Progress],
    run: int,
    surfaces: Surfaces,
    batch: Batch,
    at: Lanes,
    memory: Memory,
    part: int,
    parts: int,
    tolerance: float,
    end: float,
    step_limit: int,
) -> None:
    """Follow trajectories `part`, `part` + `parts`, ... of a batch to their ends.

    `go_on(run, batch, index, tolerance, end, steps, time, output)` is `integrate` for one of them, from the
    next of its outputs on; `run` is what it needs to know.
    """
    n, m = batch.states.shape[1], batch.signs.shape[1]
    states, coefficients, work = at.states, memory.coefficients, memory.work
    ends, spreads, given, clear = memory.ends, memory.spreads, memory.given, memory.clear
    left, lengths, reach, theta = memory.left, memory.lengths, memory.reach, memory.theta
    who, time, output, steps = at.who, at.time, at.output, at.steps
    times, wanted = batch.times, batch.wanted
    following = part
    running = 0
    for lane in range(LANES):
        following = _take(system, go_on, run, batch, at, lane, following, parts, tolerance, end, step_limit)
        running += 1 if who[lane] != IDLE else 0
    while running > 0:
        for lane in range(LANES):
            left[lane] = end - time[lane] if who[lane] != IDLE else 1.0
        system.series(at.modes, states, coefficients, work, reach)
        _step(n, tolerance, left, reach, states, coefficients, lengths, ends, spreads)
        _clearance(n, m, surfaces, at.sides, states, spreads, clear)
        for lane in range(LANES):
            free = who[lane] != IDLE and steps[lane] < step_limit and _stays_large(n, ends, lane)
            for i in range(m):
                free = free and clear[i, lane] > 0.0
            if not free:
                lengths[lane] = 0.0
        while _next_outputs(times, time, output, lengths, left, end, theta):
            _give(n, wanted, who, output, theta, coefficients, given)
        for lane in range(LANES):
            if who[lane] == IDLE:
                continue
            if lengths[lane] > 0.0:
                steps[lane] += 1
                time[lane] = end if lengths[lane] == left[lane] else time[lane] + lengths[lane]
                for i in range(n):
                    states[i, lane] = ends[i, lane]
                ended = time[lane] >= end
                if ended:
                    _put_back(batch, at, lane)
                    batch.end_times[who[lane]], batch.reasons[who[lane]] = end, TIME_REACHED
            else:
                _put_back(batch, at, lane)
                ended = _alone(system, go_on, run, batch, at, lane, tolerance, end, step_limit)
            if ended:
                following = _take(
                    system, go_on, run, batch, at, lane, following, parts, tolerance, end, step_limit
                )
                running -= 1 if who[lane] == IDLE else 0


@specialised
def _take(
    system: LaneSystem,
    go_on: Callable[..., Progress],
    run: int,
    batch: Batch,
    at: Lanes,
    lane: int,
    following: int,
    parts: int,
    tolerance: float,
    end: float,
    step_limit: int,
) -> int:
    """Let a lane begin with the next trajectory that does not end at once; which one is next then."""
    at.who[lane] = IDLE
    while following < batch.states.shape[0]:
        at.who[lane] = following
        at.time[lane], at.output[lane], at.steps[lane] = 0.0, 0, 0
        following += parts
        if not _alone(system, go_on, run, batch, at, lane, tolerance, end, step_limit):
            return following
        at.who[lane] = IDLE
    return following


@specialised
def _alone(
    system: LaneSystem,
    go_on: Callable[..., Progress],
    run: int,
    batch: Batch,
    at: Lanes,
    lane: int,
    tolerance: float,
    end: float,
    step_limit: int,
) -> bool:
    """Follow a trajectory by itself until it moves inside a mode; whether it has ended before."""
    index = at.who[lane]
    allowance = ALONE_FIRST
    while True:
        allowed = min(allowance, step_limit - at.steps[lane])
        now = go_on(run, batch, index, tolerance, end, allowed, at.time[lane], at.output[lane])
        at.time[lane] = now.time
        at.output[lane] += now.outputs
        at.steps[lane] += now.steps
        if now.reason != STEP_LIMIT or now.steps < allowed or at.steps[lane] >= step_limit:
            batch.end_times[index], batch.reasons[index] = now.time, now.reason
            return True
        inside = True
        for i in range(batch.signs.shape[1]):
            inside = inside and batch.signs[index, i] != 0 and batch.contacts[index, i] == 0
        if inside:
            break
        allowance *= 2
    system.enter(batch.signs[index], batch.tables[table_of(batch, index)], lane, at.modes)
    for i in range(batch.signs.shape[1]):
        at.sides[i, lane] = batch.signs[index, i]
    for i in range(batch.states.shape[1]):
        at.states[i, lane] = batch.states[index, i]
    return False


@specialised
def table_of(batch: Batch, index: int) -> int:
    """Which of a batch's tables has the parameters of a trajectory."""
    last: int = batch.tables.shape[0] - 1
    return min(index, last)


@specialised
def _put_back(batch: Batch, at: Lanes, lane: int) -> None:
    for i in range(batch.states.shape[1]):
        batch.states[at.who[lane], i] = at.states[i, lane]


@specialised
def _step(
    n: int,
    tolerance: float,
    left: FloatArray,
    reach: FloatArray,
    states: FloatArray,
    coefficients: FloatArray,
    lengths: FloatArray,
    ends: FloatArray,
    spreads: FloatArray,
) -> None:
    """Lengths of the steps (LANES,), coefficients in theta, ends and spreads (n, LANES)."""
    size, last, before = spread(8, 0.0), spread(8, SMALLEST), spread(8, SMALLEST)
    for i in range(n):
        row = i * (ORDER + 1) * LANES
        size = larger(magnitude(pack_at(8, states, i * LANES)), size)
        last = larger(magnitude(pack_at(8, coefficients, row + ORDER * LANES)), last)
        before = larger(magnitude(pack_at(8, coefficients, row + (ORDER - 1) * LANES)), before)
    allowed = spread(8, tolerance) * larger(size, spread(8, SMALLEST))
    longest = smaller(pack_at(8, reach, 0), pack_at(8, left, 0))
    length = smaller(true_length(allowed, last, before), longest)
    place_pack(lengths, 0, length)
    for i in range(n):
        row = i * (ORDER + 1) * LANES
        scale = length
        value, bound = spread(8, 0.0), spread(8, 0.0)
        for k in range(1, ORDER + 1):
            term = pack_at(8, coefficients, row + k * LANES) * scale
            place_pack(coefficients, row + k * LANES, term)
            value, bound, scale = value + term, bound + magnitude(term), scale * length
        place_pack(ends, i * LANES, pack_at(8, states, i * LANES) + value)
        place_pack(spreads, i * LANES, bound)


@compiled
def _stays_large(n: int, ends: FloatArray, lane: int) -> bool:
    """Whether a lane's step does not lead below all numbers, where `integrate` tells what follows."""
    size = 0.0
    for i in range(n):
        size = max(size, abs(ends[i, lane]))
    return size >= VANISHED


@specialised
def _clearance(
    n: int,
    m: int,
    surfaces: Surfaces,
    sides: FloatArray,
    states: FloatArray,
    spreads: FloatArray,
    clear: FloatArray,
) -> None:
    """How far the steps stay from each surface (m, LANES), at least."""
    for i in range(m):
        value = spread(8, surfaces.rows[i, n])
        bound = spread(8, 0.0)
        for j in range(n):
            factor = spread(8, surfaces.rows[i, j])
            value = fused(factor, pack_at(8, states, j * LANES), value)
            bound = fused(magnitude(factor), pack_at(8, spreads, j * LANES), bound)
        place_pack(clear, i * LANES, pack_at(8, sides, i * LANES) * value - bound)


@specialised
def _next_outputs(
    times: FloatArray,
    time: FloatArray,
    output: Signs,
    lengths: FloatArray,
    left: FloatArray,
    end: float,
    theta: FloatArray,
) -> bool:
    """Where in their steps the lanes have their next outputs, -1 for none; whether there is one."""
    some = 0
    for lane in range(LANES):
        theta[lane] = -1.0
        if lengths[lane] > 0.0 and output[lane] < times.size:
            now = end if lengths[lane] == left[lane] else time[lane] + lengths[lane]
            wanted = times[output[lane]]
            if wanted <= now:
                theta[lane] = min((wanted - time[lane]) / lengths[lane], 1.0)
                some += 1
    return some > 0


@specialised
def _give(
    n: int,
    wanted: FloatArray,
    who: Signs,
    output: Signs,
    theta: FloatArray,
    coefficients: FloatArray,
    given: FloatArray,
) -> None:
    """Evaluate the series where outputs are due, and keep them."""
    x = pack_at(8, theta, 0)
    for i in range(n):
        row = i * (ORDER + 1) * LANES
        value = pack_at(8, coefficients, row + ORDER * LANES)
        for k in range(ORDER - 1, -1, -1):
            value = fused(value, x, pack_at(8, coefficients, row + k * LANES))
        place_pack(given, i * LANES, value)
    for lane in range(LANES):
        if theta[lane] >= 0.0:
            for i in range(n):
                wanted[who[lane], output[lane], i] = given[i, lane]
            output[lane] += 1

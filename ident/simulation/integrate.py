"""Event-driven integration of a Filippov system: from event to event, with the reason why it ended.

Inside a mode a one-step method (`taylor_step`, `dormand_prince_step`) gives the solution over a step as
polynomials. The first zero of a switching function along them ends the mode at that instant, to
rounding; the state is put onto the surface exactly, and Filippov's rule says whether it crosses or
slides. Slides are taken whole, in closed form.

Where several switching functions vanish within rounding of each other, their values at the first event
decide: whatever is found on the wrong side there has been reached as well, and all are resolved in the
order of the surfaces.

The loop is a kernel to be called from a compiled function that names the system and the method (see
`compiled`), and can be resumed: it leaves time, state, signs and contacts as they stand when it ends.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from ident.simulation.compiled import compiled, specialised
from ident.simulation.crossing import first_crossing
from ident.simulation.filippov_system import (
    FilippovSystem,
    FloatArray,
    OneStepMethod,
    Signs,
    Surfaces,
    assign,
    largest,
    leaving_rate,
    project,
    resolve,
    switching_value,
)
from ident.simulation.polynomials import evaluate, sum_up
from ident.simulation.taylor import ORDER
from ident.simulation.touching import back_along, drive_across, has_left, turn_back

TIME_REACHED: Final = 0
EQUILIBRIUM: Final = 1
STEP_LIMIT: Final = 2
SECTION: Final = 3
EVENTS_FULL: Final = 4
NOT_FINITE: Final = 5
END_REASONS: Final = (
    "time reached",
    "equilibrium",
    "step limit",
    "section reached",
    "event store full",
    "not finite",
)

WORK_ROWS: Final = 48  # of memory for a method, and for the series of a system
STALLED_EVENTS: Final = 200  # events at one instant, after which the step limit is declared reached
HELD_EVENTS: Final = (
    50  # events at one instant, after which a slide is held on for a little: rounding drives them
)
SHORTEST_CRAWL: Final = 1e-9  # [s] of that holding, doubled each time
LONGEST_CRAWL: Final = 1e-2  # [s]
VANISHED: Final = 1e-290  # numbers that a motion can decay to: little more than the smallest there are
BALANCE: Final = 1e-9  # of the rate on the other side: so slow a departure may be rounding


class Settings(NamedTuple):
    """How to integrate and when to stop early."""

    tolerance: float  # of one step, relative to the largest component of the state
    end: float  # time at which to stop
    step_limit: int
    section: int  # surface whose crossings are counted, -1 for none
    section_side: int  # from which side it must be reached: +1, -1, or 0 for both
    returns: int  # number of crossings after which to stop


class Record(NamedTuple):
    """Memory for what is to be kept; all arrays may have no rows."""

    times: FloatArray  # (k,) ascending, at which the state is wanted
    states: FloatArray  # (k, n)
    event_times: FloatArray  # (e,)
    event_surfaces: Signs  # (e,)
    event_signs: Signs  # (e, m) the mode after the event
    event_states: FloatArray  # (e, n)


class Progress(NamedTuple):
    """Where an integration stands."""

    time: float  # of the equilibrium: when the last slide began, or the motion was over
    reason: int  # index into END_REASONS
    outputs: int  # how many of the wanted times are done
    events: int  # how many events are stored
    steps: int


@specialised
def integrate(
    method: OneStepMethod,
    system: FilippovSystem,
    surfaces: Surfaces,
    parameters: FloatArray,
    settings: Settings,
    time: float,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    record: Record,
    memory: FloatArray,
) -> Progress:
    """Advance `state` (n,), `signs` (m,) and `contact` (m,) in place from `time` to the end of the settings.

    `memory` is of the shape that `memory_shape` tells.

    Output times before `time` are left alone. A state that slides for ever is reported as an equilibrium at
    once, with its later outputs filled in; `state` is then where it tends to. So is a motion that decays
    below all numbers, to where the field is zero.
    """
    n, m = state.size, signs.size
    polynomials, work = memory[: n + m], memory[n + m : n + m + WORK_ROWS]
    after, rate, spread = memory[-3, :n], memory[-2], memory[-1, :n]
    wanted = record.times.size
    output = 0
    while output < wanted and record.times[output] < time:
        output += 1
    events = 0
    found = 0
    stalled = 0
    touched = -1  # a surface that was met but not crossed, and has not been left since
    suggested = 1e-2
    crawl = SHORTEST_CRAWL
    for step in range(settings.step_limit):
        if time >= settings.end:
            return Progress(time, TIME_REACHED, output, events, step)
        if stalled > STALLED_EVENTS:
            return Progress(time, STEP_LIMIT, output, events, step)
        left = settings.end - time
        surface = -1
        arrived_from = 0
        if _slides(signs):
            duration, surface, side, touching = system.slide(signs, state, parameters)
            if stalled > HELD_EVENTS:
                duration = max(duration, crawl)
                crawl = min(2.0 * crawl, LONGEST_CRAWL)
            span = min(duration, left)
            until = settings.end if span == left else time + span  # their sum may round below the end
            while output < wanted and record.times[output] <= until:
                system.slide_at(signs, state, parameters, record.times[output] - time, record.states[output])
                output += 1
            if duration == np.inf:
                system.slide_at(signs, state, parameters, np.inf, after)
                assign(state, after)
                return Progress(time, EQUILIBRIUM, output, events, step)
            system.slide_at(signs, state, parameters, span, after)
            assign(state, after)
            stalled = stalled + 1 if time + span == time else 0
            if duration > left:
                time = settings.end
                continue
            time += span
            _release(system, surfaces, parameters, surface, side, touching, state, signs, contact, rate)
        else:
            length, degree, suggested = method.step(
                system, signs, state, parameters, settings.tolerance, left, suggested, polynomials, work
            )
            sum_up(polynomials, n, degree, after, spread)
            if not _finite(spread):
                return Progress(time, NOT_FINITE, output, events, step)
            part = 1.0
            near = 0 if _is_clear(surfaces, signs, contact, state, spread) else m
            for i in range(near):
                _switching_polynomial(surfaces, i, n, degree, polynomials)
                at = first_crossing(polynomials[n + i], degree, signs[i], contact[i], work[0])
                if at <= part and (surface < 0 or at < part):
                    part = at
                    surface = i
            if surface >= 0 and part < 1.0:
                length, part = method.end_at(
                    system, surfaces, surface, signs, state, parameters, length, part, polynomials, work
                )
                if length < 0.0:
                    suggested = -length
                    continue
            span = part * length
            now = settings.end if span == left else time + span
            while output < wanted and record.times[output] <= now:
                inside = min((record.times[output] - time) / length, part)
                evaluate(polynomials, n, degree, inside, record.states[output])
                output += 1
            if surface >= 0:
                evaluate(polynomials, n, degree, part, after)
            stalled = stalled + 1 if now == time else 0
            time = now
            if _dies_out(system, signs, parameters, state, after, rate):
                assign(state, rate[:n])
                while output < wanted and record.times[output] <= settings.end:
                    assign(record.states[output], state)
                    output += 1
                return Progress(time, EQUILIBRIUM, output, events, step + 1)
            assign(state, after)
            for i in range(m):
                contact[i] = 0
            if surface < 0:
                if touched >= 0 and has_left(surfaces, touched, settings.tolerance, state):
                    touched = -1
                continue
            arrived_from = signs[surface]
            reached = _meet(system, surfaces, parameters, surface, state, signs, contact, rate)
            if signs[surface] == arrived_from:
                _hold(system, surfaces, parameters, surface, state, signs, contact, rate)
                if reached == 1 and signs[surface] == arrived_from:
                    if surface == touched:
                        drive_across(surface, signs, contact)
                    touched = surface
            elif reached == 1 and signs[surface] == -arrived_from and surface != touched:
                time += turn_back(
                    system, surfaces, parameters, surface, arrived_from, settings.tolerance,
                    settings.end - time, state, signs, contact, rate,
                )  # fmt: skip
                while output < wanted and record.times[output] <= time:
                    back_along(state, rate, time - record.times[output], record.states[output])
                    output += 1
                touched = surface if signs[surface] == arrived_from else -1
        if events < record.event_times.size:
            record.event_times[events] = time
            record.event_surfaces[events] = surface
            assign(record.event_signs[events], signs)
            assign(record.event_states[events], state)
            events += 1
            if events == record.event_times.size:
                return Progress(time, EVENTS_FULL, output, events, step + 1)
        if surface == settings.section and arrived_from != 0:
            if settings.section_side * arrived_from >= 0:
                found += 1
            if found == settings.returns:
                return Progress(time, SECTION, output, events, step + 1)
    return Progress(time, STEP_LIMIT, output, events, settings.step_limit)


@compiled
def memory_shape(n: int, m: int) -> tuple[int, int]:
    """Shape of the memory that an integration of n states with m surfaces needs."""
    return n + m + WORK_ROWS + 3, max(2 * n, ORDER + 1)


@compiled
def _slides(signs: Signs) -> bool:
    sliding = 0
    for i in range(signs.size):
        if signs[i] == 0:
            sliding += 1
    return sliding > 0


@compiled
def _finite(spread: FloatArray) -> bool:
    total = 0.0
    for i in range(spread.size):
        total += spread[i]
    return bool(np.isfinite(total))


@specialised
def _dies_out(
    system: FilippovSystem,
    signs: Signs,
    parameters: FloatArray,
    state: FloatArray,
    after: FloatArray,
    rate: FloatArray,
) -> bool:
    """Whether a step has led below all numbers, to zero and a field that is zero there, as `rate` then is."""
    n = state.size
    if not largest(after) < VANISHED <= largest(state):
        return False
    for j in range(n):
        rate[n + j] = 0.0
    system.field(signs, rate[n : 2 * n], parameters, rate)
    return largest(rate[:n]) == 0.0


@specialised
def _is_clear(
    surfaces: Surfaces, signs: Signs, contact: Signs, state: FloatArray, spread: FloatArray
) -> bool:
    """Whether a step can meet no surface: the one test that most steps need."""
    n = state.size
    near = 0
    for i in range(signs.size):
        value, reach = surfaces.rows[i, n], 0.0
        for j in range(n):
            factor = surfaces.rows[i, j]
            value += factor * state[j]
            reach += abs(factor) * spread[j]
        if contact[i] != 0 or not signs[i] * value > reach:
            near += 1
    return near == 0


@specialised
def _hold(
    system: FilippovSystem,
    surfaces: Surfaces,
    parameters: FloatArray,
    surface: int,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    rate: FloatArray,
) -> None:
    """Let a state that only touched its surface slide, where it is driven off by next to nothing.

    The slide knows exactly whether it lasts; after a true graze it ends at once.
    """
    here = leaving_rate(system, surfaces, surface, signs[surface], signs, state, parameters, rate)
    there = leaving_rate(system, surfaces, surface, -signs[surface], signs, state, parameters, rate)
    if abs(here) < BALANCE * abs(there):
        signs[surface] = 0
        contact[surface] = 0


@specialised
def _switching_polynomial(
    surfaces: Surfaces, index: int, n: int, degree: int, polynomials: FloatArray
) -> None:
    """A switching function along a step, into its row after the states."""
    row = polynomials[n + index]
    for k in range(1, degree + 1):
        row[k] = 0.0
    row[0] = surfaces.rows[index, n]
    for j in range(n):
        factor = surfaces.rows[index, j]
        if factor != 0.0:
            for k in range(degree + 1):
                row[k] += factor * polynomials[j, k]


@specialised
def _meet(
    system: FilippovSystem,
    surfaces: Surfaces,
    parameters: FloatArray,
    surface: int,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    rate: FloatArray,
) -> int:
    """A surface was reached: put the state onto it, and onto all others reached with it, and resolve them.

    Returns how many were reached.
    """
    project(surfaces, surface, state)
    reached = 0
    for i in range(signs.size):
        if i == surface or signs[i] * switching_value(surfaces, i, state) <= 0.0:
            contact[i] = 1
            reached += 1
    if reached > 1:
        for i in range(signs.size):
            if contact[i] == 1:
                project(surfaces, i, state)
    for i in range(signs.size):
        if contact[i] == 1:
            signs[i] = resolve(system, surfaces, i, signs, state, parameters, rate)
    return reached


@specialised
def _release(
    system: FilippovSystem,
    surfaces: Surfaces,
    parameters: FloatArray,
    surface: int,
    side: int,
    touching: int,
    state: FloatArray,
    signs: Signs,
    contact: Signs,
    rate: FloatArray,
) -> None:
    """A slide has ended at `surface`, towards `side`: resolve what else the state lies on."""
    for i in range(signs.size):
        contact[i] = 1 if signs[i] == 0 else 0
    signs[surface] = side
    contact[surface] = touching
    for i in range(signs.size):
        if contact[i] > 0:
            project(surfaces, i, state)
    for i in range(signs.size):
        if i != surface and switching_value(surfaces, i, state) == 0.0:
            contact[i] = 1
            signs[i] = resolve(system, surfaces, i, signs, state, parameters, rate)

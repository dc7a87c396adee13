r"""Levenberg-Marquardt within bounds, compiled: an active set on the normal equations.

The cost is chi^2(x) = sum r_i(x)^2, r in standard errors, with low <= x <= high. At x the normal equations
are H = J^T J and g = -J^T r (J the derivatives of r), so that H s = g is the Gauss-Newton step. Each step

- holds the parameters that lie at a bound with the descent pointing outwards;
- solves (H + lambda diag H) s = g for the rest, within the box (a bounded quadratic problem, by active sets:
  Nocedal and Wright 2006, algorithm 16.3);
- is taken if chi^2 falls; lambda falls with success and grows without (Marquardt 1963).

Where no step is left to make, x is a Karush-Kuhn-Tucker point. That is judged by the fall of chi^2 that the
next step promises, which is the square of its length in standard errors. Columns are scaled to unit length
before the equations are factored, and a parameter that the data do not feel is left where it is.

`normal(problem, x, h, g, slot)` returns chi^2 and fills g[slot] (p,) and the lower half of h[slot] (p, p).
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.simulation.compiled import specialised

MOST_STEPS: Final = 200
CLOSE: Final = 1e-14  # fall of chi^2 that is none: 1e-7 standard errors
ROUNDING: Final = 1e-11  # of chi^2: a fall by less may not show
SURE: Final = 1e-7  # damping under which a step counts as undamped
FIRST: Final = 1e-4  # damping
LARGEST: Final = 1e12
UNFELT: Final = 1e-13  # pivot of a unit column below which the data say nothing of it


class Box(NamedTuple):
    """The parameters that may move, and how far. (p,) each."""

    low: FloatArray
    high: FloatArray
    reach: FloatArray  # largest change in one step
    free: NDArray[np.bool_]


class Workspace(NamedTuple):
    """Memory of one minimisation with p parameters."""

    h: FloatArray  # (2, p, p) at the point and at the trial
    g: FloatArray  # (2, p)
    best: FloatArray  # (p,) for callers that keep their points in rows
    trial: FloatArray  # (p,)
    step: FloatArray  # (p,)
    aim: FloatArray  # (p,) where the step would go without bounds
    scale: FloatArray  # (p,)
    factor: FloatArray  # (p, p)
    solved: FloatArray  # (p,)
    held: NDArray[np.bool_]  # (p,)
    order: NDArray[np.int64]  # (p,)


def workspace(size: int) -> Workspace:
    """Memory for `size` parameters."""
    return Workspace(
        np.zeros((2, size, size)),
        np.zeros((2, size)),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros((size, size)),
        np.zeros(size),
        np.zeros(size, dtype=np.bool_),
        np.zeros(size, dtype=np.int64),
    )


@specialised
def minimise(normal: Any, problem: Any, x: FloatArray, box: Box, work: Workspace) -> float:
    """Move x (p,) to where chi^2 is least nearby, and return it. H is then `work.h[0]`, g `work.g[0]`."""
    size = x.size
    for i in range(size):
        x[i] = min(max(x[i], box.low[i]), box.high[i])
    now = 0
    cost = normal(problem, x, work.h, work.g, now)
    damping = FIRST
    for _ in range(MOST_STEPS):
        promised = _step(x, box, work, now, damping)
        if promised <= CLOSE:
            if damping <= SURE:
                break
            damping *= 1e-3
            continue
        for i in range(size):
            work.trial[i] = x[i] + work.step[i]
        reached = normal(problem, work.trial, work.h, work.g, 1 - now)
        if not reached < cost and promised <= ROUNDING * cost:
            # Too small a fall to be seen in chi^2, but the step is as good as the equations: the last one.
            for i in range(size):
                x[i] = work.trial[i]
            return _last(work, reached, 1 - now)
        if not reached < cost:
            damping = max(10.0 * damping, 1e-6)
            if damping > LARGEST:
                break
            continue
        gain = (cost - reached) / promised
        if gain > 0.75:
            damping *= 0.02
        elif gain < 0.25:
            damping = max(5.0 * damping, 1e-6)
        for i in range(size):
            x[i] = work.trial[i]
        cost = reached
        now = 1 - now
    return _last(work, cost, now)


@specialised
def _last(work: Workspace, cost: float, now: int) -> float:
    """The cost, with its equations in the first place."""
    if now == 1:
        for i in range(work.trial.size):
            work.g[0, i] = work.g[1, i]
            for j in range(work.trial.size):
                work.h[0, i, j] = work.h[1, i, j]
    return cost


@specialised
def _step(x: FloatArray, box: Box, work: Workspace, now: int, damping: float) -> float:
    """Fill `work.step` and return the fall of chi^2 that the equations promise for it.

    The step is the least of the damped quadratic in the box: from one set of held parameters to the next it
    goes as far as the first bound, and where it meets none it lets go of what pulls inwards most.
    """
    size, h, g, step, held = x.size, work.h, work.g, work.step, work.held
    for i in range(size):
        step[i] = 0.0
        pull = g[now, i]
        outwards = (x[i] <= box.low[i] and pull <= 0) or (x[i] >= box.high[i] and pull >= 0)
        held[i] = not box.free[i] or outwards or not h[now, i, i] > 0
        work.scale[i] = np.sqrt(h[now, i, i]) if h[now, i, i] > 0 else 1.0
    for _ in range(4 * size):
        _solve(work, now, damping, size)
        if _up_to_a_bound(x, box, work, size):
            continue
        if not _let_go(x, box, work, now, damping, size):
            break
    promised = 0.0
    for i in range(size):
        curved = 0.5 * h[now, i, i] * step[i]
        for j in range(i):
            curved += h[now, i, j] * step[j]
        promised += 2.0 * step[i] * (g[now, i] - curved)
    return promised


@specialised
def _up_to_a_bound(x: FloatArray, box: Box, work: Workspace, size: int) -> bool:
    """Go from the step to the aim, or as far as the first bound, which is then held; whether one was met."""
    step, aim = work.step, work.aim
    share, met = 1.0, -1
    for i in range(size):
        if work.held[i]:
            continue
        bound = _least(x, box, i) if aim[i] < step[i] else _most(x, box, i)
        beyond = aim[i] < bound if aim[i] < step[i] else aim[i] > bound
        if beyond and (bound - step[i]) / (aim[i] - step[i]) < share:
            share, met = (bound - step[i]) / (aim[i] - step[i]), i
    for i in range(size):
        if not work.held[i]:
            step[i] += share * (aim[i] - step[i])
    if met >= 0:
        step[met] = _least(x, box, met) if aim[met] < step[met] else _most(x, box, met)  # to the last bit
        work.held[met] = True
    return met >= 0


@specialised
def _let_go(x: FloatArray, box: Box, work: Workspace, now: int, damping: float, size: int) -> bool:
    """Let go of the held parameter that pulls inwards most; whether there is one."""
    most, best = 0.0, -1
    for i in range(size):
        if not (work.held[i] and box.free[i] and work.h[now, i, i] > 0):
            continue
        pull = work.g[now, i] - damping * work.h[now, i, i] * work.step[i]
        for j in range(size):
            pull -= work.h[now, max(i, j), min(i, j)] * work.step[j]
        pull /= work.scale[i]
        at_least = work.step[i] <= _least(x, box, i)
        at_most = work.step[i] >= _most(x, box, i)
        inwards = pull if at_least and not at_most else -pull if at_most and not at_least else 0.0
        if inwards > most:
            most, best = inwards, i
    if best < 0 or most**2 <= CLOSE:
        return False
    work.held[best] = False
    return True


@specialised
def _least(x: FloatArray, box: Box, i: int) -> float:
    """The step of parameter i down to its bound, or as far as it may go in one step."""
    return float(max(box.low[i] - x[i], -box.reach[i]))


@specialised
def _most(x: FloatArray, box: Box, i: int) -> float:
    return float(min(box.high[i] - x[i], box.reach[i]))


@specialised
def _solve(work: Workspace, now: int, damping: float, size: int) -> None:
    """The damped equations for the parameters that are not held, by Cholesky, given the steps of the held."""
    h, g, step, scale, factor, y = work.h, work.g, work.step, work.scale, work.factor, work.solved
    count = 0
    for i in range(size):
        if not work.held[i]:
            work.order[count] = i
            count += 1
    for a in range(count):
        i = work.order[a]
        right = g[now, i]
        for j in range(size):
            if work.held[j] and step[j] != 0.0:
                right -= h[now, max(i, j), min(i, j)] * step[j]
        right /= scale[i]
        for b in range(a):
            j = work.order[b]
            entry = h[now, max(i, j), min(i, j)] / (scale[i] * scale[j])
            for c in range(b):
                entry -= factor[a, c] * factor[b, c]
            factor[a, b] = entry * factor[b, b]
            right -= factor[a, b] * y[b]
        pivot = 1.0 + damping
        for c in range(a):
            pivot -= factor[a, c] ** 2
        # The diagonal holds the inverse of the factor's, 0 where the rest leaves nothing to say.
        factor[a, a] = 1.0 / np.sqrt(pivot) if pivot > UNFELT else 0.0
        y[a] = right * factor[a, a]
    for a in range(count - 1, -1, -1):
        value = y[a]
        for c in range(a + 1, count):
            value -= factor[c, a] * y[c]
        y[a] = value * factor[a, a]
    for a in range(count):
        work.aim[work.order[a]] = y[a] / scale[work.order[a]]

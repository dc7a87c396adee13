"""The compiled fits that are repeated: from many starts, along profiles, over resampled runs."""

from __future__ import annotations

from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.fit.bounded_least_squares import Box, Workspace, minimise
from ident.fit.normal_equations import Problem, chi_square, combined
from ident.simulation.compiled import compiled, passed, specialised

REACHED, BOUND, OPEN, BETTER = range(4)  # how a walk along a profile ended
REACH: Final = 12  # steps outwards before an end is called open
MOST_POINTS: Final = 40  # on one side of a profile
LOOSE: Final = 0.02  # of the target, or of its distance from the best: the standard error of the tie
SMALL: Final = 1e-3  # of the best value: a target nearer to 0 counts as so large
NEAR: Final = 0.1  # of the same: a tie that lets go further is tightened,
TIGHTENED: Final = 6  # so often
NARROW: Final = 1e-3  # of the height at which an end is taken as found
DEEPER: Final = 1e-6  # of chi^2 by which another minimum counts as better

_NORMAL: Final = passed(chi_square)


@compiled
def refit_each(problem: Problem, x: FloatArray, box: Box, work: Workspace, cost: FloatArray) -> None:
    """Move each row of x (s, p) to its minimum; cost (s,) is chi^2 there. H of the last is `work.h[0]`."""
    for s in range(cost.size):
        for i in range(work.best.size):
            work.best[i] = x[s, i]
        cost[s] = minimise(_NORMAL, problem, work.best, box, work)
        for i in range(work.best.size):
            x[s, i] = work.best[i]


@compiled
def refit_resampled(
    problem: Problem,
    start: FloatArray,
    box: Box,
    work: Workspace,
    steady_weight: FloatArray,
    steady_share: FloatArray,
    motion_share: FloatArray,
    found: FloatArray,
) -> None:
    """Refit to resampled data: found (d, p), one row a draw, each from `start`.

    A datum that was drawn k times weighs sqrt(k) times as much: steady_share (d, n) and motion_share (d, m)
    hold those roots, steady_weight (n,) the weights of the data as they are.
    """
    for d in range(found.shape[0]):
        for n in range(steady_weight.size):
            problem.steady.weight[n] = steady_weight[n] * steady_share[d, n]
        for m in range(problem.motions.weight.size):
            problem.motions.weight[m] = motion_share[d, m]
        for i in range(start.size):
            work.best[i] = start[i]
        minimise(_NORMAL, problem, work.best, box, work)
        for i in range(start.size):
            found[d, i] = work.best[i]


@compiled
def profile_end(
    problem: Problem,
    best: FloatArray,
    base: float,
    step: float,
    limit: float,
    height: float,
    box: Box,
    work: Workspace,
    x: FloatArray,
    points: FloatArray,
) -> tuple[int, int]:
    """Walk along a profile from the best fit until it has risen by `height`; how many points, and the end.

    Parameters
    ----------
    problem : with the combination that is profiled; its tie is overwritten
    best, base : (p,) the best fit and its chi^2
    step : first step of the combination, with the sign of the side
    limit : value beyond which the combination cannot go
    x : (p,) memory; holds the last fit afterwards
    points : (MOST_POINTS, 2) value and rise of chi^2 of each point, the last the end
    """
    for i in range(best.size):
        x[i] = best[i]
    centre = combined(problem.combination, best)
    inside, inside_rise = centre, 0.0
    outside, outside_rise = centre, 0.0
    count, away, ended = 0, step, OPEN
    if (centre <= limit) if step < 0 else (centre >= limit):
        points[0, 0], points[0, 1] = centre, 0.0
        return 1, BOUND
    for _ in range(REACH):
        outside = centre + away
        at_limit = outside <= limit if step < 0 else outside >= limit
        if at_limit:
            outside = limit
        outside_rise = _tied(problem, x, outside, centre, base, box, work, points, count)
        count += 1
        if outside_rise < -DEEPER * (1.0 + base):
            ended = BETTER
            break
        if outside_rise >= height:
            ended = REACHED
            break
        if at_limit:
            ended = BOUND
            break
        inside, inside_rise = outside, outside_rise
        away *= min(max(1.05 * np.sqrt(height / max(outside_rise, 1e-300)), 1.1), 3.0)
    if ended == REACHED:
        # Between two targets, on the square root of the rise, which is nearly straight; halved where not.
        side = 0
        while abs(points[count - 1, 1] - height) > NARROW * height and count < MOST_POINTS:
            low, high = np.sqrt(max(inside_rise, 0.0)), np.sqrt(outside_rise)
            share = min(max((np.sqrt(height) - low) / (high - low), 0.02), 0.98)
            if abs(side) >= 2:
                share = 0.5
            target = inside + share * (outside - inside)
            rise = _tied(problem, x, target, centre, base, box, work, points, count)
            count += 1
            if rise < height:
                inside, inside_rise = target, rise
                side = max(side, 0) + 1
            else:
                outside, outside_rise = target, rise
                side = min(side, 0) - 1
    problem.tie[1] = 0.0
    return count, ended


@specialised
def _tied(
    problem: Problem,
    x: FloatArray,
    target: float,
    centre: float,
    base: float,
    box: Box,
    work: Workspace,
    points: FloatArray,
    count: int,
) -> float:
    """A point of the profile near the target: the rise of chi^2, which is entered with its value."""
    distance = min(abs(target - centre), max(abs(target), SMALL * abs(centre)))
    error, value, cost = LOOSE * distance, centre, base
    for _ in range(TIGHTENED):
        problem.tie[0], problem.tie[1] = target, 1.0 / error
        cost = minimise(_NORMAL, problem, x, box, work)
        value = combined(problem.combination, x)
        if abs(value - target) <= NEAR * distance:
            break
        error *= 0.1
    rise = cost - (problem.tie[1] * (target - value)) ** 2 - base
    points[count, 0], points[count, 1] = value, rise
    return float(rise)

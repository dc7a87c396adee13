r"""chi^2 of the joint fit with its derivatives, compiled: the data as flat arrays, one row after the other.

The parameters x (p,) are those of `law_model`, block after block, but for ln v_s in the place of v_s: a
Stribeck velocity is positive, and what is felt of it is its ratio to the speeds. With E = exp(-(v/v_s)^beta),
the magnitude of the friction torque in a direction is F_c + dF E + b v + s * offset, linear in all but v_s
and beta, where

    dE / d ln v_s = beta (v/v_s)^beta E,      dE / d beta = -(v/v_s)^beta ln(v/v_s) E.

A tie is one datum more: that a combination c . parameters (with v_s itself) is a given value. The minimum
under a tie, however loose it is, is a point of the profile of that combination, at the value that it reaches.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.evidence.momentum import NODES
from ident.fit.law_model import BLOCK, COMMON
from ident.simulation.compiled import compiled, specialised

INERTIA: Final = COMMON.index("inertia")
OFFSET: Final = COMMON.index("torque_offset")
FIRST_BLOCK: Final = len(COMMON)
SIZE: Final = len(BLOCK)
COULOMB, STRIBECK, VELOCITY, DAMPING, SHAPE = range(SIZE)
ROW: Final = FIRST_BLOCK + SIZE  # derivatives that one datum has


class Steady(NamedTuple):
    """Steady runs, and breakaways at speed 0 (n,)."""

    sign: FloatArray  # +1 or -1
    block: NDArray[np.int64]  # where the parameters of its law begin
    speed: FloatArray  # [rad/s]
    log_speed: FloatArray
    torque: FloatArray  # [N m]
    acceleration: FloatArray  # [rad/s^2]
    weight: FloatArray  # inverse standard error [1/(N m)]


class Motions(NamedTuple):
    """Momentum balances of m motions with k windows in all; whitened but for the nodes."""

    sign: FloatArray  # (m,)
    block: NDArray[np.int64]  # (m,)
    weight: FloatArray  # (m,) [-]
    first: NDArray[np.int64]  # (m + 1,) window at which each begins
    impulse: FloatArray  # (k,)
    duration: FloatArray  # (k,)
    travel: FloatArray  # (k,)
    gain: FloatArray  # (k,)
    whitening: FloatArray  # (k, widest) times the duration of the window, by which its fading is multiplied
    speed: FloatArray  # (k, NODES)
    log_speed: FloatArray  # (k, NODES)
    fading: FloatArray  # (3, widest) memory: of E, dE / d ln v_s, dE / d beta in the windows of one motion


class Problem(NamedTuple):
    """All that chi^2 is a sum of."""

    steady: Steady
    motions: Motions
    inertia: FloatArray  # (2,) the datum and its weight, 0 where there is none
    combination: FloatArray  # (p,) the tie
    tie: FloatArray  # (2,) its value and weight, 0 where there is none
    row: FloatArray  # (ROW,) memory


@compiled
def chi_square(problem: Problem, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    """chi^2 [-]; fills g[slot] = -J^T r and the lower half of h[slot] = J^T J."""
    for i in range(x.size):
        g[slot, i] = 0.0
        for j in range(i + 1):
            h[slot, i, j] = 0.0
    cost = _steady(problem.steady, problem.row, x, h, g, slot)
    cost += _moving(problem.motions, problem.row, x, h, g, slot)
    residual = (problem.inertia[0] - x[INERTIA]) * problem.inertia[1]
    g[slot, INERTIA] += residual * problem.inertia[1]
    h[slot, INERTIA, INERTIA] += problem.inertia[1] ** 2
    cost += residual**2
    if problem.tie[1] > 0:
        cost += _tied(problem, x, h, g, slot)
    return float(cost)


@specialised
def is_velocity(i: int) -> bool:
    """Whether parameter i is a ln v_s."""
    return i >= FIRST_BLOCK and (i - FIRST_BLOCK) % SIZE == VELOCITY


@specialised
def combined(combination: FloatArray, x: FloatArray) -> float:
    """c . parameters, with v_s itself."""
    total = 0.0
    for i in range(x.size):
        if combination[i] != 0.0:
            total += combination[i] * (np.exp(x[i]) if is_velocity(i) else x[i])
    return total


@specialised
def _fading(
    speed: float, log_speed: float, velocity: float, log_velocity: float, shape: float
) -> tuple[float, float, float]:
    """E and its derivatives by ln v_s and beta."""
    if speed <= 0.0:
        return 1.0, 0.0, 0.0
    from_velocity = log_speed - log_velocity
    power = speed / velocity if shape == 1.0 else np.exp(shape * from_velocity)
    fading = np.exp(-power)
    fall = power * fading
    return fading, shape * fall, -from_velocity * fall


@specialised
def _steady(data: Steady, row: FloatArray, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    cost = 0.0
    for n in range(data.speed.size):
        weight = data.weight[n]
        if weight == 0.0:
            continue
        block = data.block[n]
        stribeck, log_velocity = x[block + STRIBECK], x[block + VELOCITY]
        fading, by_velocity, by_shape = _fading(
            data.speed[n], data.log_speed[n], np.exp(log_velocity), log_velocity, x[block + SHAPE]
        )
        predicted = x[block + COULOMB] + stribeck * fading + x[block + DAMPING] * data.speed[n]
        predicted += data.sign[n] * x[OFFSET] + data.acceleration[n] * x[INERTIA]
        row[INERTIA] = weight * data.acceleration[n]
        row[OFFSET] = weight * data.sign[n]
        row[FIRST_BLOCK + COULOMB] = weight
        row[FIRST_BLOCK + STRIBECK] = weight * fading
        row[FIRST_BLOCK + VELOCITY] = weight * stribeck * by_velocity
        row[FIRST_BLOCK + DAMPING] = weight * data.speed[n]
        row[FIRST_BLOCK + SHAPE] = weight * stribeck * by_shape
        cost += _add(row, weight * (data.torque[n] - predicted), block, h, g, slot)
    return cost


@specialised
def _moving(data: Motions, row: FloatArray, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    cost = 0.0
    for m in range(data.sign.size):
        if data.weight[m] == 0.0:
            continue
        block, weight, first, past = data.block[m], data.weight[m], data.first[m], data.first[m + 1]
        log_velocity, shape = x[block + VELOCITY], x[block + SHAPE]
        velocity = np.exp(log_velocity)
        for k in range(first, past):
            total = by_velocity = by_shape = 0.0
            for node in range(NODES):
                share = 0.5 if node in (0, NODES - 1) else 1.0
                at = _fading(data.speed[k, node], data.log_speed[k, node], velocity, log_velocity, shape)
                total += share * at[0]
                by_velocity += share * at[1]
                by_shape += share * at[2]
            data.fading[0, k - first] = total / (NODES - 1)
            data.fading[1, k - first] = by_velocity / (NODES - 1)
            data.fading[2, k - first] = by_shape / (NODES - 1)
        stribeck = x[block + STRIBECK]
        for k in range(first, past):
            total = by_velocity = by_shape = 0.0
            for j in range(past - first):
                total += data.whitening[k, j] * data.fading[0, j]
                by_velocity += data.whitening[k, j] * data.fading[1, j]
                by_shape += data.whitening[k, j] * data.fading[2, j]
            constant = x[block + COULOMB] + data.sign[m] * x[OFFSET]
            predicted = constant * data.duration[k] + stribeck * total + x[block + DAMPING] * data.travel[k]
            predicted += x[INERTIA] * data.gain[k]
            row[INERTIA] = weight * data.gain[k]
            row[OFFSET] = weight * data.sign[m] * data.duration[k]
            row[FIRST_BLOCK + COULOMB] = weight * data.duration[k]
            row[FIRST_BLOCK + STRIBECK] = weight * total
            row[FIRST_BLOCK + VELOCITY] = weight * stribeck * by_velocity
            row[FIRST_BLOCK + DAMPING] = weight * data.travel[k]
            row[FIRST_BLOCK + SHAPE] = weight * stribeck * by_shape
            cost += _add(row, weight * (data.impulse[k] - predicted), block, h, g, slot)
    return cost


@specialised
def _tied(problem: Problem, x: FloatArray, h: FloatArray, g: FloatArray, slot: int) -> float:
    c, weight = problem.combination, problem.tie[1]
    residual = weight * (problem.tie[0] - combined(c, x))
    for i in range(x.size):
        if c[i] == 0.0:
            continue
        slope = weight * c[i] * (np.exp(x[i]) if is_velocity(i) else 1.0)
        g[slot, i] += slope * residual
        for j in range(i + 1):
            h[slot, i, j] += slope * weight * c[j] * (np.exp(x[j]) if is_velocity(j) else 1.0)
    return float(residual**2)


@specialised
def _add(row: FloatArray, residual: float, block: int, h: FloatArray, g: FloatArray, slot: int) -> float:
    """Add one datum to the normal equations, and return its square."""
    shift = block - FIRST_BLOCK
    for a in range(FIRST_BLOCK):
        if row[a] != 0.0:
            g[slot, a] += row[a] * residual
            for b in range(a + 1):
                h[slot, a, b] += row[a] * row[b]
            for b in range(FIRST_BLOCK, ROW):
                h[slot, b + shift, a] += row[a] * row[b]
    for a in range(FIRST_BLOCK, ROW):
        g[slot, a + shift] += row[a] * residual
        for b in range(FIRST_BLOCK, a + 1):
            h[slot, a + shift, b + shift] += row[a] * row[b]
    return residual**2

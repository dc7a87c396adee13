"""One step by Dormand and Prince's pair of order 8(5,3), for every smooth mode.

The tableau is Hairer, Norsett and Wanner's (Solving Ordinary Differential Equations I, II.10), as scipy
carries it. The dense output of order 7 is handed on as polynomials, so that events are found in the same
way as on a Taylor step; the event loop then repeats the step with the length that ends at the event, which
gives the state there at the order of the method itself.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.crossing import evaluate
from ident.simulation.filippov_system import (
    FilippovSystem,
    FloatArray,
    OneStepMethod,
    Signs,
    Surfaces,
    switching_value,
)

DEGREE = 7
STAGES = 16  # 12 of the step, the derivative at its end, 3 of the dense output
_A = np.zeros((STAGES, STAGES))
_A[:12, :12] = DOP853.A
_A[12, :12] = DOP853.B
_A[13:, :] = DOP853.A_EXTRA
_E3, _E5, _D = np.array(DOP853.E3), np.array(DOP853.E5), np.array(DOP853.D)
SAFETY, SHRINK, GROW = 0.9, 0.2, 8.0
DEFECT_AT = 0.73  # of the step
DEFECT_OVER_ERROR = 8.0
SHORTEST = 1e-13  # of the time asked for: a field that is not Lipschitz may refuse every error bound


@specialised
def dormand_prince_step(
    system: FilippovSystem,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    tolerance: float,
    longest: float,
    suggested: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> tuple[float, int, float]:
    """Length of the step, degree of its polynomials in theta = t / length (rows 0..n-1), next length.

    `tolerance` is relative to the largest component of the state. Where `longest` is negative, a step of
    exactly that length is taken.
    """
    n = state.size
    stage = work[STAGES]
    size = 0.0
    for i in range(n):
        size = max(size, abs(state[i]))
    scale = tolerance * size if size > 0.0 else tolerance
    system.field(signs, state, parameters, work[0])
    exact = longest < 0.0
    length = -longest if exact else min(longest, suggested)
    shortest = SHORTEST * abs(longest)
    rejected = False
    while True:
        for s in range(1, 13):
            _stage(state, work, s, length, stage)
            system.field(signs, stage[:n], parameters, work[s])
        error = length * _error(work, n) / scale
        if exact or error < 1.0 or length <= shortest:
            _complete(system, signs, state, parameters, length, polynomials, work)
            if not exact:
                defect = length * _defect(system, signs, n, parameters, length, polynomials, work)
                error = max(error, defect / (DEFECT_OVER_ERROR * scale))
        if exact:
            following = suggested
            break
        if error < 1.0 or length <= shortest:
            factor = GROW if error == 0.0 else min(GROW, SAFETY * error ** (-0.125))
            following = length * (min(1.0, factor) if rejected else factor)
            break
        factor = SAFETY * error ** (-0.125) if error < np.inf else SHRINK
        length = max(shortest, length * max(SHRINK, factor))
        rejected = True
    return length, DEGREE, following


@specialised
def _complete(
    system: FilippovSystem,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    length: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> None:
    """The three stages of the dense output, and its polynomials; the state at the end is kept in `work`."""
    n = state.size
    stage, end = work[STAGES], work[STAGES + 1]
    for i in range(n):
        end[i] = stage[i]
    for s in range(13, STAGES):
        _stage(state, work, s, length, stage)
        system.field(signs, stage[:n], parameters, work[s])
    _dense(state, work, length, polynomials)


@specialised
def _defect(
    system: FilippovSystem,
    signs: Signs,
    n: int,
    parameters: FloatArray,
    length: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> float:
    """By how much the dense output misses the differential equation at one place inside the step."""
    at, wanted = work[STAGES], work[STAGES + 2]
    evaluate(polynomials, n, DEGREE, DEFECT_AT, at)
    system.field(signs, at[:n], parameters, wanted)
    largest = 0.0
    for i in range(n):
        slope = 0.0
        for k in range(DEGREE, 0, -1):
            slope = slope * DEFECT_AT + k * polynomials[i, k]
        missed = abs(slope / length - wanted[i])
        if not missed <= largest:
            largest = missed
    return largest if np.isfinite(largest) else np.inf


@compiled
def _stage(state: FloatArray, work: FloatArray, s: int, length: float, out: FloatArray) -> None:
    n = state.size
    for i in range(n):
        out[i] = 0.0
    for j in range(s):
        if _A[s, j] != 0.0:
            for i in range(n):
                out[i] += _A[s, j] * work[j, i]
    for i in range(n):
        out[i] = state[i] + length * out[i]


@compiled
def _error(work: FloatArray, n: int) -> float:
    """Hairer's mixture of the errors of orders 5 and 3, per unit length and scale."""
    fifth, third = 0.0, 0.0
    for i in range(n):
        five, three = 0.0, 0.0
        for s in range(13):
            five += _E5[s] * work[s, i]
            three += _E3[s] * work[s, i]
        fifth += five * five
        third += three * three
    if fifth == 0.0 and third == 0.0:
        return 0.0
    error = fifth / np.sqrt((fifth + 0.01 * third) * n)
    return error if np.isfinite(error) else np.inf


@compiled
def _dense(state: FloatArray, work: FloatArray, length: float, polynomials: FloatArray) -> None:
    """Monomial coefficients of y0 + x(F0 + (1-x)(F1 + x(F2 + ... F6))), x = theta."""
    for i in range(state.size):
        end = work[STAGES + 1, i]
        p = polynomials[i]
        for k in range(DEGREE + 1):
            p[k] = 0.0
        for level in range(DEGREE):
            term = DEGREE - 1 - level
            if term == 0:
                add = end - state[i]
            elif term == 1:
                add = length * work[0, i] - (end - state[i])
            elif term == 2:
                add = 2.0 * (end - state[i]) - length * (work[12, i] + work[0, i])
            else:
                add = 0.0
                for s in range(STAGES):
                    add += _D[term - 3, s] * work[s, i]
                add *= length
            p[0] += add
            for k in range(DEGREE, 0, -1):
                p[k] = p[k - 1] if level % 2 == 0 else p[k] - p[k - 1]
            if level % 2 == 0:
                p[0] = 0.0
        p[0] = state[i]


@specialised
def repeat_to_event(
    system: FilippovSystem,
    surfaces: Surfaces,
    surface: int,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    length: float,
    part: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> tuple[float, float]:
    """Take the step again, of the length that ends on the surface: Newton's method on the step itself."""
    n = state.size
    at = part * length
    end = np.empty(n)
    for _ in range(EVENT_CORRECTIONS):
        dormand_prince_step(system, signs, state, parameters, 1.0, -at, 0.0, polynomials, work)
        for j in range(n):
            end[j] = work[STAGES + 1, j]
        value = switching_value(surfaces, surface, end)
        rate = 0.0
        for j in range(n):
            rate += surfaces.rows[surface, j] * work[12, j]
        change = -value / rate
        if value == 0.0 or not 0.0 < at + change < length or abs(change) <= 1e-16 * at:
            break
        at += change
    return at, 1.0


EVENT_CORRECTIONS = 3
DORMAND_PRINCE = OneStepMethod(step=passed(dormand_prince_step), end_at=passed(repeat_to_event))

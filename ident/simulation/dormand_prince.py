"""One step by Dormand and Prince's pair of order 8(5,3), for every smooth mode.

The tableau is Hairer, Norsett and Wanner's (Solving Ordinary Differential Equations I, II.10), as scipy
carries it. The dense output of order 7 is handed on as polynomials, so that events are found in the same
way as on a Taylor step; the event loop then repeats the step with the length that ends at the event, which
gives the state there at the order of the method itself.

A step answers for the whole of its dense output. Besides the error at its end, which the pair estimates, its
defect bounds it, what the dense output misses of the differential equation at a place inside (Enright, ACM
Trans. Math. Software 12, 1986; Higham, BIT 31, 1991). The repeated step is held to the same error.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from ident.simulation.compiled import compiled, passed, specialised
from ident.simulation.filippov_system import (
    FilippovSystem,
    FloatArray,
    OneStepMethod,
    Signs,
    Surfaces,
    largest,
    switching_value,
)
from ident.simulation.polynomials import evaluate

DEGREE = 7
STAGES = 16  # 12 of the step, the derivative at its end, 3 of the dense output
STAGE, END, SLOPE, LIMITS = range(STAGES, STAGES + 4)  # rows of `work` after those of the stages
SCALE, LEAST = range(2)  # of the limits that a step was held to: allowed error, shortest length
_A = np.zeros((STAGES, STAGES))
_A[:12, :12] = DOP853.A
_A[12, :12] = DOP853.B
_A[13:, :] = DOP853.A_EXTRA
_E3, _E5, _D = np.array(DOP853.E3), np.array(DOP853.E5), np.array(DOP853.D)
SAFETY, SHRINK, GROW = 0.9, 0.2, 8.0
SHORTEST = 1e-13  # of the time asked for: a field that is not Lipschitz may refuse every error bound
DEFECT_AT = 0.73  # of the step: far from the places where the dense output has the slope of the field
DEFECT_OVER_ERROR = 8.0  # length * defect there against the greatest error, 7.5 to 13 for y' = -z y, z < 10
TOWARDS_EVENT = 0.75  # of the way to a surface that cannot be reached in one step


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
    size = largest(state)
    work[LIMITS, SCALE] = tolerance * size if size > 0.0 else tolerance
    exact = longest < 0.0
    shortest = -longest if exact else SHORTEST * longest
    length = shortest if exact else min(longest, max(shortest, suggested))
    work[LIMITS, LEAST] = shortest
    system.field(signs, state, parameters, work[0])
    rejected = False
    while True:
        error = _attempt(system, signs, state, parameters, length, polynomials, work)
        if error < 1.0 or length <= shortest:
            break
        factor = SAFETY * error ** (-0.125) if error < np.inf else SHRINK
        length = max(shortest, length * max(SHRINK, factor))
        rejected = True
    if exact:
        return length, DEGREE, suggested
    factor = GROW if error == 0.0 else min(GROW, SAFETY * error ** (-0.125))
    return length, DEGREE, length * (min(1.0, factor) if rejected else factor)


@specialised
def _attempt(
    system: FilippovSystem,
    signs: Signs,
    state: FloatArray,
    parameters: FloatArray,
    length: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> float:
    """Error of a step of this length, of its end and of its dense output, against what is allowed.

    The dense output is left out where the end alone is beyond what is allowed. `work[0]` holds the derivative
    at the beginning.
    """
    n = state.size
    stage = work[STAGE]
    scale: float = work[LIMITS, SCALE]
    for s in range(1, 13):
        _stage(state, work, s, length, stage)
        system.field(signs, stage[:n], parameters, work[s])
    error: float = _error(work, n, length / scale)
    if error >= 1.0 and length > work[LIMITS, LEAST]:
        return error
    for i in range(n):
        work[END, i] = stage[i]
    for s in range(13, STAGES):
        _stage(state, work, s, length, stage)
        system.field(signs, stage[:n], parameters, work[s])
    _dense(state, work, length, polynomials)
    defect = _defect(system, signs, n, parameters, length, polynomials, work)
    return max(error, length * defect / (DEFECT_OVER_ERROR * scale))


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
    """By how much the dense output misses the differential equation at one place inside the step.

    Where stability bounds the step, the dense output magnifies what is left of the fast components: for y' =
    z y and z = -7 by 90, where the end of the step does by less than 3.
    """
    stage, slope = work[STAGE], work[SLOPE]
    evaluate(polynomials, n, DEGREE, DEFECT_AT, stage)
    system.field(signs, stage[:n], parameters, slope)
    defect = 0.0
    for i in range(n):
        along = 0.0
        for k in range(DEGREE, 0, -1):
            along = along * DEFECT_AT + k * polynomials[i, k]
        missed = abs(along / length - slope[i])
        defect = max(defect, missed if np.isfinite(missed) else np.inf)
    return defect


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
def _error(work: FloatArray, n: int, weight: float) -> float:
    """Hairer's mixture of the errors of orders 5 and 3, times `weight`.

    What is squared is weighted before: the squares of a state below 1e-154 vanish.
    """
    fifth, third = 0.0, 0.0
    for i in range(n):
        five, three = 0.0, 0.0
        for s in range(13):
            five += _E5[s] * work[s, i]
            three += _E3[s] * work[s, i]
        five *= weight
        three *= weight
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
        end = work[END, i]
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
    """Take the step again, of the length that ends on the surface: Newton's method on the step itself.

    The shorter step is held to the same error. Friction that rises within a narrow band about its surface, as
    exp(-(v/v_s)^2) does, is there for none of the stages of a step that leaps across the band, but for the
    last stages of the step that ends at the surface. Then there is no event yet: the length is that of a step
    to be tried instead, negative.
    """
    n = state.size
    at = part * length
    end = work[END, :n]
    system.field(signs, state, parameters, work[0])  # whoever looks for events may have used the memory
    for _ in range(EVENT_CORRECTIONS):
        error = _attempt(system, signs, state, parameters, at, polynomials, work)
        if error >= 1.0 and at > work[LIMITS, LEAST]:
            return -TOWARDS_EVENT * at, 0.0
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

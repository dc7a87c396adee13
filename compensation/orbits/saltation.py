"""How a small deviation crosses a surface: saltation matrices, and deviations carried along a mode.

A deviation d of a trajectory obeys d' = Df d inside a mode. Where the trajectory meets the surface with
normal n and the field jumps from f- to f+, the deviated one meets it a little earlier or later, so that
d becomes S d with

    S = I + (f+ - f-) n^T / (n f-)

(Aizerman and Gantmakher; Leine and Nijmeijer 2004, section 7). On a section, where only the place of arrival
counts and not its time, d is projected along the field instead: d - f- (n d) / (n f-).
"""

from __future__ import annotations

from ident.simulation.compiled import compiled, specialised
from ident.simulation.filippov_system import FilippovSystem, FloatArray, OneStepMethod, Signs
from ident.simulation.polynomials import evaluate


@compiled
def saltate(deviations: FloatArray, before: FloatArray, after: FloatArray, normal: FloatArray) -> None:
    """Carry deviations (n, k), in place, across the surface with `normal` (n,) between two fields (n,)."""
    for i in range(deviations.shape[1]):
        early = _early(deviations, i, before, normal)
        for j in range(normal.size):
            deviations[j, i] += (after[j] - before[j]) * early


@compiled
def project_along(deviations: FloatArray, field: FloatArray, normal: FloatArray, later: FloatArray) -> None:
    """Project deviations (n, k), in place, along the field (n,) onto the surface with `normal` (n,).

    How much later they arrive there goes into `later` (k,) [s].
    """
    for i in range(deviations.shape[1]):
        early = _early(deviations, i, field, normal)
        for j in range(normal.size):
            deviations[j, i] -= field[j] * early
        later[i] = -early


@compiled
def _early(deviations: FloatArray, column: int, field: FloatArray, normal: FloatArray) -> float:
    """How much earlier [s] a deviated trajectory reaches the surface, n d / (n f-)."""
    ahead, speed = 0.0, 0.0
    for j in range(normal.size):
        ahead += normal[j] * deviations[j, column]
        speed += normal[j] * field[j]
    return ahead / speed


@specialised
def carry(
    method: OneStepMethod,
    system: FilippovSystem,
    parameters: FloatArray,
    signs: Signs,
    state: FloatArray,
    duration: float,
    tolerance: float,
    polynomials: FloatArray,
    work: FloatArray,
) -> None:
    """Advance `state`, in place, by `duration` inside the mode of `signs`.

    `system` is the one whose states are those of a base system followed by its deviations.
    """
    left = duration
    suggested = duration
    while left > 0.0:
        length, degree, suggested = method.step(
            system, signs, state, parameters, tolerance, left, suggested, polynomials, work
        )
        evaluate(polynomials, state.size, degree, 1.0, state)
        left = left - length if length < left else 0.0

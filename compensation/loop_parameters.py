"""The numbers of all modes of the closed loop, formed once: what `loop_modes` and `loop_series` read.

Differences of coefficients, of robot and model, are exactly zero here where the model is the robot.
"""

from __future__ import annotations

from math import exp, expm1, sqrt
from typing import Final

from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray, Signs

# Rows 0..3 of the parameters: slip, by 2 (x2 > 0) + (v > 0). Rows 4, 5: stick, by (x2 > 0).
A1, A2, A3, K0, K2, KV, C1, C2, GAIN, SIGN2, SIGNV, WIDTH2, WIDTHV, SHAPE2, SHAPEV, ALIKE = range(16)
RATE, GOAL, STIFF, DAMP, COULOMB, FADING, WIDTH, SHAPE, HIGH, LOW = range(10)
ROWS: Final = 6
SLIP_MODES: Final = 4
COLUMNS: Final = 16
SLOWEST: Final = 1e-12  # [1/s] stands for an observer without gain or damping, whose estimate never settles


@compiled
def own_time(parameters: FloatArray) -> float:
    """The slowest time scale [s] of the loop with these parameters (6, 16), by which its motion is awaited.

    Of robot and model: sqrt(J/n1), in which the link swings, and (b + n2)/n1, in which it creeps home.
    """
    slowest = 0.0
    for mode in range(SLIP_MODES):
        k = parameters[mode]
        model, true = -k[C1], -k[C1] - k[A1]
        swing = max(1.0 / sqrt(model), 1.0 / sqrt(true))
        slowest = max(slowest, swing, -k[C2] / model, (-k[C2] - k[A2]) / true)
    return float(slowest)


@compiled
def fastest_decay(parameters: FloatArray) -> float:
    """L + b/J [1/s], the greater of both directions, at which an observer error decays: it limits a step."""
    fastest = 0.0
    for mode in range(SLIP_MODES):
        fastest = max(fastest, -parameters[mode, A3])
    return fastest


@compiled
def slip_row(signs: Signs) -> int:
    """The row of a slip mode, by the signs of x2 and of v."""
    return (2 if signs[0] > 0 else 0) + (1 if signs[1] > 0 else 0)


@compiled
def fading(speed: float, width: float, shape: float) -> float:
    """(s/v_s)^beta; for beta = 1 continued through 0 analytically, else evenly."""
    return speed / width if shape == 1.0 else (abs(speed) / width) ** shape


@compiled
def fading_difference(estimated: float, by_velocity: float, exponent: float) -> float:
    """exp(-by_velocity) - estimated, where estimated = exp(-by_velocity - exponent): 0 for exponent 0."""
    return estimated * expm1(exponent) if exponent <= 0.0 else -exp(-by_velocity) * expm1(-exponent)


@compiled
def mode_table(laws: FloatArray, inertia: FloatArray, gains: FloatArray, out: FloatArray) -> None:
    """The parameters (6, 16) of all modes.

    `laws` (4, 5): F_s, F_c, v_s, b, beta of the robot's positive and negative, the model's positive and
    negative direction. `inertia` (2,): robot, model. `gains` (4,): n1, n2, L, r.
    """
    j, j_model = inertia[0], inertia[1]
    n1, n2, observer, r = gains[0], gains[1], gains[2], gains[3]
    for forward2 in range(2):
        model = laws[2] if forward2 else laws[3]
        s2 = 1.0 if forward2 else -1.0
        damping = (model[3] + n2) / j_model
        for forward in range(2):
            true = laws[0] if forward else laws[1]
            sv = 1.0 if forward else -1.0
            k = out[2 * forward2 + forward]
            rise, rise_model = true[0] - true[1], model[0] - model[1]
            alike = forward == forward2 and true[2] == model[2] and true[4] == model[4]
            k[A1] = n1 / j_model - n1 / j
            k[A2] = damping - (true[3] + n2) / j
            k[A3] = -(true[3] / j + observer)
            k[K0] = (s2 * r * model[1] - sv * true[1]) / j
            k[K2] = s2 * (r * rise_model - rise) / j if alike else s2 * r * rise_model / j
            k[KV] = -sv * rise / j
            k[C1] = -n1 / j_model
            k[C2] = -damping
            k[GAIN] = observer
            k[SIGN2], k[SIGNV] = s2, sv
            k[WIDTH2], k[WIDTHV] = model[2], true[2]
            k[SHAPE2], k[SHAPEV] = model[4], true[4]
            k[ALIKE] = 1.0 if alike else 0.0
        k = out[4 + forward2]
        k[RATE] = max(damping + observer, SLOWEST)
        k[GOAL] = -n1 / j_model / k[RATE]
        k[STIFF], k[DAMP] = n1, n2
        k[COULOMB], k[FADING] = r * model[1], r * rise_model
        k[WIDTH], k[SHAPE] = model[2], model[4]
        k[HIGH], k[LOW] = laws[0, 0], -laws[1, 0]

"""For how long a Taylor series of the closed loop tells the truth, and where it keeps its fadings.

At many times v_s, exp(-|v|/v_s) is lost in rounding: the coefficients of the state no longer show it, yet it
is back before v is small. Such a step ends where the exponent has fallen by the order, or to UNSEEN.
"""

from __future__ import annotations

from typing import Final

from ident.simulation.compiled import compiled
from ident.simulation.filippov_system import FloatArray
from ident.simulation.pack_functions import rough_power_of_two
from ident.simulation.packs import (
    larger,
    magnitude,
    number_of,
    pack_at,
    packed,
    rough_log2,
    smaller,
    spread,
)
from ident.simulation.taylor import SMALLEST

UNSEEN: Final = 40.0  # exp(-40) is below rounding
UNLIMITED: Final = 1e300
LONGEST: Final = 1000.0  # of a reach, as a power of two


@compiled
def fadings(order: int) -> int:
    """Where in `work` the coefficients of the fadings begin."""
    return 4 * (order + 1)


@compiled
def reach_of(exponents: FloatArray, at: int, order: int, fall2: float, fallv: float) -> float:
    """Time within which neither exponent falls by more than `order`, nor from above to below UNSEEN.

    Of the exponents' Taylor coefficients, that begin with `fall2` and `fallv`, those of degree k stand at
    `at` + 4 k, two of every 4 numbers.
    """
    allowed = packed(_allowed(fall2, order), _allowed(fallv, order), UNLIMITED, UNLIMITED)
    power = spread(4, LONGEST)
    for k in range(1, order + 1):
        change = larger(magnitude(pack_at(4, exponents, at + 4 * k)), spread(4, SMALLEST))
        power = smaller(rough_log2(allowed / change) * spread(4, 1.0 / k), power)
    reach = rough_power_of_two(power)
    nearest: float = min(number_of(reach, 0), number_of(reach, 1))
    return 0.5 * nearest


@compiled
def _allowed(fall: float, order: int) -> float:
    return max(float(order), fall - UNSEEN) if fall > order else UNLIMITED

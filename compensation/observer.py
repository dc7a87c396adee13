r"""The reduced-order observer, eq (7), and the form of it that needs no derivative.

    v_hat' = -(b^/J^) v_hat + u_c/J^ + L (q' - v_hat)                                          eq (7)

asks for q', which nobody measures. With z = v_hat - L q it becomes

    z' = -(b^/J^ + L) v_hat + u_c/J^,        v_hat = z + L q,

driven by the position and by u_c = n1 (q_r - q) - n2 v_hat alone: the friction compensation is left out of
the observer because it is meant to cancel the friction. Hats mark what the controller believes; b^ is that
of the sign of v_hat (of u_c while v_hat = 0).

A controller steps z once a sample period h, with q and u_c held:

- euler: z += h z'.
- exact: with q held the equation is linear, v_hat -> w = u_c / (J^ (b^/J^ + L)) at the rate b^/J^ + L.

Both tend to eq (7) as h -> 0. While the link moves steadily, q does not stand still between samples: the
exact step then takes L h / 2 too much speed, relative, where Euler's is unbiased.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ident.simulation.compiled import compiled

FloatArray = NDArray[np.float64]


@compiled
def believed_damping(estimate: float, feedback: float, model: FloatArray) -> float:
    """b^ [N m s/rad] for the direction of the estimate [rad/s], of `feedback` u_c [N m] where that is 0."""
    forward = estimate > 0.0 or (estimate == 0.0 and feedback > 0.0)
    return float(model[4] if forward else model[9])


@compiled
def euler_change(estimate: float, feedback: float, period: float, gain: float, model: FloatArray) -> float:
    """Change of z [rad/s] over a period [s], by Euler's rule; `gain` is L [1/s], `model` a `law_array`."""
    damping = believed_damping(estimate, feedback, model)
    return float(period * (feedback / model[0] - (damping / model[0] + gain) * estimate))


@compiled
def exact_change(estimate: float, feedback: float, period: float, gain: float, model: FloatArray) -> float:
    """Change of z [rad/s] over a period [s] with q and u_c held; arguments as in `euler_change`."""
    rate = believed_damping(estimate, feedback, model) / model[0] + gain
    if rate == 0.0:
        return float(period * feedback / model[0])
    return float((feedback / (model[0] * rate) - estimate) * -math.expm1(-rate * period))

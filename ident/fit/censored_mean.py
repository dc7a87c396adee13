r"""Breakaways of which some only say "more than the torque limit" (Tobin 1958).

Where places differ, a limit near F_s lets the weaker places move and not the stronger ones, and the mean of
those that moved is too low. With breakaways t_i of error s_i and bounds L_j the likelihood of F_s = m is

    -1/2 sum ((t_i - m)/s_i)^2 + sum ln Phi((m - L_j)/s),

s the median of the s_i. It is concave; about its maximum it is the normal one of breakaways that are all
shifted by as much as the bounds ask for, with errors scaled to its curvature. So the joint fit needs nothing
new. A bound far below the breakaways shifts nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from data.recording import FloatArray


@dataclass(frozen=True)
class Shift:
    """What bounds do to the breakaways of one direction."""

    torque: float  # to be added to each [N m]
    factor: float  # on the error of each [-]


def bounded_shift(torque: FloatArray, stderr: FloatArray, bounds: FloatArray) -> Shift:
    """The shift and the scale of breakaways (m,) under bounds (k,), all magnitudes [N m]; m >= 1."""
    weight = stderr**-2.0
    mean, spread = float(np.average(torque, weights=weight)), float(np.median(stderr))
    if bounds.size == 0:
        return Shift(0.0, 1.0)

    def pull(m: float) -> FloatArray:
        below = (bounds - m) / spread
        return np.asarray(np.exp(norm.logpdf(below) - norm.logsf(below)))

    def score(m: float) -> float:
        return float(weight.sum() * (mean - m) + pull(m).sum() / spread)

    # At the upper end every bound is passed by so much that the breakaways pull back harder.
    reach = pull(mean).sum() / spread / weight.sum()
    best = brentq(score, mean, mean + reach) if score(mean + reach) < 0.0 < score(mean) else mean
    curvature = pull(best) * (pull(best) - (bounds - best) / spread) / spread**2
    return Shift(float(best) - mean, float(np.sqrt(weight.sum() / (weight.sum() + curvature.sum()))))

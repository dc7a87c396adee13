r"""What a run's mean torque is worth: a variance model pooled over all runs.

Errors estimated from a run's own few blocks ruin the coverage of intervals, and the scatter of its samples
counts the sensor's noise alone. Two things move a run's mean that the run itself hardly shows: ripple, of
which a slow run sees one phase only, and whatever differs from run to run. So

    Var_i = w_i^2 + tau^2 / (1 + (travel_i / lambda)^2),

w_i^2 the white part times one ratio pooled over all runs, tau the run-to-run spread, lambda the travel over
which ripple averages out (infinite: it never does). tau and lambda are those under which the residuals of
the fit are most likely, and the residuals are inflated for the parameters that they were fitted with. A
finite lambda has to earn its place: it is the best of several tried, and it makes long runs look better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray
from ident.evidence.friction_map import SteadyRun

TRAVELS = 8  # candidates for lambda
SPREADS = 60  # candidates for tau
EARNED = 6.0  # by which twice the log likelihood must rise for a finite lambda
FINEST = 1e-4  # least standard error, in parts of the torque: no torque sensor knows more


@dataclass(frozen=True)
class RunSpread:
    """tau [N m] and lambda [rad]."""

    spread: float
    wavelength: float

    def variance(self, travel: FloatArray) -> FloatArray:
        """Run-to-run variance (n,) [(N m)^2] of runs that travel (n,) [rad]."""
        ratio = travel / self.wavelength if np.isfinite(self.wavelength) else np.zeros_like(travel)
        return np.asarray(self.spread**2 / (1.0 + ratio**2))


def white_variance(runs: Sequence[SteadyRun]) -> FloatArray:
    """w^2 of each run (n,) [(N m)^2]: scatter of its samples times the pooled ratio of its block means."""
    ratio = max(1.0, float(np.median([run.block_ratio for run in runs]))) if runs else 1.0
    own = np.array([run.white_stderr**2 for run in runs])
    least = np.array([(FINEST * run.torque) ** 2 for run in runs])
    return np.asarray(ratio * own + least)


def run_spread(residual: FloatArray, travel: FloatArray, variance: FloatArray, parameters: int) -> RunSpread:
    """tau and lambda by maximum likelihood from the residuals (n,) [N m] of a fit with so many parameters."""
    n = residual.size
    if n <= parameters:
        return RunSpread(0.0, np.inf)
    inflated = residual**2 * n / (n - parameters)
    largest = float(np.sqrt(np.max(inflated, initial=0.0)))
    spreads = np.concatenate([[0.0], np.geomspace(1e-3, 2.0, SPREADS) * largest])
    wavelengths = np.append(np.geomspace(travel.min(), travel.max(), TRAVELS), np.inf)
    averaged = 1.0 / (1.0 + (travel / wavelengths[:, None]) ** 2)
    total = variance + averaged[:, None, :] * spreads[:, None] ** 2
    cost = np.sum(inflated / total + np.log(total), axis=2)
    cost += EARNED * np.outer(np.isfinite(wavelengths), spreads > 0)
    wavelength, spread = np.unravel_index(np.argmin(cost), cost.shape)
    return RunSpread(float(spreads[spread]), float(wavelengths[wavelength]))

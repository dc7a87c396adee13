r"""What a datum's torque is worth: a variance model pooled over all runs and breakaways of a direction.

Errors estimated from a run's own few blocks ruin the coverage of intervals, and the scatter of its samples
counts the sensor's noise alone. Two things move a run's mean that the run itself hardly shows: ripple, of
which a slow run sees one phase only, and whatever differs from run to run; breakaways differ from place to
place. So

    Var_i = w_i^2 + tau^2 / (1 + (travel_i / lambda)^2)    of a steady run,
    Var_i = w_i^2 + sigma^2                                of a breakaway,

w_i^2 what is known of the datum's own error, tau the run-to-run spread, lambda the travel over which ripple
averages out (infinite: it never does), sigma the spread of places. tau and sigma are of each direction:
joints that rub differently also stray differently, and a common spread would promise too much for the worse.
They are the most likely under what the fit leaves over (`ident.fit.restricted_likelihood`). A finite lambda
has to earn its place: it is the best of several tried, and it makes long runs look better. And what averages
out over a run has to be seen within it: a torque that hardly scatters over many lambda hides no ripple. A law
that fits fast runs and not the slow ones would else be explained by ripple that is not there.

A single breakaway says nothing of its spread: the other direction's is taken, or if that has none either,
the steady runs'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.evidence.friction_map import SteadyRun
from ident.fit.restricted_likelihood import most_likely_variances

TRAVELS = 8  # candidates for lambda
SEEN = 4.0  # times the largest variance within long runs: more cannot average out unseen
LONG = 2.0  # lambda that a run covers which must show it
EARNED = 6.0  # by which twice the log likelihood must rise for a finite lambda
FINEST = 1e-4  # least standard error, in parts of the torque: no torque sensor knows more
REPLICATES = 2  # breakaways that show a spread
SIGNS = (1, -1)

Directions = NDArray[np.int64]  # +1 or -1


@dataclass(frozen=True)
class Spread:
    """Variances by group (g,) [(N m)^2]: runs +, runs -, then the groups of breakaways; lambda [rad]."""

    variances: FloatArray
    wavelength: float

    def of_runs(self, direction: Directions, travel: FloatArray) -> FloatArray:
        """Run-to-run variance (n,) [(N m)^2] of runs or windows that travel (n,) [rad]."""
        tau_squared = np.where(direction > 0, self.variances[0], self.variances[1])
        return np.asarray(tau_squared * averaged_out(travel, self.wavelength))


def averaged_out(travel: FloatArray, wavelength: float) -> FloatArray:
    """Part of the run-to-run variance that a travel (n,) [rad] leaves."""
    ratio = travel / wavelength if np.isfinite(wavelength) else np.zeros_like(travel)
    return np.asarray(1.0 / (1.0 + ratio**2))


def members(run_direction: Directions, start_direction: Directions) -> NDArray[np.bool_]:
    """Which runs and breakaways share a variance (g, n + m)."""
    of_run = np.arange(run_direction.size + start_direction.size) < run_direction.size
    direction = np.concatenate([run_direction, start_direction])
    shown = [sign for sign in SIGNS if np.count_nonzero(start_direction == sign) >= REPLICATES]
    alone = of_run if shown else np.ones_like(of_run)
    groups = [alone & (direction == sign) for sign in SIGNS]
    if len(shown) == 1:
        groups.append(~of_run)
    elif shown:
        groups += [~of_run & (direction == sign) for sign in shown]
    return np.array(groups)


def white_variance(runs: Sequence[SteadyRun]) -> FloatArray:
    """w^2 of each run (n,) [(N m)^2]: scatter of its samples times the pooled ratio of its block means."""
    ratio = max(1.0, float(np.median([run.block_ratio for run in runs]))) if runs else 1.0
    own = np.array([run.white_stderr**2 for run in runs])
    least = np.array([(FINEST * run.torque) ** 2 for run in runs])
    return np.asarray(ratio * own + least)


def spread_of(
    residual: FloatArray,
    basis: FloatArray,
    known: FloatArray,
    groups: NDArray[np.bool_],
    travel: FloatArray,
    scatter: FloatArray,
) -> Spread:
    """The most likely spread.

    Parameters
    ----------
    residual : (n + m,) of runs and then breakaways [N m]
    basis : (n + m, p) change of the law's torque with its parameters
    known : (n + m,) variance that is known [(N m)^2]
    groups : (g, n + m) from `members`
    travel : (n,) of the runs [rad]
    scatter : (n,) standard deviation of the torque within each [N m]
    """
    best, least = Spread(np.zeros(len(groups)), np.inf), np.inf
    for wavelength in (np.inf, *np.geomspace(travel.min(), travel.max() / LONG, TRAVELS)):
        part = np.ones(residual.size)
        part[: travel.size] = averaged_out(travel, wavelength)
        variances, cost = most_likely_variances(residual, basis, known, groups * part)
        cost += EARNED if np.isfinite(wavelength) else 0.0
        if cost < least and _would_be_seen(variances, groups, travel, scatter, wavelength):
            best, least = Spread(variances, float(wavelength)), cost
    return best


def _would_be_seen(
    variances: FloatArray,
    groups: NDArray[np.bool_],
    travel: FloatArray,
    scatter: FloatArray,
    wavelength: float,
) -> bool:
    """Whether the torque within long runs (n,) scatters as what averages out over them must make it."""
    for variance, group in zip(variances, groups[:, : travel.size], strict=True):
        long = group & (travel >= LONG * wavelength)
        if np.any(long) and variance > SEEN * float(np.max(scatter[long])) ** 2:
            return False
    return True

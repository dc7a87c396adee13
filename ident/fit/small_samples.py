r"""How far variances that are themselves estimates carry: the reach of each parameter's interval.

A standard error rests on spreads found from a few dozen data, or from three breakaways. With whitened
residuals of slope J, covariance C = (J'J)^-1 and a parameter c'p, the datum i brings a_i^2 of its variance
V = c'Cc, a = J C c, of which the part f_gi is spread g's. The relative errors of the spreads have covariance

    W = B^-1,    B_gh = 1/2 f_g' (R o R) f_h,    R = 1 - J C J'

(from the expected restricted likelihood). Two things follow (Kenward and Roger 1997). V is worth as many
degrees of freedom as a chi-square that strays as much (Satterthwaite 1946): with h_g = sum a_i^2 f_gi,

    nu = 2 V^2 / (h' W h).

And since the weights follow the noise that made them, the parameters stray by more than C says:

    C_A = C + 2 C [ sum over g, h of W_gh J' F_g R F_h J ] C,    F_g = diag(f_g).

An interval then reaches t(nu) standard errors of C_A. What data know of themselves (white noise, rounding)
has no share in this, and nu is infinite where nothing else matters. Two errors come with degrees of freedom
of their own: the scale of the motion after breakaway, and the stated error of the frequency response.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, in_order, jacobian

SLIGHT = 1e-4  # share of every datum's variance under which a spread plays no part
LEAST = 0.25  # information on a spread's relative error, of half a degree of freedom: below, there is none
DEPENDENT = 1e-10  # singular value, of the largest, below which slopes are dependent


@dataclass(frozen=True)
class Certainty:
    """What errors that were estimated themselves make of the covariance of p free parameters.

    The parameters that the data do not feel keep their infinite variance. Covariances are in the products
    of the parameters' units [SI].
    """

    plain: FloatArray  # (p, p) C, as if the spreads were known
    covariance: FloatArray  # (p, p) C_A
    part: FloatArray  # (p, p, g) C J' F_g J C: what each spread brings
    strays: FloatArray  # (g, g) W

    def dof(self, combination: FloatArray) -> float:
        """Degrees of freedom behind the variance of a combination (p,) of parameters that are felt."""
        felt = combination != 0
        own = combination[felt]
        block = np.ix_(felt, felt)
        brought = np.einsum("i,ijg,j->g", own, self.part[block], own)
        strayed = float(brought @ self.strays @ brought)
        variance = float(own @ self.plain[block] @ own)
        return 2.0 * variance**2 / strayed if strayed > 0.0 else np.inf

    def inflation(self, combination: FloatArray) -> float:
        """Variance of a combination (p,) under C_A over that under C."""
        felt = combination != 0
        own, block = combination[felt], np.ix_(felt, felt)
        return float((own @ self.covariance[block] @ own) / (own @ self.plain[block] @ own))


def certainty(data: FitData, fit: FrictionFit) -> Certainty:
    """The certainty of a fit's free parameters."""
    felt = np.isfinite(np.diag(fit.covariance))
    block = np.ix_(felt, felt)
    shares, own = _shares(data)
    found = certainty_of(jacobian(data, fit.values, fit.free)[:, felt], fit.covariance[block], shares, own)
    covariance, part = fit.covariance.copy(), np.zeros((*fit.covariance.shape, len(found.strays)))
    covariance[block], part[block] = found.covariance, found.part
    return Certainty(fit.covariance, covariance, part, found.strays)


def certainty_of(slopes: FloatArray, plain: FloatArray, shares: FloatArray, dof: FloatArray) -> Certainty:
    """The certainty of parameters (p,) that are all felt.

    Parameters
    ----------
    slopes : (N, p) of the residuals, in standard errors, with the parameters
    plain : (p, p) inverse of slopes' slopes
    shares : (g, N) part of each datum's variance that each spread makes
    dof : (g,) of spreads that come with their own; NaN for those found from these data
    """
    plays = (shares.max(axis=1, initial=0.0) > SLIGHT) & ~np.isinf(dof)
    shares, dof = shares[plays], dof[plays]
    span, size, _ = np.linalg.svd(slopes / np.linalg.norm(slopes, axis=0), full_matrices=False)
    span = span[:, size > DEPENDENT * size[0]]
    left = np.eye(len(slopes)) - span @ span.T
    information = 0.5 * shares @ left**2 @ shares.T
    known = np.isfinite(dof)
    information[known] = information[:, known] = 0.0
    information[known, known] = 0.5 * dof[known]
    told, ways = np.linalg.eigh(information)
    strays = (ways / np.maximum(told, LEAST)) @ ways.T
    weighed = shares[:, :, None] * slopes  # F_g J
    felt_by = np.einsum("ip,giq->gpq", slopes, weighed)  # J' F_g J
    excess = np.einsum("gip,gh,hiq->pq", weighed, strays, left @ weighed, optimize=True)
    covariance = plain + 2.0 * plain @ excess @ plain
    part = np.moveaxis(plain @ felt_by @ plain, 0, -1)
    return Certainty(plain, np.asarray(covariance), part, np.asarray(strays))


def _shares(data: FitData) -> tuple[FloatArray, FloatArray]:
    """Share of each spread in each residual's variance (g, N), and its own degrees of freedom or NaN (g,)."""
    runs, none = data.torque.size, (np.zeros(data.torque.size), np.zeros(data.start_torque.size))
    rows = [in_order(data, runs=share[:runs], starts=share[runs:]) for share in data.shares]
    rows.append(in_order(data, runs=none[0], starts=none[1], motion=1.0))
    rows.append(in_order(data, runs=none[0], starts=none[1], inertia=1.0))
    known = [np.nan] * len(data.shares) + [data.motion_dof, data.inertia_dof]
    return np.array(rows), np.array(known)

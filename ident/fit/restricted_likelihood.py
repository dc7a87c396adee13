r"""Variances from the residuals of a fit, by restricted maximum likelihood.

Data y = X p + e have independent errors of variance

    V_i = k_i + sum over g of d_gi s_g,

k_i known, s_g >= 0 to be found, d_gi what of s_g the datum i feels. Maximum likelihood takes the residuals
for the errors and so finds the s_g too small: a fit bends towards its data, most where few tell a parameter.
The restricted likelihood is that of what the fit leaves over (Patterson and Thompson 1971); with
P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1 its slope vanishes where

    y' P D_g P y = tr(P D_g)    for every g,

and s_g is multiplied by the ratio of the two until it settles, which keeps it positive (Harville 1977).

A variance that is right in the mean is too small more often than not, and far too small often where it has
few degrees of freedom: a chi-square's median lies 2/3 under its mean. Weights then run after the data that
look good by chance. So the tr(P D_g) are lessened by 2/3 of a typical datum's D_gi/V_i, which makes s_g as
often too large as too small: sum of squares over nu - 2/3 where one variance is all. (It is the most likely
value under a prior that rises as the cube root of V.)
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from data.recording import FloatArray
from ident.simulation.compiled import owning

MEDIAN: Final = 2.0 / 3.0  # by which the median of a chi-square lies under its mean
_MOST: Final = 500
_SETTLED: Final = 1e-7  # of the criterion, per round
_SPARED: Final = 0.25  # part of the degrees of freedom that the median leaves at least
_DEPENDENT: Final = 1e-9  # part of a column that the columns before it leave, below which it adds nothing


@owning
def most_likely_variances(
    residual: FloatArray, basis: FloatArray, known: FloatArray, shapes: FloatArray
) -> tuple[FloatArray, float]:
    """The variances (g,) and their criterion, -2 log restricted likelihood up to a constant.

    Parameters
    ----------
    residual : (n,) of any parameters near the best; the fit's own freedom is taken out of it here
    basis : (n, p) X, dependent columns allowed
    known : (n,) k > 0
    shapes : (g, n) d >= 0, of each datum over 0 in one group at most
    """
    groups, n = shapes.shape
    p = basis.shape[1]
    variance, size = np.empty(groups), np.zeros(groups)
    for g in range(groups):
        felt = weight = 0.0
        for i in range(n):
            size[g] += 1.0 if shapes[g, i] > 0.0 else 0.0
            felt += shapes[g, i] * residual[i] ** 2
            weight += shapes[g, i]
        variance[g] = felt / weight if weight > 0.0 else 0.0  # a group may be empty
    q, left, total, spared = np.empty((p, n)), np.empty(n), np.empty(n), np.empty(n)
    criterion = math.inf
    for _ in range(_MOST):
        now = 0.0
        for i in range(n):
            total[i] = known[i]
            for g in range(groups):
                total[i] += shapes[g, i] * variance[g]
            now += math.log(total[i])
            for g in range(groups):
                if shapes[g, i] > 0.0:
                    now -= MEDIAN * math.log(total[i]) / size[g]
            left[i] = residual[i] / math.sqrt(total[i])
            spared[i] = 1.0
        for k in range(p):
            whole = 0.0
            for i in range(n):
                q[k, i] = basis[i, k] / math.sqrt(total[i])
                whole += q[k, i] ** 2
            for _again in range(2):
                for j in range(k):
                    along = 0.0
                    for i in range(n):
                        along += q[j, i] * q[k, i]
                    for i in range(n):
                        q[k, i] -= along * q[j, i]
            rest = 0.0
            for i in range(n):
                rest += q[k, i] ** 2
            if rest <= _DEPENDENT**2 * whole or rest == 0.0:
                for i in range(n):
                    q[k, i] = 0.0
                continue
            now += math.log(rest)
            along = 0.0
            for i in range(n):
                q[k, i] /= math.sqrt(rest)
                along += q[k, i] * left[i]
            for i in range(n):
                left[i] -= along * q[k, i]
                spared[i] -= q[k, i] ** 2
        for i in range(n):
            now += left[i] ** 2
        if abs(criterion - now) < _SETTLED:
            return variance, now
        criterion = now
        for g in range(groups):
            seen = expected = typical = 0.0
            for i in range(n):
                part = shapes[g, i] / total[i]
                seen += part * left[i] ** 2
                expected += part * spared[i]
                typical += part / max(size[g], 1.0)
            if expected > 0.0:
                variance[g] *= seen / max(expected - MEDIAN * typical, _SPARED * expected)
    return variance, criterion

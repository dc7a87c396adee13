r"""A cause that the law leaves out, tested as columns added to it.

With e the residuals in standard errors and A the derivatives of the law's predictions in the same, a column x
is seen only so far as the law cannot imitate it, x - A (A^+ x); its size and its F ratio follow by least
squares (the test of an added variable; Cook and Weisberg 1982, sec. 2.4.4). So a drift over speeds that were
run in order is not called certain where it may as well be damping. The scatter is that of the residuals; what
corrects the data, and does not only warn, asks for an effect beyond the weights' scatter as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from data.recording import FloatArray
from ident.fit.predictions import gradient, measured, predicted, stderr
from ident.fit.weighting import Weighted

CHANCE = 0.002  # of each test where nothing is wrong
SPARE = 4  # least number of data beyond parameters and added columns
TINY = 1e-12  # of a scatter, where the law fits to rounding
IMITATED = 0.05  # part of the columns' mean square that the law must leave, or nothing can be said


@dataclass(frozen=True)
class Added:
    """Columns added to the law: coefficients in N m a unit of the column, and the chance of their F ratio."""

    coefficients: FloatArray  # (k,) [N m / unit of the column]
    covariance: FloatArray  # (k, k) of them [products of their units]
    chance: float  # p value [-]


def added(
    weighted: Weighted, columns: FloatArray, *, groups: FloatArray | None = None, least_scatter: float = TINY
) -> Added | None:
    """The F test of columns (n + m, k) [N m] that are added to the law; None where nothing can be said.

    `groups` (n + m, g) are columns that both models have; `least_scatter` [-] is in variances of the weights.
    """
    error = stderr(weighted.data)
    residual = (measured(weighted.data) - predicted(weighted.data, weighted.fit.values)) / error
    law = gradient(weighted.data, weighted.fit)
    if groups is not None:
        law = np.column_stack([law, groups])
    span = _orthonormal(law / error[:, None])
    left = residual - span @ (span.T @ residual)
    column = columns / error[:, None]
    own = column - span @ (span.T @ column)
    spanned, sizes, turned = np.linalg.svd(own, full_matrices=False)
    seen = sizes**2 > IMITATED * np.sum(column**2) / column.shape[1]
    rank = int(np.count_nonzero(seen))
    spare = residual.size - span.shape[1] - rank
    if spare < SPARE or rank == 0:
        return None
    share = spanned[:, seen].T @ left
    scatter = float(np.sum(left**2) - np.sum(share**2)) / spare
    scatter = max(scatter, least_scatter)
    chance = float(fisher.sf(float(np.sum(share**2)) / rank / scatter, rank, spare))
    back = turned[seen].T / sizes[seen]
    return Added(np.asarray(back @ share), np.asarray(scatter * back @ back.T), chance)


def _orthonormal(columns: FloatArray) -> FloatArray:
    """A basis (n, r) of what columns (n, p) span; columns of zeros span nothing."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(left[:, values > 1e-9 * values[0]])

"""The law held against motion that it was not fitted to.

Each fold is left out once: a span, where there are several, else one of five stretches of the one span. The
law fitted to the rest predicts the torque of the fold; the error is that of all folds together, relative to
their torque.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ident.excitation.inverse_dynamics import System, least_squares

FOLDS: Final = 5


def held_out_error(problem: System) -> float | None:
    """Norm of the torque's error on held-out folds over the norm of the torque; None where a fit fails."""
    folds = _folds(problem)
    error = 0.0
    for fold in np.unique(folds):
        held_out = folds == fold
        fit = least_squares(problem.rows(~held_out))
        if fit is None:
            return None
        left = problem.torque[held_out] - problem.columns[held_out] @ fit.values
        error += float(left @ left)
    return float(np.sqrt(error) / np.linalg.norm(problem.torque))


def _folds(problem: System) -> NDArray[np.intp]:
    number = np.unique(problem.span).size
    if number > 1:
        return np.asarray(problem.span % FOLDS if number > FOLDS else problem.span)
    return np.asarray(FOLDS * np.arange(problem.torque.size) // problem.torque.size)

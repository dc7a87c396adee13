"""Whether residuals are without order: tests on signs and ranks, which need no normality.

- Runs test (Wald and Wolfowitz 1940): residuals in the order of a variable change sign as often as chance
  has it. Too few runs of one sign mean a law that bends otherwise than the data. The count's distribution is
  exact, given how many are positive.
- Rank correlation (Spearman 1904) with a variable: a residual that grows or falls with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.stats import rankdata
from scipy.stats import t as student

from data.recording import FloatArray

LEAST = 6  # residuals that a test asks for


@dataclass(frozen=True)
class ResidualTest:
    """One test: what it looks for, and how likely chance alone is."""

    name: str
    statistic: float  # [-]
    expected: float  # of the statistic, without any order [-]
    chance: float  # p value [-]
    data: int


def runs_test(residual: FloatArray, variable: FloatArray, *, name: str) -> ResidualTest | None:
    """Runs of one sign of residuals (n,) in the order of a variable (n,); None for too few of either sign."""
    positive = residual[np.argsort(variable, kind="stable")] > 0
    n, above = positive.size, int(np.count_nonzero(positive))
    below = n - above
    if n < LEAST or min(above, below) < 2:
        return None
    runs = 1 + int(np.count_nonzero(np.diff(positive.astype(np.int8))))
    chance = sum(_ways(count, above, below) for count in range(2, runs + 1)) / comb(n, above)
    return ResidualTest(name, float(runs), 1.0 + 2.0 * above * below / n, float(chance), n)


def _ways(runs: int, above: int, below: int) -> int:
    """Orders of so many signs with exactly `runs` runs."""
    half, odd = divmod(runs, 2)
    if not odd:
        return 2 * comb(above - 1, half - 1) * comb(below - 1, half - 1)
    return comb(above - 1, half) * comb(below - 1, half - 1) + comb(above - 1, half - 1) * comb(
        below - 1, half
    )


def rank_test(residual: FloatArray, variable: FloatArray, *, name: str) -> ResidualTest | None:
    """Rank correlation of residuals (n,) with a variable (n,); None for too few or a variable that rests."""
    n = residual.size
    if n < LEAST or float(np.ptp(variable)) == 0.0 or float(np.ptp(residual)) == 0.0:
        return None
    r = float(np.corrcoef(rankdata(residual), rankdata(variable))[0, 1])
    spread = max(1.0 - r**2, float(np.finfo(np.float64).tiny))
    chance = 2.0 * float(student.sf(abs(r) * np.sqrt((n - 2) / spread), n - 2))
    return ResidualTest(name, r, 0.0, chance, n)

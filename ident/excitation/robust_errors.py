r"""Standard errors of a least-squares fit whose residuals are not independent.

The estimate errs by (X'X)^-1 sum_t x_t e_t, so what matters is the long-run variance of the scores x_t e_t:
their spectrum at frequency zero. It is estimated by the mean of the scores' squared cosine transforms at the
lowest B frequencies,

    Omega = (1/B) sum_{j=1..B} L_j L_j',    L_j = sqrt(2) sum_t cos(pi j (t - 1/2) / n) x_t e_t,

and the estimate over its error then follows Student's t with B degrees of freedom. B = 0.4 n^(2/3) balances
bias and variance. A slow disturbance, a law that does not fit and noise coloured by the filter all widen it.

Source: Lazarus, Lewis, Stock, Watson, HAR inference: recommendations for practice, Journal of Business and
Economic Statistics 36 (2018), the equal-weighted cosine estimator.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import dct

from data.recording import FloatArray

FEWEST = 4  # cosines


def cosines(n: int) -> int:
    """B, the degrees of freedom, for n samples."""
    return max(FEWEST, int(np.rint(0.4 * n ** (2.0 / 3.0))))


def long_run_covariance(scores: FloatArray) -> FloatArray:
    """Covariance (p, p) of the sum of the scores (n, p)."""
    n = scores.shape[0]
    number = min(cosines(n), n - 1)
    transform = dct(scores, type=2, axis=0)[1 : number + 1] / np.sqrt(2.0)  # scipy's DCT is twice the sum
    return np.asarray(transform.T @ transform / number)

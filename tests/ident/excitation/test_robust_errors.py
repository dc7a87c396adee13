import numpy as np
from scipy.signal import lfilter
from scipy.stats import t as student

from ident.excitation.robust_errors import cosines, long_run_covariance


def test_the_mean_of_a_slow_disturbance_gets_its_true_error() -> None:
    generator = np.random.default_rng(1)
    n, memory = 2000, 0.7
    inside = 0
    variances = []
    for _ in range(300):
        noise = lfilter([1.0], [1.0, -memory], generator.standard_normal(n + 200))[200:]
        variance = float(long_run_covariance((noise - noise.mean())[:, None])[0, 0])
        variances.append(variance / n)
        inside += abs(noise.sum()) <= student.ppf(0.975, cosines(n)) * variance**0.5
    assert abs(np.mean(variances) * (1 - memory) ** 2 - 1.0) < 0.1  # independent samples would say 0.2
    assert 0.91 <= inside / 300 <= 0.98


def test_independent_scores_have_the_plain_covariance() -> None:
    generator = np.random.default_rng(2)
    scores = generator.multivariate_normal([0.0, 0.0], [[2.0, 0.6], [0.6, 1.0]], 20_000)
    found = long_run_covariance(scores) / 20_000
    assert np.allclose(found, [[2.0, 0.6], [0.6, 1.0]], atol=0.35)

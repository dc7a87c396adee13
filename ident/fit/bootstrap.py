r"""The bootstrap over runs: the same fit to data that might have been recorded instead.

In each direction the steady runs, the breakaways and the motions after breakaway are drawn with replacement,
each run with its own standard error, and all is refitted, compiled. What the draws spread over owes nothing
to the variance model or to a parabola of chi-square, so it is held beside the profile intervals (Efron and
Tibshirani 1993, ch. 9: resampling of cases). It is no interval of its own where runs are few: a draw without
the slow speeds knows nothing of v_s.

Draws are independent, so that they may be spread by any `map`; the kernels release the interpreter lock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray
from ident.fit.bounded_least_squares import workspace
from ident.fit.fit_data import FitData, flat_problem
from ident.fit.friction_fit import FrictionFit, vector
from ident.fit.refits import refit_resampled

CHUNK = 250  # draws that go to one worker
LEVEL = 0.95
T = TypeVar("T")
R = TypeVar("R")


class Map(Protocol):
    """The built-in `map`, or one that spreads its work over threads."""

    def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterator[R]:
        """The results, in the order of the items."""


@dataclass(frozen=True)
class Draws:
    """Refits of resampled data."""

    names: tuple[str, ...]  # of the free parameters, as the fit has them
    values: FloatArray  # (n, p) [SI]

    def interval(self, combination: Mapping[str, float]) -> tuple[float, float]:
        """Percentiles between which 95 % of the draws of a combination of the parameters lie."""
        share = np.array([combination.get(name, 0.0) for name in self.names])
        low, high = np.quantile(self.values @ share, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
        return float(low), float(high)


@dataclass(frozen=True)
class Resampled:
    """How often each datum was drawn: counts of draws (n, ...), beside the data that they belong to."""

    steady: NDArray[np.int64]  # (n, runs and then breakaways)
    motions: NDArray[np.int64]  # (n, motions)


def bootstrap(
    data: FitData,
    fit: FrictionFit,
    n: int,
    generator: np.random.Generator,
    *,
    map: Map = map,
) -> Draws:
    """Refits of n resamples, each from the fit."""
    counts = resample(data, n, generator)
    start = vector(data, fit.values)
    parts = [slice(first, min(first + CHUNK, n)) for first in range(0, n, CHUNK)]

    def refit(part: slice) -> FloatArray:
        problem, work = flat_problem(data), workspace(start.size)
        found = np.empty((part.stop - part.start, start.size))
        steady, motions = np.sqrt(counts.steady[part]), np.sqrt(counts.motions[part])
        weight = problem.steady.weight.copy()
        refit_resampled(problem, start, data.box, work, weight, steady, motions, found)
        return found

    found = np.concatenate([np.empty((0, start.size)), *map(refit, parts)])
    velocities = [name.endswith("stribeck_velocity") for name in data.model.names]
    found[:, velocities] = np.exp(found[:, velocities])
    return Draws(fit.free, found[:, data.box.free])


def resample(data: FitData, n: int, generator: np.random.Generator) -> Resampled:
    """Draw runs, breakaways and motions with replacement, each kind within its direction."""
    motion = np.array([motion.direction for motion in data.momenta], dtype=np.int64)
    steady = [_counts(sign, n, generator) for sign in (data.run_direction, data.start_direction)]
    return Resampled(np.concatenate(steady, axis=1), _counts(motion, n, generator))


def _counts(sign: NDArray[np.int64], n: int, generator: np.random.Generator) -> NDArray[np.int64]:
    """How often each of the data (k,) is drawn, (n, k)."""
    counts = np.zeros((n, sign.size), dtype=np.int64)
    for one in np.unique(sign):
        own = np.flatnonzero(sign == one)
        counts[:, own] = generator.multinomial(own.size, np.full(own.size, 1.0 / own.size), size=n)
    return counts

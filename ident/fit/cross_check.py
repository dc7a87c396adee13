"""Profile intervals beside those of a bootstrap over runs, as a text for the report."""

from __future__ import annotations

import numpy as np

from ident.estimate import Estimate
from ident.fit.bootstrap import bootstrap
from ident.fit.fit_data import FitData
from ident.fit.law_model import COMMON
from ident.fit.parameters import Parameters, combinations

REFITS = 1000


def bootstrap_table(data: FitData, values: Parameters, generator: np.random.Generator) -> str:
    """A line for each parameter that is not withheld: its value, its interval, and that of the bootstrap."""
    draws = bootstrap(data, values.fit, REFITS, generator)
    lines = [
        f"[[Bootstrap over runs, {REFITS} refits, beside the profile intervals]]",
        f"    {'parameter':30s} {'value':>11}   {'profile interval':>25}   {'bootstrap interval':>25}",
    ]
    for name, combination in combinations(values.fit).items():
        estimate = _estimate(values, name)
        if estimate is None or estimate.value is None:
            continue
        own = _pair(*(estimate.interval95 or (None, None)))
        drawn = _pair(*draws.interval(combination))
        lines.append(f"    {name:30s} {estimate.value:11.5g}   {own:>25}   {drawn:>25}")
    return "\n".join(lines)


def _estimate(values: Parameters, name: str) -> Estimate | None:
    """The estimate that a name of the covariance stands for; None for dF, which is none."""
    if name in COMMON:
        return values.inertia if name == "inertia" else values.torque_offset
    law, _, parameter = name.partition(".")
    curve = values.mean if law == "mean" else values.curves["positive" if law == "positive" else "negative"]
    return curve.get(parameter)


def _pair(low: float | None, high: float | None) -> str:
    return " .. ".join("open" if end is None else f"{end:.5g}" for end in (low, high))

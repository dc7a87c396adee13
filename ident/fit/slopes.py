"""How anything that depends on the parameters changes with them: central differences, the same everywhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from data.recording import FloatArray

STEP = 1e-5  # of a parameter's size
LEAST = 1e-4  # of the largest parameter: the size of one that ended at 0 or near it


def slopes(
    function: Callable[[Mapping[str, float]], FloatArray], values: Mapping[str, float], free: Sequence[str]
) -> FloatArray:
    """Derivatives of a function (n,) of the parameters by the free ones (n, p) [1/SI]."""
    columns = []
    for name in free:
        step = STEP * _size(values, name)
        ahead, behind = (function({**values, name: values[name] + off}) for off in (step, -step))
        columns.append((ahead - behind) / (2 * step))
    return np.column_stack(columns)


def _size(values: Mapping[str, float], name: str) -> float:
    """What a step is a part of.

    v_s and beta are never 0. The others enter every prediction linearly, so that their steps may be large
    beside them, and must be where they ended at 0 or near it, or the difference is lost to rounding.
    """
    if name.endswith(("stribeck_velocity", "stribeck_shape")):
        return values[name]
    return max(abs(values[name]), LEAST * max(abs(value) for value in values.values()))

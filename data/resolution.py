"""One encoder count, found in the positions themselves.

A quantised position takes values on a lattice. The spacing is sought as the number that divides all small
steps between distinct values; positions that are not on a lattice (a simulated one in full precision, a
filtered one) have none, and then the answer is that it is not known.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_MOST_VALUES: Final = 20_000
_FEWEST_STEPS: Final = 12


def lattice_spacing(position: FloatArray) -> float | None:
    """The spacing of the lattice that positions (n,) [rad] lie on, None where they lie on none.

    Needs a dozen distinct values; neighbouring values must be met somewhere within a factor of four.
    """
    values = np.unique(position)[:_MOST_VALUES]
    if values.size <= _FEWEST_STEPS:
        return None
    steps = np.diff(values)
    rounding = 8.0 * np.finfo(np.float64).eps * float(np.max(np.abs(values)))
    steps = steps[steps > max(rounding, 1e-9 * float(steps.max()))]
    if steps.size < _FEWEST_STEPS:
        return None
    smallest = float(steps.min())
    near = steps[steps < 50.0 * smallest]
    if near.size < _FEWEST_STEPS:
        return None
    for divisor in (1, 2, 3, 4):
        spacing = smallest / divisor
        multiples = np.rint(near / spacing)
        spacing = float(np.sum(near) / np.sum(multiples))
        error = np.abs(near / spacing - np.rint(near / spacing))
        if float(error.max()) < 0.02 + 2.0 * rounding / spacing:
            return spacing if _varies(position, spacing) else None
    return None


def _varies(position: FloatArray, spacing: float) -> bool:
    """Whether successive steps differ in counts; an exact straight line lies on a lattice of its own."""
    counts = np.rint(np.diff(position) / spacing)
    _, often = np.unique(counts, return_counts=True)
    return bool(np.sort(often)[:-1].sum() > 0.01 * counts.size)

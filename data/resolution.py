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
_MOST_SIZES: Final = 3
_VARIES: Final = 0.01  # part of the steps that are not of one size


def lattice_spacing(position: FloatArray) -> float | None:
    """The spacing of the lattice that positions (n,) [rad] lie on, None where they lie on none.

    Needs a dozen distinct values; neighbouring values must be met somewhere within a factor of four. A fast
    motion leaves out most of the lattice; its steps from sample to sample lie on it too, closer together.
    """
    rounding = 8.0 * np.finfo(np.float64).eps * float(np.max(np.abs(position), initial=0.0))
    for values in (position, np.diff(position)):
        spacing = _spacing(np.unique(values)[:_MOST_VALUES], rounding)
        if spacing is not None and _varies(position, spacing):
            return spacing
    return _spacing_of_few_steps(np.diff(position), rounding)


def _spacing_of_few_steps(steps: FloatArray, rounding: float) -> float | None:
    """The spacing of an even motion whose many steps (n,) are of two or three sizes, as no other's are."""
    sizes = np.sort(np.abs(steps))
    edges = np.flatnonzero(np.diff(sizes) > 4.0 * rounding) + 1
    if not 1 <= edges.size < _MOST_SIZES or sizes.size < _FEWEST_STEPS * (edges.size + 1):
        return None
    groups = np.split(sizes, edges)
    size = np.array([float(group.mean()) for group in groups])
    spacing = float(np.diff(size).min())
    off = np.abs(size / spacing - np.rint(size / spacing))
    # A lost sample doubles a step: a step and its double have to come often.
    often = max(_FEWEST_STEPS, _VARIES * sizes.size) if size[0] < 1.5 * spacing else 2
    few = min(group.size for group in groups) < often
    return None if few or float(off.max()) > 0.02 else spacing


def _spacing(values: FloatArray, rounding: float) -> float | None:
    """The spacing of sorted distinct values (n,), None where they lie on no lattice."""
    if values.size <= _FEWEST_STEPS:
        return None
    steps = np.diff(values)
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
            return spacing
    return None


def _varies(position: FloatArray, spacing: float) -> bool:
    """Whether successive steps differ in counts; an exact straight line lies on a lattice of its own."""
    counts = np.rint(np.diff(position) / spacing)
    _, often = np.unique(counts, return_counts=True)
    return bool(np.sort(often)[:-1].sum() > _VARIES * counts.size)

"""What counts as a number at the door of a public function.

Values that come from outside may be words, None, complex or not finite. The functions that take them ask
here, and say by a `ModelError` of their own which argument it is, which rule it breaks and where that stands.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Collection, Iterable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_SCALARS: Final = (float, int, np.floating, np.integer)
LARGEST: Final = 1e100  # of a parameter, a gain or a state, in SI: beyond it products and squares overflow
_KINDS: Final = "fiu"  # of numpy's types: no words, no complex numbers, no objects


def is_number(value: object) -> bool:
    """Whether a value is one finite real number that a float can hold."""
    try:
        return isinstance(value, _SCALARS) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an int beyond every float
        return False


def is_quantity(value: object) -> bool:
    """Whether a value is a number that can be reckoned with: of a magnitude up to `LARGEST`."""
    return is_number(value) and abs(float(value)) <= LARGEST  # type: ignore[arg-type]  # is_number has looked


def is_number_or_inf(value: object) -> bool:
    """Whether a value is a number or +inf: a bound, which may be none."""
    return is_number(value) or (isinstance(value, float) and value == math.inf)


def is_count(value: object) -> bool:
    """Whether a value is a whole number."""
    return isinstance(value, (int, np.integer)) and is_number(value)


def is_one_of(value: object, words: Collection[str]) -> bool:
    """Whether a value is one of a few words; nothing else is, be it a list or an array."""
    return isinstance(value, str) and value in words


def keep_floats(owner: object, names: Iterable[str]) -> None:
    """Turn numbers of a frozen value, just made and checked, into floats.

    A number in single precision would go on as such into all that is computed from it.
    """
    for name in names:
        value = getattr(owner, name)
        if type(value) is not float:
            object.__setattr__(owner, name, float(value))


def real_array(values: ArrayLike) -> NDArray[np.float64] | None:
    """Real numbers of any shape, nan and inf included, as a copy; None for words, objects, ragged rows."""
    try:
        found = np.array(values, order="C")
    except ValueError:
        return None
    return found.astype(np.float64, copy=False) if found.dtype.kind in _KINDS else None


def shown(value: object) -> str:
    """A value in a message: shortened where it is long, on one line."""
    return " ".join(reprlib.repr(value).split())

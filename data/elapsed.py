"""Time since the first sample, taken before a large number of seconds becomes a float.

A float near 1.7e9, the seconds since 1970, steps by 0.24 us: a clock of exactly 1 kHz would be read with
steps of 0.99993 ms. Differences are therefore taken between the numbers as a log writes them, as integers or
decimals, and only the small difference becomes a float.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
FINE: Final = 1e-9  # of a step between samples: rounding below it is none
_WIDEST: Final = 19  # digits that fit 64 bits, if the first is no 9
EPOCH: Final = 1e8  # [s] three years: a clock beyond it counts from a date, not from a start


def since_first(ticks: Sequence[Decimal]) -> FloatArray:
    """Numbers (n,) minus the first finite one of them, each difference rounded once [as logged]."""
    first = next((tick for tick in ticks if tick.is_finite()), Decimal(0))
    return np.array([float(tick - first) for tick in ticks], np.float64)


def since_first_written(cells: Sequence[str], decimal: str) -> FloatArray:
    """The same for numbers (n,) as they are written; what is none is NaN [as logged]."""
    fixed = _fixed_point(cells, decimal)
    if fixed is not None:
        ticks, places = fixed
        fine: FloatArray = (ticks - ticks[0]) / 10.0**places
        return fine
    return since_first([_tick(cell, decimal) for cell in cells])


def _tick(cell: str, decimal: str) -> Decimal:
    try:
        return Decimal(cell.strip().replace(decimal, "."))
    except InvalidOperation:
        return Decimal("NaN")


def _fixed_point(cells: Sequence[str], decimal: str) -> tuple[NDArray[np.int64], int] | None:
    """Numbers (n,) of one format as integers of its last decimal, and how many decimals it has."""
    width = len(cells[0]) if cells else 0
    text = "".join(cells)
    if not 0 < width <= _WIDEST + (decimal in text) or not text.isascii():
        return None
    if any(len(cell) != width for cell in cells):
        return None
    places = np.frombuffer(text.encode(), np.uint8).reshape(-1, width)
    sign = cells[0].find(decimal)
    if sign >= 0:
        if np.any(places[:, sign] != ord(decimal)):
            return None
        places = np.delete(places, sign, axis=1)
    digits = places - np.uint8(ord("0"))  # what is below wraps to what is above
    if np.any(digits > 9) or (digits.shape[1] == _WIDEST and np.any(digits[:, 0] == 9)):
        return None
    ticks = np.zeros(digits.shape[0], np.int64)
    for place in digits.T:
        ticks = 10 * ticks + place
    return ticks, width - sign - 1 if sign >= 0 else 0


def unset_lead(seconds: FloatArray) -> int:
    """How many stamps (n,) [s] at the start are 0 though the others count from a date.

    A latched message, sent before anyone recorded, may carry 0: its instant is not known.
    """
    if not seconds.size or seconds[0] != 0.0 or not np.any(seconds):
        return 0
    lead = int(np.argmax(seconds != 0.0))
    return lead if seconds[lead] > EPOCH else 0

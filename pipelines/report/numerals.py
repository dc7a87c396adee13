"""Numbers as people read them: as many digits as the interval supports, with a true minus sign.

Files for programs (JSON, CSV) never pass through here: they hold every bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

NOTHING: Final = "–"
_MOST_DIGITS: Final = 4


def shown_number(value: float | None, *, like: float | None = None) -> str:
    """A value with two digits of its uncertainty `like`, or with four digits where none is known."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if like is not None and like > 0 and math.isfinite(like) and abs(value) < 1e6:
        places = min(max(1 - math.floor(math.log10(like)), 0), 9)
        text = f"{value:.{places}f}"
    else:
        text = f"{value:.{_MOST_DIGITS}g}"
    return text.replace("-", "−")


def shown_interval(interval: Sequence[float | None] | None, *, like: float | None = None) -> str:
    """A 95 % interval with two digits of `like` or of its own width; an open end is infinite."""
    if not interval:
        return NOTHING
    low, high = interval
    width = like or half_width(interval)
    left = "(−∞" if low is None else f"[{shown_number(low, like=width)}"
    right = "∞)" if high is None else f"{shown_number(high, like=width)}]"
    return f"{left}, {right}"


def half_width(interval: Sequence[float | None] | None) -> float | None:
    """Half of a closed interval, else None."""
    if not interval or interval[0] is None or interval[1] is None:
        return None
    return 0.5 * (interval[1] - interval[0])


def shown_percent(fraction: float | None) -> str:
    """A fraction in percent, two digits."""
    return NOTHING if fraction is None else f"{100 * fraction:.2g}\N{NO-BREAK SPACE}%".replace("-", "−")

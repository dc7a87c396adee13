"""A message's own stamp: where tools put it, and what they call its parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

PLACES: Final = (("header", "stamp"), ("timestamp",))  # the first that is there
SECONDS: Final = ("sec", "secs", "seconds")
NANOSECONDS: Final = ("nanosec", "nsec", "nsecs", "nanos")
LATEST: Final = 2**33  # of seconds and of nanoseconds that are a stamp
NO_STAMP: Final = int(np.iinfo(np.int64).min)  # [ns], of a message without any


def header_stamp(message: object) -> int:
    """A decoded message's own stamp [ns], or `NO_STAMP`."""
    for place in PLACES:
        stamp = message
        for name in place:
            stamp = _get(stamp, name)
        if stamp is not None:
            return stamp_of(stamp)
    return NO_STAMP


def stamp_of(stamp: object) -> int:
    """Seconds and nanoseconds, by any of their names, as one number [ns], or `NO_STAMP`."""
    seconds, rest = _get(stamp, *SECONDS), _get(stamp, *NANOSECONDS)
    if not isinstance(seconds, int) or not isinstance(rest, int) or max(abs(seconds), abs(rest)) > LATEST:
        return NO_STAMP
    return seconds * 1_000_000_000 + rest


def _get(value: object, *names: str) -> object:
    for name in names:
        inside = value.get(name) if isinstance(value, Mapping) else getattr(value, name, None)
        if inside is not None:
            return inside
    return None

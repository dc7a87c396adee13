"""When a log began: by its clock where that counts from a date, else by what its metadata say.

What changes with time between logs, a rig that warms up, can only be seen if their order is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

from data.elapsed import EPOCH
from data.units import known_unit

KEYS: Final = ("began", "begun", "start", "started", "start_time", "recorded", "date", "datetime", "time")
DAY: Final = len("2004-01-31")
_FILETIME: Final = 11_644_473_600.0  # [s] from 1601, where Windows begins to count, to 1970


def since_1970(stamp: float, unit: str | None) -> float:
    """A clock's stamp [s], counted from 1970 where its unit tells that it counts from elsewhere."""
    known = known_unit(unit or "")
    windows = known is not None and known.word == "100 ns" and stamp > _FILETIME
    return stamp - _FILETIME if windows else stamp


def began(first_stamp: float, metadata: Mapping[str, str]) -> float | None:
    """Seconds from 1970 to the first sample; None where neither clock [s] nor metadata tell.

    Metadata are read as ISO 8601; without a zone they are taken for UTC, which keeps the order. A date
    without a time of day orders nothing.
    """
    if first_stamp > EPOCH:
        return first_stamp
    said = {key.strip().lower(): value for key, value in metadata.items()}
    for key in KEYS:
        text = said.get(key, "").strip()
        if len(text) <= DAY:
            continue
        try:
            instant = datetime.fromisoformat(text)
        except ValueError:
            continue
        return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()
    return None

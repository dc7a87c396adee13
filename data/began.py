"""When a log began: by its clock where that counts from a date, else by what its metadata say.

What changes with time between logs, a rig that warms up, can only be seen if their order is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

from data.elapsed import EPOCH

KEYS: Final = ("began", "begun", "start", "started", "start_time", "recorded", "date", "datetime", "time")

DAY: Final = len("2004-01-31")


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

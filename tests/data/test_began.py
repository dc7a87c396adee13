"""When a log began: from a clock that counts from a date, else from metadata, else not at all."""

from __future__ import annotations

import pytest

from data.began import began


def test_a_clock_that_counts_from_a_date_is_believed_first() -> None:
    assert began(1.7e9, {"date": "2004-01-31T10:00:00"}) == 1.7e9


@pytest.mark.parametrize("key", ["date", "Started", " recorded "])
def test_metadata_tell_where_the_clock_does_not(key: str) -> None:
    first = began(0.0, {key: "2004-01-31T10:00:00"})
    second = began(0.0, {key: "2004-01-31T11:00:00+00:00"})
    assert first is not None
    assert second is not None
    assert second - first == 3600.0


@pytest.mark.parametrize("metadata", [{}, {"date": "2004-01-31"}, {"time": "noon"}, {"r": "0.9"}])
def test_what_orders_nothing_is_no_date(metadata: dict[str, str]) -> None:
    assert began(12.5, metadata) is None
    assert began(float("nan"), metadata) is None

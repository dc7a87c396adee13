"""Every map gives what Python's own gives, in order, and hands the first exception on."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext

import pytest

from data.findings import LogError
from pipelines.executors.processes import Spread, opened_map
from pipelines.executors.serial import serial_map
from pipelines.executors.threads import opened_threads

Opened = Callable[[], AbstractContextManager[Spread]]
MAPS: dict[str, Opened] = {
    "serial": lambda: nullcontext(serial_map),
    "one process": lambda: opened_map(1),
    "two processes": lambda: opened_map(2),
    "threads": lambda: opened_threads(3),
}


def refused(number: int) -> int:
    if number == 3:
        raise LogError(f"log {number}: not readable")
    return number


@pytest.fixture(params=list(MAPS.values()), ids=list(MAPS))
def spread(request: pytest.FixtureRequest) -> Iterator[Spread]:
    opened: Opened = request.param
    with opened() as found:
        yield found


def test_results_come_in_the_order_of_the_items(spread: Spread) -> None:
    assert list(spread(math.factorial, range(8))) == [math.factorial(n) for n in range(8)]


def test_the_first_exception_is_handed_on(spread: Spread) -> None:
    with pytest.raises(LogError, match="log 3: not readable"):
        list(spread(refused, range(8)))

"""How far long work is: a bar with a time left on stderr where that is a terminal, else nothing at all."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

Item = TypeVar("Item")
Tick = Callable[[int], None]  # so many more steps are done


class Progress(Protocol):
    """Counts steps of named stages."""

    def stage(self, name: str, total: int) -> Tick:
        """Begin a stage of `total` steps; the returned function is told of each that is done."""


def told(progress: Progress, name: str) -> Callable[[str, int, int], None]:
    """A stage for work that says itself what is next, how much is done, and of how much."""
    ticks: list[Tick] = []

    def tell(_what: str, done: int, total: int) -> None:
        if not ticks:
            ticks.append(progress.stage(name, total))
        if done:
            ticks[0](1)

    return tell


class Silent:
    """Shows nothing."""

    def stage(self, name: str, total: int) -> Tick:
        """Begin a stage nobody sees."""
        return lambda _: None


@contextmanager
def shown_progress(*, quiet: bool = False) -> Iterator[Progress]:
    """A progress display for the time of a command."""
    if quiet or not sys.stderr.isatty():
        yield Silent()
        return
    from rich.console import Console  # noqa: PLC0415  (only where there is a terminal to draw on)
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
    from rich.progress import Progress as RichProgress  # noqa: PLC0415

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with RichProgress(*columns, console=Console(stderr=True), transient=True) as bars:

        class Bars:
            """One bar a stage."""

            def stage(self, name: str, total: int) -> Tick:
                task = bars.add_task(name, total=total)
                return lambda steps: bars.advance(task, steps)

        yield Bars()


def counted(items: Iterable[Item], tick: Tick) -> Iterator[Item]:
    """The items, telling of each when it has arrived."""
    for item in items:
        tick(1)
        yield item

"""Progress: nothing on a pipe, and every step counted."""

from __future__ import annotations

import pytest

from pipelines.progress import Silent, Tick, counted, shown_progress, told


class Counting:
    """Remembers its stages."""

    def __init__(self) -> None:
        self.stages: list[tuple[str, int]] = []
        self.steps = 0

    def stage(self, name: str, total: int) -> Tick:
        self.stages.append((name, total))
        return self.add

    def add(self, steps: int) -> None:
        self.steps += steps


def test_no_terminal_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with shown_progress() as progress:
        assert isinstance(progress, Silent)
        progress.stage("reading", 3)(1)
    assert capsys.readouterr() == ("", "")


def test_items_pass_and_are_counted() -> None:
    seen = Counting()
    assert list(counted("abc", seen.stage("letters", 3))) == ["a", "b", "c"]
    assert seen.steps == 3


def test_work_that_tells_by_itself_is_one_stage() -> None:
    seen = Counting()
    tell = told(seen, "recording")
    for done in range(4):
        tell("log", done, 3)
    assert seen.stages == [("recording", 3)]
    assert seen.steps == 3

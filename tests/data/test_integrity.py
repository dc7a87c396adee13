"""What is kept is time less what is lost, and a loss breaks a run wherever it may lie."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from data.integrity import Integrity, Loss

S = 10**9


def lost(*gaps: tuple[int | None, int | None]) -> Integrity:
    losses = tuple(Loss(k, k + 1, "gone", None, *gap) for k, gap in enumerate(gaps))
    return Integrity("failed", losses, chunks=2, messages=100, time_range=(10 * S, 50 * S), promised=120)


def test_what_is_kept_is_told_less_what_is_lost() -> None:
    found = lost((12 * S, 15 * S), (20 * S, 22 * S + S // 5), (None, 10 * S), (50 * S, None))
    assert found.kept == ((10 * S, 12 * S), (15 * S, 20 * S), (22 * S + S // 5, 50 * S))
    assert found.left == (
        "100 of 120 messages in 2 intact chunks, 34.800 of 40.000 s of log time: "
        "10.000 to 12.000, 15.000 to 20.000, 22.200 to 50.000 s"
    )


def test_losses_that_overlap_are_one_gap() -> None:
    found = lost((12 * S, 15 * S), (14 * S, 18 * S), (14 * S, 16 * S), (18 * S, 19 * S))
    assert found.gaps == ((12 * S, 18 * S), (18 * S, 19 * S))


def test_nothing_lost_within_is_told_in_one_stretch() -> None:
    assert lost().left.endswith("40.000 s of log time from 10.000 s")
    assert Integrity("failed", (Loss(0, 9, "gone"),)).left == "nothing"


@pytest.mark.parametrize(
    ("loss", "text"),
    [
        (Loss(3, 9, "why"), "bytes 3 to 9: why"),
        (Loss(3, 3, "why"), "byte 3: why"),
        (Loss(3, 9, "why", (S, 2 * S)), "bytes 3 to 9, log time 1.000 to 2.000 s: why"),
        (Loss(3, 9, "why", None, S, 2 * S), "bytes 3 to 9, between log times 1.000 and 2.000 s: why"),
        (Loss(3, 9, "why", None, S), "bytes 3 to 9, behind log time 1.000 s: why"),
        (Loss(3, 9, "why", None, None, S), "bytes 3 to 9, before log time 1.000 s: why"),
    ],
)
def test_a_loss_says_where_and_when(loss: Loss, text: str) -> None:
    assert loss.text == text


@given(
    st.lists(st.integers(0, 10**6), min_size=2, max_size=50, unique=True).map(sorted),
    st.data(),
)
def test_a_run_breaks_where_something_is_lost(times: list[int], data: st.DataObject) -> None:
    k = data.draw(st.integers(1, len(times) - 1))
    stamps = np.array(times, np.int64) * S
    before, behind = int(stamps[k - 1]), int(stamps[k])
    assert lost((before, behind)).breaks(stamps) == (k,)
    other = np.sort(np.append(stamps, [before - S // 2, behind + S // 2]))  # another topic's messages around
    assert lost((before, behind)).breaks(other) == (k + (np.searchsorted(other, before) != k - 1),)


def test_a_loss_at_either_end_breaks_nothing() -> None:
    stamps = np.arange(10, 51, dtype=np.int64) * S
    assert lost((None, 10 * S), (50 * S, None)).breaks(stamps) == ()


def test_where_the_recorder_wrote_out_of_order_all_places_are_broken() -> None:
    stamps = np.array([0, 100, 200, 300, 400], np.int64) * 10**6
    assert lost((250 * 10**6, 150 * 10**6)).breaks(stamps) == (2, 3)


def test_a_clock_that_began_anew_behind_a_loss_breaks_once() -> None:
    stamps = np.array([100, 101, 102, 5, 6, 7], np.int64) * S
    assert lost((102 * S, 5 * S)).breaks(stamps) == (3,)


def test_a_loss_after_the_clock_began_anew_breaks_there() -> None:
    stamps = np.array([100, 101, 102, 5, 6, 9, 10], np.int64) * S
    assert lost((6 * S, 9 * S)).breaks(stamps) == (5,)

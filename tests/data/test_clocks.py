import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data.clocks import advancing, clock_report, clock_report_ns, drift


def test_rate_jitter_gaps_and_stalls() -> None:
    seconds = np.arange(1000, dtype=np.float64) * 0.01
    seconds[500:] += 1.0
    seconds[700] = seconds[699]
    report = clock_report(seconds, start=5.0)
    assert report.rate == pytest.approx(100.0)
    assert (report.start, report.samples, report.gaps, report.stalls) == (5.0, 1000, 1, 1)
    assert report.longest_gaps[0] == pytest.approx((4.99, 1.01))
    assert report.first_stall == pytest.approx(7.99)
    assert report.jitter < 1e-9


def test_nanoseconds_since_1970_lose_nothing() -> None:
    stamps = 1_700_000_000_000_000_000 + np.arange(100, dtype=np.int64) * 1_000_000
    assert clock_report_ns(stamps).period == pytest.approx(1e-3, rel=1e-12)


def test_none_and_one_stamp() -> None:
    for n in (0, 1):
        report = clock_report_ns(np.arange(n, dtype=np.int64))
        assert (report.samples, report.rate, report.duration) == (n, 0.0, 0.0)


def test_one_stamp_that_was_never_set_does_not_blur_the_others() -> None:
    stamps = 1_700_000_000_000_000_000 + np.arange(100, dtype=np.int64) * 1_000_000
    stamps[0] = 0
    report = clock_report_ns(stamps)
    assert report.rate == 1000.0
    assert report.jitter == 0.0
    assert report.gaps == 1


REGULAR = np.arange(1000, dtype=np.float64) * 1e-3


def test_a_clock_that_advances_is_left_alone() -> None:
    found = advancing(REGULAR, fewest=10)
    assert found.first is None
    assert found.time is REGULAR


@settings(max_examples=200, deadline=None)
@given(back=st.floats(1e-6, 2.0), place=st.integers(20, 980))
def test_a_clock_that_is_set_back_is_split_there(back: float, place: int) -> None:
    time = REGULAR.copy()
    time[place:] -= 1e-3 + back
    found = advancing(time, fewest=10)
    assert found.breaks == (place,)
    assert np.array_equal(found.kept, np.arange(1000))
    assert np.all(np.diff(found.time) > 0)
    assert np.allclose(np.delete(np.diff(found.time), place - 1), 1e-3)


@given(places=st.sets(st.integers(1, 330), max_size=20), stamp=st.sampled_from([0.0, 9.0, None]))
def test_a_wrong_stamp_between_right_ones_costs_its_sample(places: set[int], stamp: float | None) -> None:
    wrong = 3 * np.array(sorted(places), np.intp)
    time = REGULAR.copy()
    time[wrong] = time[wrong - 1] if stamp is None else stamp
    found = advancing(time, fewest=10)
    assert found.breaks == ()
    assert np.array_equal(found.kept, np.delete(np.arange(1000), wrong))
    assert np.array_equal(found.time, REGULAR[found.kept])


@given(places=st.sets(st.integers(0, 89), max_size=30), late=st.integers(1, 8))
def test_late_samples_are_sorted_in(places: set[int], late: int) -> None:
    order = np.arange(1000)
    for place in places:
        first = 10 + 11 * place
        order[first : first + late + 1] = np.roll(order[first : first + late + 1], -1)
    found = advancing(REGULAR[order], fewest=10)
    assert found.late == len(places) or late == 1
    assert np.array_equal(found.time, REGULAR)
    assert np.array_equal(order[found.kept], np.arange(1000))


@settings(deadline=None)
@given(
    st.lists(st.one_of(st.floats(-1e3, 1e3), st.integers(0, 5).map(float)), min_size=1, max_size=60),
    st.integers(1, 12),
)
def test_any_stamps_come_out_advancing(stamps: list[float], fewest: int) -> None:
    found = advancing(np.array(stamps), fewest=fewest)
    assert np.all(np.diff(found.time) > 0) or found.first is None
    assert found.kept.size + found.wrong + found.short == len(stamps)
    edges = np.diff([0, *found.breaks, found.kept.size])
    assert found.first is None or not found.kept.size or edges.min() >= fewest


@settings(max_examples=100, deadline=None)
@given(rate=st.floats(1e-3, 0.2), slower=st.booleans(), seed=st.integers(0, 99))
def test_clocks_that_drift_apart_are_told_and_those_that_jitter_are_not(
    rate: float, slower: bool, seed: int
) -> None:
    rate = -rate if slower else rate
    time = np.arange(20_000, dtype=np.float64) * 1e-3
    late = np.random.default_rng(seed).exponential(5e-4, 20_000)
    assert drift(time, time + late) is None
    assert drift(time, (1.0 + 5e-5) * time + late) is None
    found = drift(time, (1.0 + rate) * time + late)
    assert found is not None
    assert found.rate == pytest.approx(rate, abs=1e-4)
    assert found.total == pytest.approx(20.0 * rate, rel=0.1)

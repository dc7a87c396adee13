import numpy as np
import pytest

from data.clocks import clock_report, clock_report_ns


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

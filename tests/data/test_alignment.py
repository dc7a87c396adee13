import numpy as np

from data.alignment import align

CLOCK = np.arange(10, dtype=np.int64) * 1_000_000


def test_signals_sampled_together_are_paired_message_by_message() -> None:
    values = np.arange(10.0)
    paired = align(CLOCK, CLOCK + 400_000, values)
    assert paired.together
    assert np.array_equal(paired.values, values)


def test_a_slower_signal_holds_until_its_next_message() -> None:
    held = align(CLOCK, np.array([1_500_000, 5_000_000]), np.array([1.0, 2.0]))
    assert not held.together
    assert np.isnan(held.values[:2]).all()
    assert held.values[2:].tolist() == [1.0] * 3 + [2.0] * 5
    assert held.longest_hold == 4e-3

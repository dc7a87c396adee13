import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ident.excitation.direction import direction_of_motion, position_noise, position_step


@given(
    turn=st.floats(0.3, 0.7),
    before=st.floats(1.0, 20.0),
    after=st.floats(1.0, 20.0),
    counts=st.integers(2_000, 200_000),
)
def test_a_turn_is_found_where_the_acceleration_jumps(
    turn: float, before: float, after: float, counts: int
) -> None:
    time = np.arange(0.0, 1.0, 1e-3)
    since = time - turn
    position = -0.5 * np.where(since < 0, before, after) * since**2
    step = 2 * np.pi / counts
    direction, _ = direction_of_motion(np.round(position / step) * step, 1.01 * step)
    found = time[np.flatnonzero(np.diff(direction))]
    assert direction[0] == 1.0
    assert direction[-1] == -1.0
    assert found.size == 1
    # The two sides leave the extreme's count at different times; the turn lies between, near its place.
    doubt = np.sqrt(2 * step / before) + np.sqrt(2 * step / after)
    assert abs(found[0] - turn) <= 0.35 * doubt + 2e-3


def test_a_rest_is_a_long_step_and_slow_motion_a_shorter_one() -> None:
    still, slow, fast = np.zeros(500), 0.01 * np.arange(1, 501), 5.0 + np.arange(1, 201)
    direction, dwell = direction_of_motion(np.concatenate([still, slow, fast]), 1.0)
    assert dwell[250] >= 500
    assert 95 <= dwell[750] <= 105
    assert dwell[1100] <= 2
    assert np.all(direction == 1.0)


def test_a_link_that_never_moves_rests_throughout() -> None:
    _, dwell = direction_of_motion(np.zeros(50), 1.0)
    assert np.all(dwell == 50)


def test_noise_is_told_from_a_smooth_motion() -> None:
    time = np.arange(0.0, 10.0, 1e-3)
    noise = 1e-4 * np.random.default_rng(3).standard_normal(time.size)
    assert abs(position_noise(np.sin(time) + noise) / 1e-4 - 1.0) < 0.05
    assert position_step(np.sin(time), 1e-3) == 1.01e-3

"""Clean logs pass untouched and unremarked; each fault is seen, mended or refused as it deserves."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data.findings import LogError, Severity
from data.protocols import ProtocolName
from data.resolution import lattice_spacing
from data.screening.run import Run
from data.screening.scale import require_count
from data.screening.screen import Screened, screen

COUNT = 2 * math.pi / 2**18


def motion(
    n: int = 4000, *, amplitude: float = 1.0, frequency: float = 2.0, counts: float = COUNT, seed: int = 0
) -> Run:
    """A sinusoidal motion under dry and viscous friction, quantised, with torque noise."""
    time = np.arange(n, dtype=np.float64) * 1e-3
    position = amplitude * np.sin(frequency * time)
    velocity = amplitude * frequency * np.cos(frequency * time)
    torque = 0.4 * np.sign(velocity) + 0.1 * velocity + np.random.default_rng(seed).normal(0, 0.005, n)
    quantised = np.rint(position / counts) * counts if counts else position
    return Run("run", "excitation", time, quantised, torque, velocity, None)


def screened(run: Run, torque_limit: float | None = None, resolution: float | None = COUNT) -> Screened:
    return screen(run, clock="column 't'", resolution=resolution, torque_limit=torque_limit)


@settings(max_examples=150, deadline=None)
@given(
    amplitude=st.floats(1e-5, 20.0),
    frequency=st.floats(0.1, 30.0),
    counts=st.sampled_from([0.0, COUNT, 2 * math.pi / 20_000, 2 * math.pi / 500]),
    seed=st.integers(0, 99),
    known=st.booleans(),
)
def test_clean_runs_raise_nothing_and_stay_as_they_are(
    amplitude: float, frequency: float, counts: float, seed: int, known: bool
) -> None:
    run = motion(2000, amplitude=amplitude, frequency=frequency, counts=counts, seed=seed)
    resolution = counts if known and counts else lattice_spacing(run.position)
    got = screened(run, resolution=resolution)
    assert got.findings == ()
    assert got.signals is run


def test_a_stick_and_a_sudden_breakaway_are_no_fault() -> None:
    time = np.arange(3000, dtype=np.float64) * 1e-3
    slip = np.maximum(time - 1.5, 0.0)
    position = np.rint(4.0 * slip**2 / COUNT) * COUNT
    torque = 0.4 * time
    got = screened(Run("run", "breakaway", time, position, torque, None, None))
    assert got.findings == ()


@pytest.mark.parametrize("protocol", ["constant_velocity", "frequency_response"])
def test_a_clock_that_is_set_back_splits_the_run(protocol: ProtocolName) -> None:
    run = replace(motion(), protocol=protocol)
    time = run.time.copy()
    time[3000:] -= 0.5
    got = screened(replace(run, time=time))
    assert [(f.code, f.severity) for f in got.findings] == [("E-CLOCK", Severity.WARN)]
    assert "jumps back by 0.499 s at sample 3000, t = 2.999" in got.findings[0].text
    whole = protocol == "constant_velocity"
    assert got.signals.breaks == ((3000,) if whole else ())
    assert np.array_equal(got.signals.position, run.position if whole else run.position[:3000])
    assert np.all(np.diff(got.signals.time) > 0.0)


def test_a_clock_that_hardly_runs_is_refused() -> None:
    run = motion()
    for time in (np.zeros(4000), np.floor(run.time * 200.0) / 200.0):
        with pytest.raises(LogError, match=r"run: E-CLOCK refuse.*stands still at sample 1, t = 0"):
            screened(replace(run, time=time))


@pytest.mark.parametrize("signal", ["time", "position", "torque", "velocity"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_none_are_refused(signal: str, value: float) -> None:
    run = motion()
    array = getattr(run, signal).copy()
    array[77] = value
    with pytest.raises(LogError, match=f"run: {signal} is {value} at sample 77.*window"):
        screened(replace(run, **{signal: array}))


def test_short_runs_are_refused() -> None:
    for n in (0, 1, 9):
        with pytest.raises(LogError, match=f"{n} samples"):
            screened(motion().keep(np.arange(4000) < n))


@pytest.mark.parametrize("modulus", [2 * math.pi, COUNT * 2**16])
def test_a_wrap_is_undone_exactly(modulus: float) -> None:
    run = motion(amplitude=8.0)
    wrapped = (run.position + modulus / 2) % modulus - modulus / 2
    got = screened(replace(run, position=wrapped))
    assert [f.code for f in got.findings] == ["E-WRAP"]
    assert np.allclose(got.signals.position, run.position, rtol=0, atol=1e-9)


@pytest.mark.parametrize("wrapped", [False, True])
def test_a_way_over_lost_samples_is_no_wrap_of_as_many_counts(wrapped: bool) -> None:
    count, modulus = 2 * np.pi / 20_000, 512 * 2 * np.pi / 20_000
    time = np.arange(4000, dtype=np.float64) * 1e-3
    position = np.rint(time / count) * count
    keep = (time < 1.5) | (time >= 1.5 + modulus)  # at 1 rad/s, 512 counts of way are lost
    run = replace(
        motion(), time=time[keep], position=position[keep], torque=np.full(keep.sum(), 0.5), velocity=None
    )
    logged = replace(run, position=(run.position + 0.01) % modulus) if wrapped else run
    got = screened(logged, resolution=count)
    assert [f.code for f in got.findings] == (["E-WRAP", "E-GAP"] if wrapped else ["E-GAP"])
    assert np.ptp(got.signals.position) == pytest.approx(np.ptp(run.position), abs=1e-9)


def test_a_turn_that_does_not_fit_its_surroundings_is_refused() -> None:
    run = motion(amplitude=0.5)
    jump = np.where(run.time > 2.0, 2 * math.pi * 1.01, 0.0)
    with pytest.raises(LogError, match=r"E-WRAP refuse.*t = 2 s"):
        screened(replace(run, position=run.position + jump, velocity=None))


def test_spikes_are_dropped_and_counted_and_nothing_else() -> None:
    run = motion()
    wrong = np.array([400, 1700, 3111])
    position = run.position.copy()
    position[wrong] += (0.3, -0.01, 0.002)
    got = screened(replace(run, position=position))
    assert [f.code for f in got.findings] == ["E-SPIKE"]
    assert "3 single positions of 4000" in got.findings[0].text
    assert np.array_equal(got.signals.position, np.delete(run.position, wrong))
    assert np.array_equal(got.signals.torque, np.delete(run.torque, wrong))


def test_a_run_full_of_spikes_is_refused() -> None:
    run = motion()
    position = run.position.copy()
    position[5::60] += 0.5
    with pytest.raises(LogError, match="E-SPIKE refuse"):
        screened(replace(run, position=position))


def test_gaps_and_saturation_are_said() -> None:
    run = motion()
    gap = screened(run.keep((run.time < 1.0) | (run.time > 1.25))).findings
    assert [(f.code, f.severity) for f in gap] == [("E-GAP", Severity.WARN)]
    assert "t = 0.999" in gap[0].text
    clipped = screened(replace(run, torque=np.clip(run.torque, -0.5, 0.5)), torque_limit=0.5).findings
    assert [f.code for f in clipped] == ["E-SAT"]
    unknown = screened(replace(run, torque=np.clip(run.torque, -0.5, 0.5))).findings
    assert [f.code for f in unknown] == ["E-SAT"]


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (180 / math.pi, "velocity is 57.30 times dq/dt: the velocity looks like deg/s"),
        (30 / math.pi, "9.549 times dq/dt: the velocity looks like rpm"),
        (0.5 / math.pi, "0.1592 times dq/dt: the velocity looks like rev/s"),
        (2 * math.pi, "6.283 times dq/dt: the position looks like revolutions"),
        (1000.0, "1000. times dq/dt: the velocity looks like thousandths"),
        (-1.0, "-1.000 times dq/dt: it has the opposite sign"),
    ],
)
def test_a_velocity_in_another_unit_is_refused(factor: float, text: str) -> None:
    run = motion()
    assert run.velocity is not None
    with pytest.raises(LogError) as refused:
        screened(replace(run, velocity=run.velocity * factor))
    assert text in str(refused.value)


def test_a_torque_of_the_wrong_sign_is_refused() -> None:
    run = motion()
    with pytest.raises(LogError, match="E-SIGN refuse"):
        screened(replace(run, torque=-run.torque))


@settings(max_examples=60, deadline=None)
@given(st.floats(1e-7, 1e-1), st.floats(0.3, 3.0), st.integers(0, 10_000))
def test_the_count_is_found_on_a_lattice_and_nowhere_else(count: float, speed: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(speed, 1.0, 3000)) * count
    assert lattice_spacing(np.rint(path / count) * count) == pytest.approx(count, rel=1e-6)
    assert lattice_spacing(path) is None


def test_a_straight_line_has_no_count() -> None:
    assert lattice_spacing(np.arange(5000, dtype=np.float64) * 0.005) is None
    assert lattice_spacing(np.zeros(100)) is None
    lost = np.delete(np.arange(5000, dtype=np.float64), np.arange(40, 4000, 100)) * 0.005
    assert lattice_spacing(lost) is None  # doubled steps of lost samples


@pytest.mark.parametrize("counts", [0.31, 2.6, 35.4, 12_345.6])  # a sample, of an even motion
def test_a_count_is_found_however_fast_an_even_motion_is(counts: float) -> None:
    position = 0.0123 * np.rint(counts * np.arange(500))
    assert lattice_spacing(position) == pytest.approx(0.0123, rel=1e-6)


def test_positions_in_another_unit_than_the_declared_count_are_refused() -> None:
    for factor, text in ((180.0 / math.pi, "57.30.*degrees"), (0.5 / math.pi, "0.1592.*revolutions")):
        with pytest.raises(LogError, match=f"run: E-UNIT refuse.*{text}"):
            require_count(motion(), found=COUNT * factor, declared=COUNT)
    for factor in (0.25, 0.5, 1.0, 2.0, 4.0):  # interpolated, or a quadrature not counted
        require_count(motion(), found=COUNT * factor, declared=COUNT)


def test_a_torque_far_beyond_its_limit_is_refused() -> None:
    run = motion()
    with pytest.raises(LogError, match=r"E-UNIT refuse: the torque reaches.*times the torque limit of 2"):
        screened(replace(run, torque=1000.0 * run.torque), torque_limit=2.0)

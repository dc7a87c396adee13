"""Staircases over three decades are cut where they were made, whatever the encoder."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.segmentation import grain, plateaus, rests, slow_spans, stretches
from tests.ident.rigs import Rig

SPEEDS = np.geomspace(0.02, 2.5, 9)


@pytest.mark.parametrize("counts", [20_000, 2**18, 2**20])
@pytest.mark.parametrize("rest", [0.0, 0.6])
def test_a_staircase_of_both_directions_gives_each_speed_once(counts: int, rest: float) -> None:
    rig = Rig(resolution=2 * math.pi / counts)
    steps = [*SPEEDS, *-SPEEDS]
    recording = rig.speeds(steps, np.random.default_rng(1), duration=3.0, rest=rest, wobble=0.02)
    found = plateaus(recording, stretches(recording))
    assert len(found) == len(steps)
    for piece, speed in zip(found, steps, strict=True):
        assert piece.velocity == pytest.approx(speed, rel=0.05)
        assert piece.duration == pytest.approx(3.0, rel=0.15)


def test_stretches_cover_the_log_without_gaps() -> None:
    recording = Rig().speeds([0.1, 1.0, -0.3], np.random.default_rng(2), rest=0.5)
    chain = stretches(recording)
    assert chain[0].first == 0
    assert chain[-1].last == recording.time.size
    assert all(one.last == other.first for one, other in itertools.pairwise(chain))


def test_rests_of_a_staircase_are_found() -> None:
    recording = Rig().speeds([0.1, 1.0, -0.3], np.random.default_rng(3), rest=0.5)
    found = [rest for rest in rests(recording, stretches(recording)) if rest.first > 0]
    assert len(found) == 3
    assert all(rest.duration == pytest.approx(0.5, abs=0.15) for rest in found)


def test_slow_spans_lie_between_the_motions_of_a_breakaway_log() -> None:
    recording = Rig().ramps([0.2, -0.2, 0.2], np.random.default_rng(4))
    spans = slow_spans(recording, stretches(recording))
    assert len(spans) == 4


def test_the_grain_is_the_count_where_it_is_declared_and_found_where_it_is_not() -> None:
    recording = Rig(resolution=1e-3).speeds([0.2], np.random.default_rng(5))
    assert grain(recording) == pytest.approx(1e-3)
    undeclared = Recording(
        log="x",
        protocol="constant_velocity",
        time=recording.time,
        position=recording.position,
        torque=recording.torque,
    )
    assert grain(undeclared) == pytest.approx(1e-3, rel=1e-6)


def test_the_grain_of_an_unquantised_signal_is_its_noise() -> None:
    generator = np.random.default_rng(6)
    time = np.asarray(1e-3 * np.arange(4000), dtype=np.float64)
    recording = Recording(
        log="x",
        protocol="constant_velocity",
        time=time,
        position=0.1 * time + 1e-4 * generator.standard_normal(time.size),
        torque=np.zeros(time.size),
    )
    assert grain(recording) == pytest.approx(3e-4, rel=0.15)

"""Waves of the torque over position: found where they are, none where there are none, and taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from data.recording import Recording
from ident.evidence.friction_map import steady_runs
from ident.evidence.gathering import gather
from ident.evidence.position_ripple import find_waves
from ident.evidence.traces import Trace, trace
from ident.identification import identify
from tests.ident.rigs import Rig

SPEEDS = np.geomspace(0.01, 2.5, 10)


def _logs(rig: Rig, generator: np.random.Generator) -> list[Recording]:
    """Every run from home, as rigs do it: the slow ones see one phase of the ripple."""
    return [
        rig.speeds([sign * speed], generator, log=f"{sign * speed:.4g}", start=0.07)
        for speed in SPEEDS
        for sign in (1, -1)
    ]


def _ramps(rig: Rig, generator: np.random.Generator) -> list[Recording]:
    return [rig.ramps([sign * 0.1, sign * 0.3], generator, log=f"ramps {sign}") for sign in (1, -1)]


def _traces(logs: list[Recording]) -> list[Trace]:
    found = [trace(log, run, inertia=None) for log in logs for run in steady_runs(log)]
    return [own for own in found if own is not None]


@pytest.mark.parametrize("seed", range(6))
def test_a_rig_without_ripple_gets_none(seed: int) -> None:
    logs = _logs(Rig(torque_noise=0.01), np.random.default_rng(seed))
    assert find_waves(_traces(logs)) == ()


@pytest.mark.parametrize(("amplitude", "cycles"), [(0.004, 7.3), (0.02, 31.0)])
def test_the_wave_is_that_of_the_rig(amplitude: float, cycles: float) -> None:
    rig = Rig(ripple=amplitude, ripple_cycles=cycles, torque_noise=0.005)
    (wave,) = find_waves(_traces(_logs(rig, np.random.default_rng(3))))
    assert wave.coherent
    assert wave.wavenumber == pytest.approx(cycles, abs=5 * wave.wavenumber_stderr + 1e-3 * cycles)
    place = np.linspace(-3.0, 3.0, 200)
    for direction in (1, -1):
        left = wave.torque(place, direction) - amplitude * np.sin(cycles * place)
        assert np.max(np.abs(left)) < 0.15 * amplitude


def test_logs_without_a_common_zero_give_the_size_alone() -> None:
    generator = np.random.default_rng(4)
    rig = Rig(ripple=0.02, ripple_cycles=13.0, torque_noise=0.005)
    logs = [
        replace(log, position=log.position + generator.uniform(-1.0, 1.0)) for log in _logs(rig, generator)
    ]
    (wave,) = find_waves(_traces(logs))
    assert not wave.coherent
    assert wave.amplitude == pytest.approx(0.02, rel=0.1)
    assert wave.mean_variance(np.array([0.3]), 1) == pytest.approx(0.5 * 0.02**2, rel=0.2)


def test_intervals_hold_the_truth_though_all_runs_start_at_one_place() -> None:
    rig, generator = Rig(ripple=0.012, ripple_cycles=12.0, torque_noise=0.004), np.random.default_rng(5)
    found = identify([*_logs(rig, generator), *_ramps(rig, generator)]).robot
    (note,) = [note for note in found.notes if note.code == "E-POSITION"]
    assert "0.524 rad" in note.text
    held = []
    for direction, truth in (
        ("positive", rig.robot.friction.positive),
        ("negative", rig.robot.friction.negative),
    ):
        for name in ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping"):
            low, high = getattr(found, direction)[name].interval95
            held.append(low <= getattr(truth, name) <= high)
    assert sum(held) >= 7


def test_what_is_taken_out_is_taken_out_of_runs_and_breakaways() -> None:
    rig, generator = Rig(ripple=0.012, ripple_cycles=12.0, torque_noise=0.002), np.random.default_rng(6)
    evidence = gather([*_logs(rig, generator), *_ramps(rig, generator)])
    for run in evidence.used_runs:
        curve = rig.robot.friction.positive if run.direction > 0 else rig.robot.friction.negative
        assert run.direction * run.torque == pytest.approx(float(curve.total(abs(run.velocity))), abs=1.5e-3)
    assert all(0 < start.place_stderr < 2e-3 for start in evidence.starts)


def test_gravity_is_one_wave_a_turn_though_few_runs_cover_one() -> None:
    """Most runs are under a turn: the wave is longer than the grid's longest, and snaps to the turn."""
    rig = Rig(ripple=0.05, ripple_cycles=1.0, torque_noise=0.005)
    logs = [
        rig.speeds([sign * speed], np.random.default_rng(12), log=f"{sign * speed:.3g}", start=0.07)
        for speed in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.8)
        for sign in (1, -1)
    ]
    wave = find_waves(_traces(logs), turns=True)[0]
    assert wave.coherent
    assert wave.wavenumber == 1.0
    assert wave.amplitude == pytest.approx(0.05, rel=0.05)

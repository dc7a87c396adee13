"""Closed forms: the equation of a known motion, filtered, gives its parameters back."""

from dataclasses import replace

import numpy as np
import pytest

from data.recording import FloatArray, Recording
from ident.excitation.filtering import Timing, equation
from ident.excitation.inverse_dynamics import FrictionTerms, Law, least_squares, system
from ident.excitation.spans import spans

INERTIA, DAMPING, COULOMB, OFFSET = 0.3, 0.7, 2.0, -0.4
PERIOD = 1e-3


def motion(*, timing: Timing, back: float = 1.0) -> Recording:
    """Two sines and their torque, at the stamp or on average until the next; friction scaled going back."""
    fine = 200
    time = PERIOD / fine * np.arange(8000 * fine, dtype=np.float64)
    speed = 3.0 * np.cos(2 * np.pi * 0.8 * time) + 2.0 * np.cos(2 * np.pi * 1.7 * time + 1.0)
    position = 3.0 * np.sin(2 * np.pi * 0.8 * time) / (2 * np.pi * 0.8)
    position += 2.0 * np.sin(2 * np.pi * 1.7 * time + 1.0) / (2 * np.pi * 1.7)
    acceleration = np.gradient(speed, time)
    friction = np.where(speed > 0, 1.0, back) * (DAMPING * speed + COULOMB * np.sign(speed))
    torque = INERTIA * acceleration + friction + OFFSET
    measured: FloatArray = torque[::fine]
    held: FloatArray = torque.reshape(-1, fine).mean(axis=1)
    return Recording(
        log="sines",
        protocol="excitation",
        time=time[::fine].copy(),
        position=position[::fine].copy(),
        torque=(measured if timing == "measured" else held).copy(),
    )


@pytest.mark.parametrize("timing", ["measured", "held"])
def test_a_known_motion_gives_its_parameters_back(timing: Timing) -> None:
    (span,) = spans(motion(timing=timing))
    one = equation(span, cutoff=20.0, timing=timing)
    assert one is not None
    fit = least_squares(system([one], FrictionTerms("one")))
    assert fit is not None
    assert fit.values == pytest.approx([INERTIA, DAMPING, COULOMB, OFFSET], rel=2e-3, abs=2e-3)
    assert fit.relative_error < 5e-3


def test_each_direction_keeps_its_own_law() -> None:
    recording = motion(timing="measured", back=1.5)
    recording = replace(recording, torque=recording.torque - OFFSET)
    (span,) = spans(recording)
    one = equation(span, cutoff=20.0, timing="measured")
    assert one is not None
    law: Law = "each"
    fit = least_squares(system([one], FrictionTerms(law)))
    assert fit is not None
    truth = [INERTIA, DAMPING, 1.5 * DAMPING, COULOMB, 1.5 * COULOMB]
    assert fit.values == pytest.approx(truth, rel=4e-3, abs=2e-3)


def test_a_gap_is_never_filtered_across_and_saturation_is_left_out() -> None:
    recording = motion(timing="measured")
    time = recording.time.copy()
    time[4000:] += 1.0
    torque = recording.torque.copy()
    torque[2000:2100] = 1e3  # a stretch whose torque is not the one that acted
    spoilt = replace(recording, time=time, torque=torque, torque_limit=1e3)
    pieces = spans(spoilt)
    assert [piece.position.size for piece in pieces] == [4000, 4000]
    equations = [equation(piece, cutoff=20.0, timing="measured") for piece in pieces]
    known = [one for one in equations if one is not None]
    assert 0.0 < known[0].left_out < 0.1
    fit = least_squares(system(known, FrictionTerms("one")))
    assert fit is not None
    assert fit.values == pytest.approx([INERTIA, DAMPING, COULOMB, OFFSET], rel=5e-3, abs=4e-3)


def test_one_direction_alone_is_singular() -> None:
    time = PERIOD * np.arange(4000, dtype=np.float64)
    speed = 2.0 + np.sin(2 * np.pi * time)
    recording = Recording(
        log="one way",
        protocol="excitation",
        time=time,
        position=np.cumsum(speed) * PERIOD,
        torque=INERTIA * np.gradient(speed, PERIOD) + DAMPING * speed + COULOMB,
    )
    (span,) = spans(recording)
    one = equation(span, cutoff=20.0, timing="measured")
    assert one is not None
    assert least_squares(system([one], FrictionTerms("one"))) is None

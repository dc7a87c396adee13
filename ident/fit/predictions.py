"""What a fitted law says of each steady run and each breakaway, and how that changes with its parameters."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from data.recording import FloatArray
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, friction_torque, law_of
from ident.fit.law_model import SIGN
from ident.fit.slopes import slopes


def measured(data: FitData) -> FloatArray:
    """Torques of the runs and then of the breakaways (n + m,) [N m], magnitudes along the motion."""
    return np.concatenate([data.torque, data.start_torque])


def stderr(data: FitData) -> FloatArray:
    """Their standard errors (n + m,) [N m]."""
    return np.concatenate([data.run_stderr, data.start_stderr])


def directions(data: FitData) -> FloatArray:
    """+1 or -1 of each (n + m,)."""
    return np.concatenate([data.run_direction, data.start_direction]).astype(np.float64)


def predicted(data: FitData, values: Mapping[str, float]) -> FloatArray:
    """What the law says of them (n + m,) [N m]."""
    starts = np.zeros(data.start_torque.size)
    speed = np.concatenate([data.speed, starts])
    torque = values["inertia"] * np.concatenate([data.acceleration, starts])
    sign = directions(data)
    for direction in data.model.directions:
        own = sign == SIGN[direction]
        torque[own] += friction_torque(law_of(values, direction), speed[own])
    return np.asarray(torque)


def gradient(data: FitData, fit: FrictionFit) -> FloatArray:
    """Derivatives of the predictions by the free parameters (n + m, p)."""
    return slopes(lambda changed: predicted(data, changed), fit.values, fit.free)

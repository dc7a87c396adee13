"""Data of the joint fit as they might come from a campaign, motion after breakaway included."""

from __future__ import annotations

import numpy as np

from data.recording import FloatArray
from ident.evidence.momentum import NODES, Momentum
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import friction_torque, law_of
from ident.fit.law_model import EACH, SIGN, LawModel

TRUTH = {
    "inertia": 0.026,
    "torque_offset": 0.0,
    "positive_coulomb_torque": 0.4,
    "positive_stribeck_torque": 0.17,
    "positive_stribeck_velocity": 0.07,
    "positive_viscous_damping": 0.08,
    "positive_stribeck_shape": 1.0,
    "negative_coulomb_torque": 0.38,
    "negative_stribeck_torque": 0.13,
    "negative_stribeck_velocity": 0.08,
    "negative_viscous_damping": 0.09,
    "negative_stribeck_shape": 1.0,
}
ONE_LAW = {
    "inertia": 0.026,
    "torque_offset": 0.03,
    "mean_coulomb_torque": 0.4,
    "mean_stribeck_torque": 0.15,
    "mean_stribeck_velocity": 0.075,
    "mean_viscous_damping": 0.08,
    "mean_stribeck_shape": 1.0,
}


def simulated(
    truth: dict[str, float],
    generator: np.random.Generator,
    *,
    model: LawModel = EACH,
    speeds: FloatArray | None = None,
    starts: int = 4,
    ramps: int = 0,
    error: float = 2e-3,
    inertia: bool = False,
) -> FitData:
    """Runs at each speed, breakaways and the motion of ramps in each direction of the model."""
    once = np.geomspace(0.005, 2.0, 14) if speeds is None else speeds
    signs = np.array([SIGN[direction] for direction in model.directions])
    run_direction = np.repeat(signs, once.size)
    speed = np.tile(once, signs.size)
    start_direction = np.repeat(signs, starts)
    motions = [_motion(truth, sign, generator) for sign in signs for _ in range(ramps)]
    return FitData(
        model=model,
        run_direction=run_direction,
        speed=speed,
        torque=_torque(truth, run_direction, speed) + error * generator.standard_normal(speed.size),
        acceleration=np.zeros(speed.size),
        run_stderr=np.full(speed.size, error),
        start_direction=start_direction,
        start_torque=_torque(truth, start_direction, np.zeros(start_direction.size))
        + error * generator.standard_normal(start_direction.size),
        start_stderr=np.full(start_direction.size, error),
        momenta=tuple(motions),
        whitening=tuple(np.diag(1.0 / np.sqrt(motion.impulse_variance)) for motion in motions),
        inertia=(truth["inertia"] * (1 + 1e-3 * generator.standard_normal()), 3e-5) if inertia else None,
    )


def _torque(truth: dict[str, float], sign: np.ndarray, speed: FloatArray) -> FloatArray:
    laws = {1: law_of(truth, "positive"), -1: law_of(truth, "negative")} if len(set(sign)) > 1 else {}
    found = np.zeros(speed.size)
    for one in set(sign.tolist()):
        law = laws.get(one) or law_of(truth, "positive" if one > 0 else "negative")
        found[sign == one] = friction_torque(law, speed[sign == one])
    return found


def _motion(truth: dict[str, float], sign: int, generator: np.random.Generator) -> Momentum:
    """A link that speeds up as the square of time, in five windows."""
    windows, spread = 5, 1e-4
    edges = np.linspace(0.0, 0.5, windows + 1)
    time = np.linspace(edges[:-1], edges[1:], NODES, axis=1)
    nodes = 6.0 * time**2
    duration = np.diff(edges)
    law = law_of(truth, "positive" if sign > 0 else "negative")
    friction = np.array([friction_torque(law, row) for row in nodes])
    gain = nodes[:, -1] - nodes[:, 0]
    impulse = truth["inertia"] * gain + np.trapezoid(friction, axis=1) / (NODES - 1) * duration
    return Momentum(
        log="ramp",
        direction=sign,
        impulse=impulse + spread * generator.standard_normal(windows),
        duration=duration,
        travel=np.trapezoid(nodes, axis=1) / (NODES - 1) * duration,
        gain=gain,
        nodes=nodes,
        places=np.zeros_like(nodes),
        speed_covariance=np.zeros((windows, windows)),
        impulse_variance=np.full(windows, spread**2),
    )

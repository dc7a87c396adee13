"""What the fitted law predicts for each run, beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.evidence.friction_map import MapPoint
from ident.model.friction import StribeckFriction


@dataclass(frozen=True)
class Residual:
    """One used point of the friction map against the law. Torques are signed [N m]."""

    log: str
    velocity: float  # [rad/s]
    measured: float
    predicted: float
    standardised: float  # (measured - predicted) / standard error [-]


def residual_table(points: Sequence[MapPoint], friction: StribeckFriction) -> tuple[Residual, ...]:
    """Every used point with a standard error, in the order of the map."""
    table = []
    for point in points:
        if not point.used or not point.stderr:
            continue
        curve = friction.positive if point.direction > 0 else friction.negative
        predicted = point.direction * float(curve.total(np.abs(point.velocity)))
        table.append(
            Residual(
                log=point.log,
                velocity=point.velocity,
                measured=point.torque,
                predicted=predicted,
                standardised=(point.torque - predicted) / point.stderr,
            )
        )
    return tuple(table)


def reduced_chi_square(table: Sequence[Residual], parameters: int) -> float:
    """Sum of squared standardised residuals over the data to spare; about 1 if the law fits."""
    spare = len(table) - parameters
    return sum(row.standardised**2 for row in table) / spare if spare > 0 else float("nan")

"""The friction map as the fit saw it: every steady run and breakaway, used or not."""

from __future__ import annotations

import numpy as np

from ident.evidence.friction_map import MapPoint
from ident.evidence.gathering import Evidence
from ident.fit.weighting import Weighted, onset_torque


def friction_map(evidence: Evidence, weighted: Weighted) -> tuple[MapPoint, ...]:
    """Every steady run and then every breakaway as a point, used or not, in the order of the logs."""
    points = []
    data, used = weighted.data, iter(range(weighted.data.torque.size))
    offset = weighted.fit.values["torque_offset"]
    sway = np.broadcast_to(data.sway, data.torque.shape)
    inertia = weighted.fit.values["inertia"] if data.has_inertia else 0.0
    for run in evidence.runs:
        number = next(used) if run.why is None else None
        torque = run.torque - inertia * run.acceleration
        points.append(
            MapPoint(
                log=run.log,
                protocol="constant_velocity",
                direction=run.direction,
                velocity=run.velocity,
                torque=torque,
                fitted=None if number is None else torque - offset - run.direction * float(sway[number]),
                stderr=None if number is None else float(data.run_stderr[number]),
                velocity_stderr=run.velocity_stderr,
                ramp_rate=None,
                start_time=run.start_time,
                end_time=run.end_time,
                used=run.why is None,
                why=run.why,
            )
        )
    used, onset = iter(range(data.start_torque.size)), onset_torque(evidence.used_starts, weighted.fit)[0]
    for start in evidence.starts:
        number = next(used) if start.why is None else None
        fitted = None if number is None else start.direction * float(data.start_torque[number]) - offset
        points.append(
            MapPoint(
                log=start.log,
                protocol="breakaway",
                direction=start.direction,
                velocity=0.0,
                torque=start.torque if number is None else start.direction * float(onset[number]),
                fitted=fitted,
                stderr=None if number is None else float(data.start_stderr[number]),
                velocity_stderr=None,
                ramp_rate=start.line.rate,
                start_time=start.line.start_time,
                end_time=start.onset_time,
                used=start.why is None,
                why=start.why,
            )
        )
    return tuple(points)

"""A whole campaign of the virtual rig as recordings in memory, with no log between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from data.instruments import Encoder, TorqueChannel
from data.protocols import ProtocolName
from data.recording import Recording
from ident.response import TorqueRipple, plant_array
from pipelines.settings.virtual_rig import VirtualRig
from pipelines.virtual.bench import Bench
from pipelines.virtual.protocols import breakaways, constant_speeds, multisines

PLAYED: Final[tuple[ProtocolName, ...]] = ("breakaway", "constant_velocity", "frequency_response")
DRIVE_COUNTS: Final = 2**20  # of the sensor that the speed loop closes over: the drive's own, not the logged


def played(
    rig: VirtualRig, *, counts: float, seed: int, ripple: TorqueRipple | None = None
) -> Iterator[Recording]:
    """Every log of the identifying protocols; positions are logged with so many `counts` a revolution."""
    resolution = 2.0 * math.pi / counts
    encoder, channel = Encoder(resolution), TorqueChannel(noise=rig.torque_noise or 0.0)
    bench = Bench(
        plant=plant_array(rig.true_robot(), ripple or TorqueRipple()),
        period=rig.sample_period,
        resolution=2.0 * math.pi / DRIVE_COUNTS,
        torque_limit=math.inf,
    )
    plays = dict(zip(PLAYED, (breakaways, constant_speeds, multisines), strict=True))
    generator = np.random.default_rng(seed)
    for protocol, play in plays.items():
        for run in play(rig, bench):
            motion = run.play(generator)
            yield Recording(
                log=f"{protocol}/{run.label}",
                protocol=protocol,
                time=rig.sample_period * np.arange(motion.position.size, dtype=np.float64),
                position=encoder.measure(motion.position),
                torque=channel.measure(motion.torque, generator),
                resolution=resolution,
                simulated=True,
            )

"""Mean errors of the estimates over campaigns with coarse encoders and noisy torque channels.

Table 1's robot plays breakaways, constant speeds and multisines; the logs hold what encoders of 2,000, 10,000
and 65,536 counts and torque channels with 0.005 to 0.02 N m of noise make of them. A bias is a mean over
seeds: errors that change sign average out, those of the method do not.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from multiprocessing import get_context
from typing import Final

import numpy as np

from benchmarks.calibration.virtual_campaign import played
from benchmarks.rows import Row, figure
from ident.identification import identify
from ident.response import TorqueRipple
from pipelines.settings.virtual_rig import VirtualRig

COUNTS: Final = (2_000, 10_000, 65_536)
NOISES: Final = (0.005, 0.01, 0.02)  # N m
SEEDS: Final = 4
TARGETS: Final = {
    "inertia": 0.01,
    "static_torque": 0.01,
    "coulomb_torque": 0.01,
    "viscous_damping": 0.01,
    "stribeck_velocity": 0.05,
}
RIPPLE: Final = TorqueRipple(amplitude=0.002, harmonic=12.0)


def rows(quick: bool) -> list[Row]:
    """The largest mean error of each parameter, and what was withheld, for every encoder and noise."""
    cases = list(itertools.product(COUNTS[1:] if quick else COUNTS, NOISES[1:2] if quick else NOISES))
    seeds = 1 if quick else SEEDS
    asked = [(counts, noise, seed) for counts, noise in cases for seed in range(seeds)]
    with get_context("spawn").Pool() as pool:
        answers = pool.starmap(_errors, asked)
    found = []
    for counts, noise in cases:
        own = [answer for (c, n, _), answer in zip(asked, answers, strict=True) if (c, n) == (counts, noise)]
        for name, target in TARGETS.items():
            keys = [key for key in own[0] if key.endswith(name)]
            known = {key: [one[key] for one in own if one[key] is not None] for key in keys}
            means = [abs(float(np.mean(values))) for values in known.values() if values]  # type: ignore[arg-type]
            row = figure(
                f"bias {name}, {counts} counts, {noise:g} N m",
                max(means, default=float("nan")),
                target,
                "relative",
            )
            withheld = sum(len(own) - len(values) for values in known.values())
            found.append(row | {"withheld": withheld, "n": len(own) * len(keys)})
    return found


def _errors(counts: int, noise: float, seed: int) -> Mapping[str, float | None]:
    """Relative errors by 'inertia', 'positive.static_torque', ...; None where withheld."""
    rig = VirtualRig(torque_noise=noise)
    truth = rig.true_robot()
    found = identify(list(played(rig, counts=counts, seed=seed, ripple=RIPPLE))).robot
    errors = {"inertia": _error(found.inertia.value, truth.inertia)}
    for direction, curve in (("positive", truth.friction.positive), ("negative", truth.friction.negative)):
        estimates = found.positive if direction == "positive" else found.negative
        for name in TARGETS:
            if name != "inertia":
                errors[f"{direction}.{name}"] = _error(estimates[name].value, getattr(curve, name))
    return errors


def _error(value: float | None, true: float) -> float | None:
    return None if value is None else value / true - 1.0

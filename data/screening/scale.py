"""E-UNIT: sizes that no rig has, and quantities that contradict each other by the factor of a unit."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from data.findings import LogError
from data.screening.run import Run

# Largest torque [N m] or position [rad] of a log, below and above which its scale is wrong.
SMALLEST: Final = 1e-12
LARGEST: Final = 1e12
FEWEST_COUNTS: Final = 10  # of a piece of motion over which a velocity is held against the position
FEWEST_PIECES: Final = 5
FAR_BEYOND: Final = 3.0  # times the torque limit
_LOOKS_LIKE: Final = (
    (180.0 / math.pi, "the velocity looks like deg/s"),
    (30.0 / math.pi, "the velocity looks like rpm"),
    (0.5 / math.pi, "the velocity looks like rev/s"),
    (1000.0, "the velocity looks like thousandths (mrad/s or mm/s)"),
    (math.pi / 180.0, "the position looks like degrees"),
    (2.0 * math.pi, "the position looks like revolutions"),
    (1e-3, "the position looks like thousandths (mrad or mm)"),
    (6.0, "the position looks like degrees and the velocity like rpm, or the other way round"),
)
_COUNT_LOOKS_LIKE: Final = (
    (180.0 / math.pi, "it looks like degrees"),
    (0.5 / math.pi, "it looks like revolutions"),
    (1000.0, "it looks like thousandths (mrad or mm)"),
    (1e-3, "it looks like thousands"),
)


def require_sizes(run: Run) -> None:
    """Refuse a torque or position of a size that no rig has: a wrong scale."""
    for name, values in (("torque", run.torque), ("position", run.position)):
        peak = float(np.max(np.abs(values), initial=0.0))
        if not (peak == 0.0 or SMALLEST <= peak <= LARGEST):
            raise LogError(
                f"{run.log}: the {name} reaches {peak:g} in SI, which no rig does (from {SMALLEST:g} to "
                f"{LARGEST:g}): nothing can be fitted to it. Correct its `unit`, `scale` or `offset` in "
                "campaign.toml"
            )


def require_count(run: Run, *, found: float, declared: float) -> None:
    """E-UNIT: refuse positions whose smallest step is the declared count [rad] in another unit."""
    factor = found / declared
    looks = next((text for size, text in _COUNT_LOOKS_LIKE if abs(factor / size - 1.0) < 0.01), None)
    if looks is None:
        return
    raise LogError(
        f"{run.log}: E-UNIT refuse: the position moves in steps of {found:.6g}, {factor:#.4g} times the "
        f"count of {declared:.6g} that `encoder_counts` declares: {looks}; the inertia, b and v_s would be "
        "off by such a factor. Correct `unit` of the position in [signals], or `encoder_counts`"
    )


def require_velocity_unit(run: Run, resolution: float | None) -> None:
    """E-UNIT: refuse a logged velocity that is not the position's slope."""
    if run.velocity is None:
        return
    step = np.diff(run.time)
    way = np.cumsum(0.5 * (run.velocity[1:] + run.velocity[:-1]) * step)
    pieces = min(200.0, step.size / 5.0)
    if resolution:
        pieces = min(pieces, float(np.sum(np.abs(np.diff(run.position)))) / (FEWEST_COUNTS * resolution))
    if pieces < FEWEST_PIECES:
        return
    marks = np.unique(np.linspace(0, step.size - 1, int(pieces)).astype(int))
    logged = np.diff(way[marks])
    measured = np.diff(run.position[1:][marks])
    moved = float(np.sum(measured**2))
    if math.sqrt(moved) < 20.0 * (resolution or 0.0) + 1e-12 or float(np.sum(logged**2)) == 0.0:
        return
    factor = float(np.sum(logged * measured)) / moved
    likeness = factor * math.sqrt(moved / float(np.sum(logged**2)))  # the correlation through the origin
    if 0.8 < factor < 1.25 or abs(likeness) < 0.8:
        return
    looks = next((text for size, text in _LOOKS_LIKE if abs(abs(factor) / size - 1.0) < 0.05), "")
    if factor < 0.0:
        looks = "it has the opposite sign" + (f", and {looks}" if looks else "")
    if not looks and 0.5 < factor < 2.0:
        return  # a filtered or lagging velocity; it is never used over the position
    raise LogError(
        f"{run.log}: E-UNIT refuse: velocity is {factor:#.4g} times dq/dt"
        + (f": {looks}" if looks else "")
        + "; every friction parameter would be off by such a factor. Correct `unit`, `scale` or `sign` of "
        "position or velocity in [signals], or drop the velocity signal"
    )


def require_torque_size(run: Run, torque_limit: float | None) -> None:
    """E-UNIT: refuse a torque that is far beyond what the actuator can give."""
    if torque_limit is None:
        return
    size = float(np.percentile(np.abs(run.torque), 99.0))
    if size <= FAR_BEYOND * torque_limit:
        return
    raise LogError(
        f"{run.log}: E-UNIT refuse: the torque reaches {size:.4g}, {size / torque_limit:.4g} times the "
        f"torque limit of {torque_limit:g} that [rig] declares: it looks like mN m, or a current without its "
        "torque constant; every torque and the inertia would be off by such a factor. Correct `unit` or "
        "`scale` of the torque in [signals], or the limit"
    )

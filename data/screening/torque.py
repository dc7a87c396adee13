"""E-SAT and E-SIGN: a torque at its limit, and one that takes work out of the link."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from data.findings import Finding, LogError
from data.screening.run import Run, warning

AT_LIMIT: Final = 0.999  # of a declared torque limit
FLAT_SAMPLES: Final = 5  # at the largest torque
# Least and most of a torque's range that noise may cover, and how many are tried.
BANDS: Final = (0.005, 0.2, 12)
FLAT_SHARE: Final = 0.03  # of a run; a tenth of it where exactly one number comes back
LEVELS: Final = 10  # other sizes that a torque takes, or it is a square wave
PILED_UP: Final = 4.0  # times as often at the largest torque as right below it
SIGN_BLOCKS: Final = 8  # of a run, by whose scatter its mean work is judged


def saturation(run: Run, limit: float | None, *, declared: bool) -> tuple[Finding, ...]:
    """E-SAT: torque at its limit [N m], as declared or as `flat_top` found it."""
    if limit is None:
        return ()
    size = np.abs(run.torque)
    at_limit = size >= AT_LIMIT * limit if declared else size >= (1.0 - 1e-12) * limit
    if not at_limit.any():
        return ()
    what = f"at the limit of {limit:g}" if declared else f"flat at its top, about {limit:.6g}"
    k = int(np.argmax(at_limit))
    text = (
        f"the torque is {what} in {np.count_nonzero(at_limit)} of {size.size} samples, first at "
        f"t = {run.time[k]:.6g} s; a saturated torque is not the one commanded"
        + (", and a breakaway there is only a lower bound of F_s" if run.protocol == "breakaway" else "")
        + ". Those samples are not to be used"
    )
    return (warning("E-SAT", text, run),)


def flat_top(run: Run) -> float | None:
    """The torque [N m] at which an actuator without a declared limit saturates; None where it does not.

    A torque that is cut off piles up at its largest size: at exactly one number where the log is cut off, in
    a band as wide as the noise where the actuator is. It gets there gradually; a square wave jumps. The top
    of a smooth wave is at most 2.4 times as wide as what lies right below it, and noise is rarest at its
    largest. A constant speed is meant to show a plateau, and a loop at rest to hold its torque: there only a
    number that comes back again and again tells, or nothing.
    """
    size = np.abs(run.torque)
    top, reach = float(size.max()), float(np.ptp(size))
    if run.protocol == "set_point" or top == 0.0:
        return None
    others = size[size < top]
    levels = np.unique(others).size
    fine = levels > 0.5 * others.size
    steady = run.protocol == "constant_velocity"
    if levels < LEVELS or (steady and not fine):
        return None
    bands = [] if steady else list(np.geomspace(*BANDS) * reach)
    for width in [0.0] * fine + bands:
        flat = size >= top - width
        often = int(np.count_nonzero(flat))
        below = int(np.count_nonzero(size >= top - 2.0 * width)) - often
        begins = np.flatnonzero(np.diff(flat.astype(np.int8)) == 1)
        share = FLAT_SHARE if width else FLAT_SHARE / 10.0
        if often < max(FLAT_SAMPLES, share * size.size, PILED_UP * below):
            continue
        if begins.size < (FLAT_SAMPLES if steady else 1):
            continue
        if float(np.median(top - size[begins])) <= 0.1 * reach + width:
            return float(np.median(size[flat]))
    return None


def require_torque_sign(run: Run, resolution: float | None) -> None:
    """E-SIGN: refuse a torque that takes work out of the link over the whole run, which friction forbids.

    What inertia takes it gives back; where it is large, and the link moves one way, the mean work tells.
    """
    way = np.diff(run.position)
    far = float(np.sum(np.abs(way)))
    if far < 200.0 * (resolution or 0.0) + 1e-12:
        return
    power = run.torque[:-1] * way  # a sample is held until the next: a loop that chatters shows it
    size = float(np.sum(np.abs(power)))
    share = float(np.sum(power)) / size if size > 0.0 else 0.0
    blocks = np.array([piece.sum() for piece in np.array_split(power, SIGN_BLOCKS)])
    scatter = float(np.std(blocks)) / math.sqrt(SIGN_BLOCKS)
    one_way = abs(float(np.sum(way))) > 0.9 * far
    if share > -0.6 and not (one_way and share < -0.05 and float(blocks.mean()) < -5.0 * scatter):
        return
    raise LogError(
        f"{run.log}: E-SIGN refuse: the torque opposes the motion (its work over the run is negative, "
        f"{100 * share:.0f} % of its size), as if friction drove the link; every friction torque would "
        "change sign. Set `sign = -1` on torque or position in [signals]"
    )

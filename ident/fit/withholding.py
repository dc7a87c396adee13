"""Which parameters the data do not identify, why, and which runs would.

A number that looks certain and is wrong breaks a rig. A parameter at its bound, a Stribeck velocity without
speeds around it, a Stribeck effect that may be none: each is withheld with a sentence, and the rest stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from data.findings import Finding, Severity
from data.recording import FloatArray
from ident.evidence.gathering import IdentificationError
from ident.fit.confidence import Interval
from ident.fit.friction_fit import SIGN, Direction, FitData, FrictionFit

LEAST_SPEEDS = 3  # under v_s, and over 3 v_s
LOOSE = 0.5  # relative half-width of an interval beyond which sparse speeds are believed no longer
AT_BOUND = 1e-3  # part of the parameter's own error
SPARE = 3  # least number of data beyond the free parameters


_LINE = "; F_c and b are those of a line, F_s that of the breakaways"


@dataclass(frozen=True)
class Withheld:
    """Reasons by parameter of CURVE_PARAMETERS, and the findings that say so."""

    reasons: Mapping[str, str]
    findings: tuple[Finding, ...]


def require_enough(data: FitData, direction: Direction, *, parameters: int) -> None:
    """Raise `IdentificationError` (E-FEW) where a direction has under three data more than parameters."""
    runs = int(np.count_nonzero(data.run_direction == SIGN[direction]))
    starts = int(np.count_nonzero(data.start_direction == SIGN[direction]))
    if runs + starts - parameters >= SPARE:
        return
    raise IdentificationError(
        f"E-FEW: {direction} direction: {runs} constant-velocity run(s) and {starts} breakaway(s) for "
        f"{parameters} "
        f"parameters; {parameters + SPARE} are the least, or the law fits anything and its errors mean "
        "nothing. "
        f"Record {parameters + SPARE - runs - starts} more speeds with {direction} velocity."
    )


def withheld(
    data: FitData,
    fit: FrictionFit,
    direction: Direction,
    *,
    stderr: Mapping[str, float],
    interval: Mapping[str, Interval],
) -> Withheld:
    """What is withheld of one direction. stderr and interval by parameter name; 'stribeck_torque' is dF."""
    coulomb, stribeck, velocity, damping, _ = fit.law(direction)
    reasons: dict[str, str] = {}
    codes: dict[str, str] = {}
    speeds = _distinct(data.speed[data.run_direction == SIGN[direction]])
    # Noise that makes v_s look long must not put runs under it: only those under its whole interval count.
    surely = interval.get("stribeck_velocity", Interval(None, None)).low or 0.0
    low, high = int(np.sum(speeds < surely)), int(np.sum(speeds > 3 * velocity))
    moved = any(motion.direction == SIGN[direction] for motion in data.momenta)

    def withhold(code: str, names: tuple[str, ...], text: str) -> None:
        for name in names:
            reasons.setdefault(name, f"{code}: {text}")
        codes.setdefault(code, text)

    least = interval["stribeck_torque"].low
    line = direction in data.lines
    if line or least is None or least <= 0.0 or stribeck <= 0.0:
        withhold(
            "E-NOSTRIBECK",
            ("stribeck_velocity", "stribeck_shape"),
            f"{direction} direction: F_s - F_c = {stribeck:.3g} with an interval that holds 0: no Stribeck "
            f"effect is seen, so its velocity has no meaning{_LINE if line else ''}. "
            f"Record speeds below {0.2 * float(speeds.min()):.2g} and breakaways if one is expected.",
        )
    sparse = not line and (low < LEAST_SPEEDS or high < LEAST_SPEEDS)
    unseen = low < LEAST_SPEEDS and not moved  # the bend itself: its shape would be taken on trust
    if sparse and (unseen or _loose(velocity, interval["stribeck_velocity"])):
        where = f"under {surely or velocity:.3g}" if low < LEAST_SPEEDS else f"over {3 * velocity:.3g}"
        text = (
            f"{direction} direction: {low} speed(s) surely under v_s and {high} over 3 v_s; the curve's bend "
            f"is not in the data. Run at least {LEAST_SPEEDS} speeds {where}."
        )
        withhold("E-LOWSPEED", ("stribeck_velocity", "stribeck_shape"), text)
        if low < LEAST_SPEEDS and not np.any(data.start_direction == SIGN[direction]):
            withhold("E-LOWSPEED", ("static_torque",), text)
    begun = np.any(data.start_direction == SIGN[direction])
    if not begun and not line and _loose(coulomb + stribeck, interval["static_torque"]):
        withhold(
            "E-LOWSPEED",
            ("static_torque",),
            f"{direction} direction: without breakaways F_s is the law at rest, and the slowest speed, "
            f"{float(speeds.min()):.3g}, is too far from it. Ramp the torque from rest, or run slower.",
        )
    for name, value in (("coulomb_torque", coulomb), ("viscous_damping", damping)):
        if not value > AT_BOUND * stderr[name]:
            withhold(
                "E-BOUND",
                (name,),
                f"{direction} direction: {name} ended at its bound 0: the data would have it negative. "
                "Record more "
                "and faster speeds, and look for drift.",
            )
    for name in (*stderr, "static_torque"):
        if not np.isfinite(stderr.get(name, 0.0)):
            withhold(
                "E-BOUND",
                (name,),
                f"{direction} direction: {name} has no finite error: it is not in the data.",
            )
    findings = tuple(Finding(code, Severity.WITHHOLD, text) for code, text in codes.items())
    return Withheld(reasons, findings)


def _loose(value: float, interval: Interval) -> bool:
    if interval.low is None or interval.high is None:
        return True
    return interval.high - interval.low > 2 * LOOSE * value


def _distinct(speeds: FloatArray) -> FloatArray:
    """Speeds that differ by over 5 %."""
    ordered = np.sort(speeds)
    kept = [ordered[0]]
    for speed in ordered[1:]:
        if speed > 1.05 * kept[-1]:
            kept.append(speed)
    return np.array(kept)

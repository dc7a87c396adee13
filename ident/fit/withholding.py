"""Which parameters the data do not identify, why, and which runs would.

A number that looks certain and is wrong breaks a rig. A parameter at its bound, a Stribeck velocity without
speeds around it, a Stribeck effect that may be none: each is withheld with a sentence, and the rest stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, Severity
from data.recording import FloatArray
from ident.evidence.gathering import Evidence, IdentificationError
from ident.fit.confidence import Interval
from ident.fit.fit_data import LARGEST_SHAPE, LEAST_SHAPE, FitData
from ident.fit.friction_fit import FrictionFit
from ident.fit.law_model import BLOCK, LawModel, LawName

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


def require_enough(evidence: Evidence, model: LawModel) -> None:
    """Raise `IdentificationError` (E-FEW) where a law has under three data more than parameters."""
    for law in model.laws:
        runs, starts, parameters = counted(evidence, model, law)
        if runs + starts - parameters >= SPARE:
            continue
        more = parameters + SPARE - runs - starts
        way = "in both directions" if law == "mean" else f"with {law} velocity"
        raise IdentificationError(
            f"E-FEW: {where(law)}: {runs} constant-velocity run(s) and {starts} breakaway(s) for "
            f"{parameters} parameters; {parameters + SPARE} are the least, or the law fits anything and its "
            f"errors mean nothing. Record {more} more speeds {way}."
        )


def counted(evidence: Evidence, model: LawModel, law: LawName) -> tuple[int, int, int]:
    """How many steady runs, breakaways and parameters a law has, taken for a curve."""
    signs = model.signs(law)
    runs = sum(run.direction in signs for run in evidence.used_runs)
    starts = sum(start.direction in signs for start in evidence.used_starts)
    return runs, starts, len(BLOCK) - int(law not in model.free_shape) + int(model.has_offset)


def where(law: LawName) -> str:
    """How a finding calls the directions that a law holds in."""
    return "both directions" if law == "mean" else f"{law} direction"


def withheld(
    data: FitData,
    fit: FrictionFit,
    law: LawName,
    *,
    stderr: Mapping[str, float],
    interval: Mapping[str, Interval],
) -> Withheld:
    """What is withheld of one law. stderr and interval by parameter name; 'stribeck_torque' is dF."""
    coulomb, stribeck, velocity, damping, shape = (fit.values[f"{law}_{name}"] for name in BLOCK)
    reasons: dict[str, str] = {}
    codes: dict[str, str] = {}
    speeds = _distinct(data.speed[_of(data, law, data.run_direction)])
    # Noise that makes v_s look long must not put runs under it: only those under its whole interval count.
    surely = interval["stribeck_velocity"].low or 0.0 if "stribeck_velocity" in interval else 0.0
    low, high = int(np.sum(speeds < surely)), int(np.sum(speeds > 3 * velocity))
    moved = any(_of(data, law, np.array([motion.direction for motion in data.momenta], dtype=np.int64)))

    def withhold(code: str, names: tuple[str, ...], text: str) -> None:
        for name in names:
            reasons.setdefault(name, f"{code}: {text}")
        codes.setdefault(code, text)

    least = interval["stribeck_torque"].low
    line = law in data.model.lines
    if line or least is None or least <= 0.0 or stribeck <= 0.0:
        # A value far above every torque is one that the data do not hold.
        seen = f", {stribeck:.3g}," if stribeck < float(np.max(np.abs(data.torque))) else ""
        withhold(
            "E-NOSTRIBECK",
            ("stribeck_velocity", "stribeck_shape"),
            f"{where(law)}: the interval of F_s - F_c{seen} holds 0: no Stribeck "
            f"effect is seen, so its velocity has no meaning{_LINE if line else ''}. "
            f"Record speeds below {0.2 * float(speeds.min()):.2g} and breakaways if one is expected.",
        )
    sparse = not line and (low < LEAST_SPEEDS or high < LEAST_SPEEDS)
    unseen = low < LEAST_SPEEDS and not moved  # the bend itself: its shape would be taken on trust
    if sparse and (unseen or _loose(velocity, interval["stribeck_velocity"])):
        missing = f"under {surely or velocity:.3g}" if low < LEAST_SPEEDS else f"over {3 * velocity:.3g}"
        text = (
            f"{where(law)}: {low} speed(s) surely under v_s and {high} over 3 v_s; the curve's bend is "
            f"not in the data. Run at least {LEAST_SPEEDS} speeds {missing}."
        )
        withhold("E-LOWSPEED", ("stribeck_velocity", "stribeck_shape"), text)
        if low < LEAST_SPEEDS and not np.any(_of(data, law, data.start_direction)):
            withhold("E-LOWSPEED", ("static_torque",), text)
    begun = np.any(_of(data, law, data.start_direction))
    if not begun and (line or _loose(coulomb + stribeck, interval["static_torque"])):
        withhold(
            "E-LOWSPEED",
            ("static_torque",),
            f"{where(law)}: without breakaways F_s is the law at rest, and the slowest speed, "
            f"{float(speeds.min()):.3g}, is too far from it. Ramp the torque from rest, or run slower.",
        )
    for name, value in (("coulomb_torque", coulomb), ("viscous_damping", damping)):
        if not value > AT_BOUND * stderr[name]:
            withhold(
                "E-BOUND",
                (name,),
                f"{where(law)}: {name} ended at its bound 0: the data would have it negative"
                f"{_at_most(interval[name])}. Record more and faster speeds, and look for drift.",
            )
    if law in data.model.free_shape and not line and not LEAST_SHAPE < shape < LARGEST_SHAPE:
        withhold(
            "E-BOUND",
            ("stribeck_shape", "stribeck_velocity"),
            f"{where(law)}: beta ended at {shape:g}, the end of what is searched: the data do not hold the "
            "shape of the curve, and v_s goes with it. Fix beta, or record more speeds around v_s.",
        )
    for name in (*stderr, "static_torque"):
        if not np.isfinite(stderr.get(name, 0.0)):
            withhold(
                "E-BOUND",
                (name,),
                f"{where(law)}: {name} has no finite error: it is not in the data.",
            )
    findings = tuple(Finding(code, Severity.WITHHOLD, text) for code, text in codes.items())
    return Withheld(reasons, findings)


def _of(data: FitData, law: LawName, sign: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the data in directions `sign` (n,) a law holds for."""
    return np.isin(sign, data.model.signs(law))


def _at_most(interval: Interval) -> str:
    return "" if interval.high is None else f" (it is under {interval.high:.3g}, at 95 %)"


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

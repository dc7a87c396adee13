"""Intervals where no Stribeck effect is seen, which does not say that there is none.

A line's own intervals of F_c and b are those of a law without effect. Where a weak one was missed they are
off centre: with speeds from 1.4 to 28 v_s and an effect of 7 to 15 times the spread between runs, they hold
the truth in 53 to 90 % of the cases that were taken for lines. So the intervals given are those of the curve,
over every effect that the data do not exclude, the line among them; they cover whatever the effect is. One
that fades more slowly than the runs can show (v_s over a third of the fastest speed, beyond which no speeds
over 3 v_s are left) is damping to them, and is not among these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ident.fit.confidence import Interval
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import fit_friction
from ident.fit.profiles import Combination, Profile, profiles

FADED = 1.0 / 3.0  # of the fastest speed: the longest v_s that the runs can show
HARMED = ("coulomb_torque", "viscous_damping")


def with_unseen_effect(
    data: FitData,
    found: Mapping[str, Profile],
    wanted: Mapping[str, Combination],
    *,
    height: Callable[[Combination], float],
) -> dict[str, Profile]:
    """The profiles of a fit, those of F_c and b wherever a law is a line widened by what it may hide."""
    lines = data.model.lines
    laws = {*lines, *(("mean",) if lines else ())}
    harmed = {f"{law}.{name}" for law in laws for name in HARMED} & set(found)
    if not harmed:
        return dict(found)
    bent = replace(data, model=replace(data.model, lines=()), longest=FADED)
    asked = {name: wanted[name] for name in harmed}
    _, curved = profiles(bent, fit_friction(bent), asked, height=height)
    return {
        name: replace(curved[name], interval=_hull(profile.interval, curved[name].interval))
        if name in harmed
        else profile
        for name, profile in found.items()
    }


def _hull(one: Interval, other: Interval) -> Interval:
    low = None if one.low is None or other.low is None else min(one.low, other.low)
    high = None if one.high is None or other.high is None else max(one.high, other.high)
    return Interval(low, high)

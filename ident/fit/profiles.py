r"""Profile likelihood: the least chi-square with one parameter held, for every parameter of the law.

The profile of a parameter, or of a combination c . parameters such as F_s = F_c + dF or the mean of two
directions, is the least chi^2 under c . parameters = value, all others refitted within their bounds. Its
interval ends where it has risen by t^2 (Bates and Watts 1988, ch. 6). Where it never rises so far, up to the
end of what is searched, the data do not bound the parameter on that side, and the end is open. Where it comes
first to a bound that the law itself has (F_c, b, J at 0), that bound is the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray
from ident.estimate import ProfilePoints
from ident.fit.confidence import Interval
from ident.fit.fit_data import FitData
from ident.fit.friction_fit import FrictionFit, fit_from, named, vector
from ident.fit.law_model import BLOCK, LawName
from ident.fit.refits import BETTER, BOUND, MOST_POINTS, REACHED, profile_end, refit_each

Combination = Mapping[str, float]  # of the parameters of `LawModel.names`
OPEN_AT_BOUND = ("stribeck_velocity", "stribeck_shape")  # whose bounds are the search's, not the law's
TRIALS = 3  # times that a better minimum, found along a profile, becomes the fit


@dataclass(frozen=True)
class Profile:
    """Points of a profile, the best fit among them, and the 95 % interval that they bound."""

    points: ProfilePoints
    interval: Interval


def law_combinations(law: LawName) -> dict[str, Combination]:
    """The parameters of a law, and dF as 'stribeck_torque', from those that are fitted."""
    own: dict[str, Combination] = {name: {f"{law}_{name}": 1.0} for name in BLOCK}
    return {"static_torque": {**own["coulomb_torque"], **own["stribeck_torque"]}, **own}


def profiles(
    data: FitData,
    fit: FrictionFit,
    wanted: Mapping[str, Combination],
    *,
    height: Callable[[Combination], float],
) -> tuple[FrictionFit, dict[str, Profile]]:
    """Profiles of combinations whose parameters are all free; by name, with the fit that they belong to: the
    one given, or a better one where a profile has led to it.

    `height` says by how much chi-square rises at the ends of a combination's interval.
    """
    for _ in range(TRIALS):
        found: dict[str, Profile] = {}
        for name, combination in wanted.items():
            profile, better = _profile(data, fit, combination, height=height(combination))
            if better is not None:
                fit = better
                break
            found[name] = profile
        else:
            break
    return fit, found


def _profile(
    data: FitData, fit: FrictionFit, combination: Combination, *, height: float
) -> tuple[Profile, FrictionFit | None]:
    """The profile, and the better fit that it has led to, if it has."""
    problem, box, work = data.problem, data.box, data.work
    best, cost = vector(data, fit.values)[None, :], np.zeros(1)
    refit_each(problem, best, box, work, cost)
    problem.combination[:] = [combination.get(name, 0.0) for name in data.model.names]
    centre = _value(data, best[0], combination)
    step = np.sqrt(height) * _stderr(fit, combination)
    effect = {name: share for name, share in combination.items() if name.endswith("stribeck_torque")}
    searched = any(name.endswith(OPEN_AT_BOUND) for name in combination)
    if not 0 < step < np.inf or (searched and step > centre):
        step = abs(centre) or 1.0
    points, ends = [np.array([[centre, 0.0]])], []
    x, memory = np.empty_like(best[0]), np.empty((MOST_POINTS, 2))
    limits = _value(data, box.low, combination), _value(data, box.high, effect or combination)
    for side, limit, known in ((-1.0, limits[0], not searched), (1.0, limits[1], False)):
        count, ended = profile_end(
            problem, best[0], cost[0], side * step, limit, height, box, work, x, memory
        )
        if ended == BETTER:
            begun = FrictionFit(data.model, named(data, x), fit.free, fit.covariance, cost[0], None)
            return Profile(_by_value(points), Interval(None, None)), fit_from(data, begun, fit)
        points.append(memory[:count].copy())
        closed = limit if ended == BOUND and known else None
        ends.append(float(memory[count - 1, 0]) if ended == REACHED else closed)
    return Profile(_by_value(points), Interval(ends[0], ends[1])), None


def _by_value(points: Sequence[FloatArray]) -> ProfilePoints:
    """Value and rise of parts of a profile (k, 2), each value once; none whose chi-square overflows."""
    joined = np.concatenate(points)
    joined = joined[np.all(np.isfinite(joined), axis=1)]
    value, first = np.unique(joined[:, 0], return_index=True)
    return ProfilePoints(value, joined[first, 1])


def _value(data: FitData, x: FloatArray, combination: Combination) -> float:
    """The combination at compiled parameters (p,)."""
    total = 0.0
    for name, share in combination.items():
        at = float(x[data.model.names.index(name)])
        total += share * (float(np.exp(at)) if name.endswith("stribeck_velocity") else at)
    return total


def _stderr(fit: FrictionFit, combination: Combination) -> float:
    share = np.array([combination.get(name, 0.0) for name in fit.free])
    used = share != 0
    return float(np.sqrt(share[used] @ fit.covariance[np.ix_(used, used)] @ share[used]))

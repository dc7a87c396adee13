"""Whether a Stribeck curve of another shape fits far better than the beta that is held at 1.

Weights that the data have settled themselves hide a wrong law: the misfit is taken for spread between runs,
and chi-square is what it should be. A fit with beta free tells: as an F ratio, of what two more parameters
take off chi-square to what is then left of it, which does not depend on how large the spread was taken to be.
"""

from __future__ import annotations

from data.findings import Finding, Severity
from ident.fit.friction_fit import DIRECTIONS, fit_friction, residuals
from ident.fit.weighting import Weighted

FAR_BETTER = 12.0  # F ratio; by chance under once in ten thousand with 20 data to spare


def shape_findings(weighted: Weighted) -> tuple[Finding, ...]:
    """E-LACKOFFIT where freeing beta would pay."""
    bent = [direction for direction in DIRECTIONS if direction not in weighted.data.lines]
    if not bent:
        return ()
    freed = fit_friction(weighted.data, free_beta=True, start=weighted.fit)
    spare = residuals(weighted.data, freed.values).size - len(freed.free)
    if spare < 1:
        return ()
    fall = (weighted.fit.chi_square - freed.chi_square) / len(bent)
    if fall <= FAR_BETTER * freed.chi_square / spare:
        return ()
    shapes = " and ".join(f"{freed.values[f'{d}_stribeck_shape']:.2g} ({d})" for d in bent)
    text = (
        f"the law with beta = 1 does not fit: with beta free it becomes {shapes} and chi-square falls from "
        f"{weighted.fit.chi_square:.3g} to {freed.chi_square:.3g}. Values and intervals are conditional on "
        "beta = 1, v_s most of all. Identify with --free-beta."
    )
    return (Finding("E-LACKOFFIT", Severity.WARN, text),)

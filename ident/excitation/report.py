"""How the law behind an excitation was found, in words and numbers, for people."""

from __future__ import annotations

import numpy as np

from ident.excitation.excited_law import ExcitedLaw
from ident.excitation.inverse_dynamics import LinearFit


def report(found: ExcitedLaw) -> str:
    """The choices, the estimates by each method with robust errors, lmfit's report, the held-out error."""
    timing = found.timing
    lines = [
        "[[Excitation]]",
        f"    logs               = {', '.join(sorted(found.used))}",
        f"    law                = {_LAWS[found.law]}",
        f"    band               = 0 to {found.cutoff:.4g} Hz (zero-phase low-pass, torque and motion alike)",
        f"    torque taken as    = {timing.timing} at its stamp, {1e3 * timing.delay:.3g} ms later; "
        f"seen {1e3 * timing.seen:.3g} +- {1e3 * timing.stderr:.2g} ms after it",
        f"    left out           = {100 * found.left_out:.1f} % of the samples (rest, saturation)",
        "",
        "[[Inverse dynamics]] least squares, robust standard errors",
        *_table(found.linear),
        f"    relative error     = {100 * found.linear.relative_error:.2f} % of the torque",
    ]
    if found.held_out is not None:
        lines.append(
            f"    held out           = {100 * found.held_out:.2f} % of the torque (cross-validation)"
        )
    if found.comparison is not None:
        lines += [
            "",
            "[[Instruments from the reference]] and how far least squares lies, in errors of the difference",
            *_table(found.comparison.fit, found.comparison.distance.tolist()),
        ]
    refined = found.whole or found.refined
    if refined is not None and found.window:
        lines += [
            "",
            f"[[Output error]] positions over windows of {found.window:.4g} s, predicted to "
            f"{refined.error:.3g} where they move by {found.motion:.3g} (root mean square)",
            *(
                f"    {name:26s} = {refined.values[name]:12.6g} +- {refined.stderr(name):.3g} (robust)"
                for name in refined.names
            ),
            refined.report,
        ]
    used = "output error" if found.whole is not None else "inverse dynamics"
    lines += ["", f"    reported: {used}; lmfit's own errors take samples for independent and are too small"]
    return "\n".join(lines)


_LAWS = {"one": "one for both directions, with an offset", "each": "one for each direction, no offset"}


def _table(fit: LinearFit, distance: list[float] | None = None) -> list[str]:
    stderr = np.sqrt(np.diag(fit.covariance)).tolist()
    apart = [""] * len(stderr) if distance is None else [f"   {value:+.1f}" for value in distance]
    return [
        f"    {name:26s} = {value:12.6g} +- {error:.3g}{far}"
        for name, value, error, far in zip(fit.names, fit.values.tolist(), stderr, apart, strict=True)
    ]

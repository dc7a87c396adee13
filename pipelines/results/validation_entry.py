"""The validation as robot.json holds it.

`validation`: `{"held_out", "ramps"}`. `held_out` is `{"predicted", "folds", "torque_rms", "standardised_rms",
"inside95", "within", "tests", "points"}`: how many runs and breakaways were predicted by fits that had not
seen them, the root mean square of the errors in N m and in standard errors, and how many lie in their 95 %
prediction intervals of +- `within` standard errors. `tests` are `{"name", "statistic", "expected", "chance",
"data"}`, `points` `{"log", "protocol", "direction", "velocity", "place", "measured", "predicted", "stderr",
"standardised"}`. `ramps` are motions after breakaway, simulated: `{"log", "direction", "onset_time",
"onset_error", "travel", "position_rms", "counts_rms"}`.
"""

from __future__ import annotations

from dataclasses import asdict

from ident.validation.summary import Validation


def validation_entry(validation: Validation) -> dict[str, object]:
    """The value of the key `validation`."""
    held_out = validation.held_out
    return {
        "held_out": {
            "predicted": len(held_out.points),
            "folds": len(held_out.folds),
            "torque_rms": held_out.torque_rms,
            "standardised_rms": held_out.standardised_rms,
            "inside95": held_out.inside,
            "within": held_out.quantile,
            "tests": [asdict(test) for test in held_out.tests],
            "points": [{**asdict(p), "standardised": p.standardised} for p in held_out.points],
        },
        "ramps": [asdict(motion) for motion in validation.ramps],
    }

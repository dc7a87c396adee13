"""What to record next, as a file.

`advice.json`, schema `stribeck/advice/1`: `advice`, a list of `{"direction", "quantity", "unit",
"half_width_now", "half_width_then", "reduction", "runs", "why_none"}`. `quantity` is `stribeck_velocity`,
`static_torque` or `critical_observer_gain`; half-widths are of its 95 % interval, as expected, null where the
data do not bound it; `reduction` is in parts of the present one. `runs`, the most useful first, are
`{"protocol", "direction", "speed", "ramp_rate", "duration", "times", "half_width"}`, with the half-width
that is expected after these and those before. Without any, `why_none` says why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Final

from ident.advice import Advice
from pipelines.results.folder import ResultFolder

ADVICE_SCHEMA: Final = "stribeck/advice/1"


def write_advice(folder: ResultFolder, advice: Sequence[Advice], units: Mapping[str, str]) -> None:
    """advice.json; `units` by quantity."""
    rows = [
        {
            **asdict(one),
            "unit": units[one.quantity],
            "half_width_then": one.half_width_then,
            "reduction": one.reduction,
        }
        for one in advice
    ]
    folder.write_json("advice.json", ADVICE_SCHEMA, {"advice": rows})

"""A bifurcation diagram as files.

`diagram.json`, schema `stribeck/diagram/1`: `parameter` ("r" or "L"), `loop` (which loop it is, in words),
the gains that stay (`observer_gain`, ...; the swept one is null), `branches` of `{"kind", "stable",
"points"}` with points `{<parameter>, "x1_min", "x1_max", "amplitude", "period", "multipliers"}`,
`bifurcations` of `{<parameter>, "kind"}`, and `notes`. Kinds are `equilibrium_set` (a band of rests),
`equilibrium` (the isolated set point) and `limit_cycle`. Amplitude is max|x1| over a period; a complex
multiplier is `[re, im]`.

A branch of cycles ends where the cycle jumps; of cycles without the symmetry of their loop both mirror
images are branches. The kind of a bifurcation begins with `equilibria change`, `limit cycle appears`, `limit
cycle vanishes`, `limit cycle jumps`, `symmetry breaking`, `period doubling` or `mode sequence`.

`diagram.csv`: a row a point, with the parameter, the branch's number, kind and stability, x1_min, x1_max,
amplitude, period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from compensation.bifurcation import Diagram, Point
from pipelines.results.folder import ResultFolder

DIAGRAM_SCHEMA: Final = "stribeck/diagram/1"
COLUMNS: Final = ("branch", "kind", "stable", "x1_min", "x1_max", "amplitude", "period")


def write_diagram(
    folder: ResultFolder, diagram: Diagram, *, loop: str, notes: Sequence[str] = (), name: str = "diagram"
) -> None:
    """NAME.json and NAME.csv."""
    folder.write_json(f"{name}.json", DIAGRAM_SCHEMA, diagram_document(diagram, loop=loop, notes=notes))
    rows = [
        (p.value, number, branch.kind, branch.stable, p.x1_min, p.x1_max, p.amplitude, p.period)
        for number, branch in enumerate(diagram.branches)
        for p in branch.points
    ]
    folder.write_csv(f"{name}.csv", (diagram.parameter, *COLUMNS), rows)


def diagram_document(diagram: Diagram, *, loop: str, notes: Sequence[str] = ()) -> dict[str, object]:
    """The content of diagram.json without its schema tag."""
    gains = {f"{gain}_gain": value for gain, value in asdict(diagram.gains).items()}
    gains["compensation_gain" if diagram.parameter == "r" else "observer_gain"] = None
    return {
        "parameter": diagram.parameter,
        "loop": loop,
        **gains,
        "branches": [
            {
                "kind": branch.kind,
                "stable": branch.stable,
                "points": [_point(diagram.parameter, point) for point in branch.points],
            }
            for branch in diagram.branches
        ],
        "bifurcations": [{diagram.parameter: one.value, "kind": one.kind} for one in diagram.bifurcations],
        "notes": [*diagram.notes, *notes],
    }


def _point(parameter: str, point: Point) -> dict[str, object]:
    return {
        parameter: point.value,
        "x1_min": point.x1_min,
        "x1_max": point.x1_max,
        "amplitude": point.amplitude,
        "period": point.period,
        "multipliers": None if point.multipliers is None else [_multiplier(m) for m in point.multipliers],
    }


def _multiplier(value: complex) -> float | list[float]:
    number = complex(value)
    return number.real if number.imag == 0.0 else [number.real, number.imag]

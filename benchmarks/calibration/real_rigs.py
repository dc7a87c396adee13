"""Real rigs with published values: how far ours lie from them, in the published standard deviations.

EMPS is an electro-mechanical positioning system (Janot, Gautier, Brunot, Data set and reference models of
EMPS, 2019): one linear axis, 1 kHz, force and mass where torque and inertia stand elsewhere. Its published
errors take samples for independent; the intervals here do not, so that they are several times as wide. No
deviation was published for the law of each direction: that of the one law is taken.

The log is no part of the repository; it is looked for in `../shared/realdata` beside it.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final

from benchmarks.rows import Row, figure
from ident.excitation.excited_law import ExcitedLaw, excited_law
from ident.excitation.inverse_dynamics import Law
from pipelines.recordings import read_logs
from pipelines.settings.campaign import load_campaign

EMPS: Final = Path(__file__).parents[3] / "shared/realdata/emps"
RELATIVE_ERROR: Final = 0.0408  # published, of the force
DEVIATIONS: Final = {
    "inertia": 0.1085,
    "viscous_damping": 1.1460,
    "coulomb_torque": 0.1012,
    "torque_offset": 0.0444,
}
PUBLISHED: Final[dict[Law, dict[str, float]]] = {
    "one": {
        "inertia": 95.1089,
        "viscous_damping": 203.5034,
        "coulomb_torque": 20.3935,
        "torque_offset": -3.1648,
    },
    "each": {
        "inertia": 95.154,
        "positive_viscous_damping": 166.7061,
        "positive_coulomb_torque": 20.1440,
        "negative_viscous_damping": 240.4236,
        "negative_coulomb_torque": 20.6277,
    },
}
_CAMPAIGN: Final = """
[rig]
name = "EMPS"
axis = "linear"

[signals]
time = {{ csv = "t" }}
position = {{ csv = "qm" }}
reference = {{ csv = "qg" }}
torque = {{ csv = "force" }}

[[experiment]]
protocol = "excitation"
logs = ["{log}"]
"""


def rows(quick: bool) -> list[Row]:
    """A row a parameter, and the errors on what was not fitted; none of it where the log is missing."""
    log = EMPS / "estimation.csv"
    if not log.is_file():
        return [
            {
                "case": "EMPS",
                "value": float("nan"),
                "target": None,
                "unit": "-",
                "reason": f"{log} is missing",
            }
        ]
    laws: tuple[Law, ...] = ("one",) if quick else ("one", "each")
    return [row for law in laws for row in _rows(log, law)]


def _rows(log: Path, law: Law) -> list[Row]:
    found = _found(log, law)
    label = f"EMPS {law} law" if law == "one" else "EMPS law for each direction"
    rows = [
        figure(f"{label} {name}", abs(found.values[name] - value) / _deviation(name), 1.0, "published sd")
        for name, value in PUBLISHED[law].items()
    ]
    rows.append(figure(f"{label} fitted force", found.linear.relative_error, RELATIVE_ERROR, "relative"))
    if found.held_out is not None:
        rows.append(figure(f"{label} held-out force", found.held_out, RELATIVE_ERROR, "relative"))
    if found.refined is not None and found.window:
        error = found.refined.error / found.motion
        rows.append(figure(f"{label} position after {found.window:.2g} s", error, None, "relative"))
    seen = 0.0 if found.whole is None else 1.0
    rows.append(figure(f"{label} Stribeck effect seen", seen, 0.0, "-"))
    return rows


def _found(log: Path, law: Law) -> ExcitedLaw:
    with tempfile.TemporaryDirectory() as scratch:
        campaign = Path(scratch) / "campaign.toml"
        (campaign.parent / log.name).write_bytes(log.read_bytes())
        campaign.write_text(_CAMPAIGN.format(log=log.name), encoding="utf-8")
        logs = read_logs(load_campaign(campaign), ("excitation",))
    found = excited_law(logs.recordings, law=law, axis="linear")
    if isinstance(found, str):
        raise TypeError(found)
    return found


def _deviation(name: str) -> float:
    return next(value for part, value in DEVIATIONS.items() if name.endswith(part))

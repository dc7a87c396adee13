"""Table 1 as it was fitted, beside the paper's: CSV for programs, Markdown and LaTeX for people.

A value stands with its 95 % interval; where it is withheld, the reason stands instead of a number. The
paper's column is typed nowhere: it is read from `ident.model.published`. Where the logs are simulated, the
truth that the virtual rig moved by stands beside, and the table says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from data.names import shown
from ident.model import published
from pipelines.report.numerals import half_width, shown_interval, shown_number
from pipelines.results.folder import csv_text

DIRECTIONS: Final = {"positive": "q̇ > 0", "negative": "q̇ < 0", "mean": "mean"}
SYMBOLS: Final = {  # in the order of the paper's Table 1
    "stribeck_shape": "β",
    "static_torque": "F_s",
    "coulomb_torque": "F_c",
    "stribeck_velocity": "v_s",
    "viscous_damping": "b",
}
WORDS: Final = {
    "inertia": "inertia",
    "stribeck_shape": "Stribeck shape",
    "static_torque": "static friction",
    "coulomb_torque": "Coulomb friction",
    "stribeck_velocity": "Stribeck velocity",
    "viscous_damping": "viscous damping",
}
SIMULATED: Final = "simulated logs (virtual rig)"
_TEX: Final = {"β": r"\beta", "F_s": "F_s", "F_c": "F_c", "v_s": "v_s", "b": "b", "J": "J"}
_TEX_DIRECTIONS: Final = {"positive": r"$\dot{q} > 0$", "negative": r"$\dot{q} < 0$", "mean": "mean"}
_HEADER: Final = (
    "parameter", "symbol", "direction", "value", "unit", "stderr", "low95", "high95", "fixed", "withheld",
    "paper", "truth", "simulated",
)  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """One parameter of one direction ("" for the inertia, which has none)."""

    parameter: str
    symbol: str
    direction: str
    unit: str
    value: float | None
    stderr: float | None
    interval95: tuple[float | None, float | None] | None
    fixed: bool
    withheld: str | None
    paper: float | None
    truth: float | None

    @property
    def shown_value(self) -> str:
        """The value with the digits that its interval supports."""
        return shown_number(self.value, like=self.stderr or half_width(self.interval95))

    @property
    def shown_interval(self) -> str:
        """The interval, or why there is none."""
        return "fixed" if self.fixed else shown_interval(self.interval95, like=self.stderr)


def table1_entries(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> tuple[Entry, ...]:
    """Table 1's entries, the inertia first, then parameter by parameter over the directions.

    `robot` and `truth` as robot.json and truth.json hold them; the paper's numbers only stand on a
    rotary axis.
    """
    paper = _paper() if robot.get("axis", "rotary") == "rotary" else {}
    entries = [_entry("inertia", "J", "", robot.get("inertia"), paper=paper, truth=truth)]
    for parameter, symbol in SYMBOLS.items():
        for direction in DIRECTIONS:
            estimate = (robot.get(direction) or {}).get(parameter)
            entries.append(_entry(parameter, symbol, direction, estimate, paper=paper, truth=truth))
    return tuple(entries)


def table1_csv(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """One row a parameter and direction, every bit of every number."""
    simulated = bool(robot.get("simulated"))
    rows = [
        (
            entry.parameter, entry.symbol, entry.direction, entry.value, entry.unit, entry.stderr,
            *(entry.interval95 or (None, None)), entry.fixed, entry.withheld, entry.paper, entry.truth,
            simulated,
        )
        for entry in table1_entries(robot, truth=truth)
    ]  # fmt: skip
    return csv_text(_HEADER, rows)


def table1_markdown(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """One row a parameter, a column a direction, the paper's value after each."""
    entries = table1_entries(robot, truth=truth)
    inertia, beside = entries[0], references(entries)
    head = ["parameter"]
    for direction in DIRECTIONS.values():
        head += [direction, *beside]
    lines = [_line(head), _line(["---"] * len(head))]
    for parameter, symbol in SYMBOLS.items():
        own = [entry for entry in entries if entry.parameter == parameter]
        cells = [f"{symbol} [{_markdown(own[0].unit)}]"]
        for entry in own:
            cells += [_valued(entry), *(shown_number(getattr(entry, name)) for name in beside)]
        lines.append(_line(cells))
    told = ", ".join(f"{name} {shown_number(getattr(inertia, name))}" for name in beside)
    lines += [
        "",
        f"Inertia J [{_markdown(inertia.unit)}]: {_valued(inertia)}{f' ({told})' if told else ''}. "
        "Brackets are 95 % intervals.",
    ]
    reasons = []
    for why, lacking in reasons_withheld(entries).items():
        symbols = (f"{entry.symbol} {DIRECTIONS.get(entry.direction, '')}".strip() for entry in lacking)
        reasons.append(f"- {', '.join(symbols)}: withheld: {_markdown(why)}")
    label = [f"**{SIMULATED[0].upper()}{SIMULATED[1:]}.**", ""] if robot.get("simulated") else []
    return "\n".join([*label, *lines, *(["", *reasons] if reasons else [])]) + "\n"


def table1_text(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> list[str]:
    """Lines for a terminal, a row a parameter and direction; why something is withheld is said elsewhere.

    The paper's values stand beside those of a virtual rig alone: another rig has nothing to do with them.
    """
    entries = table1_entries(robot, truth=truth)
    beside = references(entries) if truth else []
    heading = f"Table 1{f', {SIMULATED.upper()}' if robot.get('simulated') else ''}: values [95 % intervals]"
    lines = [f"{heading:58}{''.join(f'{name:>10}' for name in beside)}".rstrip()]
    for direction in ("", *DIRECTIONS):
        own = [entry for entry in entries if entry.direction == direction]
        if direction:
            lines.append(f"{DIRECTIONS[direction]}")
        if all(entry.value is None for entry in own):
            lines.append("  withheld")
            continue
        for entry in own:
            known = "".join(f"{shown_number(getattr(entry, name)):>10}" for name in beside)
            label = f"  {entry.symbol:3} {shown(entry.unit):13}"
            lines.append(f"{label} {_valued(entry):40}{known}".rstrip())
    return lines


def references(entries: Sequence[Entry]) -> list[str]:
    """What stands beside the values: "paper" and "truth", where there is any of it."""
    return [name for name in ("paper", "truth") if any(getattr(entry, name) is not None for entry in entries)]


def reasons_withheld(entries: Sequence[Entry]) -> Mapping[str, list[Entry]]:
    """Why something is withheld -> all that is withheld for it."""
    reasons: dict[str, list[Entry]] = {}
    for entry in entries:
        if entry.value is None:
            reasons.setdefault(entry.withheld or "", []).append(entry)
    return reasons


def table1_tex(robot: Mapping[str, Any], *, truth: Mapping[str, Any] | None = None) -> str:
    """A `tabular` in the layout of the paper's Table 1, to be read by LaTeX; needs no package."""
    entries = table1_entries(robot, truth=truth)
    lines = ["% Table 1: friction parameter estimates, 95 % intervals in brackets"]
    lines += [f"% {SIMULATED}"] if robot.get("simulated") else []
    lines += [
        r"\begin{tabular}{lrrr}",
        r"\hline",
        " & ".join(["parameter", *_TEX_DIRECTIONS.values()]) + r" \\",
        r"\hline",
    ]
    for parameter, symbol in SYMBOLS.items():
        own = [entry for entry in entries if entry.parameter == parameter]
        name = f"${_TEX[symbol]}$ [{_tex(own[0].unit)}]"
        lines.append(" & ".join([name, *map(_tex_value, own)]) + r" \\")
        for reference in references(entries):
            known = (_tex_number(getattr(entry, reference)) for entry in own)
            lines.append(" & ".join([rf"\quad {reference}", *known]) + r" \\")
    lines += [r"\hline", r"\end{tabular}"]
    lines += [f"% $J$ = {_tex_value(entries[0])} {_tex(entries[0].unit)}"]
    return "\n".join(lines) + "\n"


def _entry(
    parameter: str,
    symbol: str,
    direction: str,
    estimate: Mapping[str, Any] | None,
    *,
    paper: Mapping[tuple[str, str], float],
    truth: Mapping[str, Any] | None,
) -> Entry:
    known: Mapping[str, Any] = estimate or {"value": None, "withheld": "not in the file"}
    interval = known.get("interval95")
    return Entry(
        parameter=parameter,
        symbol=symbol,
        direction=direction,
        unit=str(known.get("unit") or "-"),
        value=known.get("value"),
        stderr=known.get("stderr"),
        interval95=None if interval is None else (interval[0], interval[1]),
        fixed=bool(known.get("fixed")),
        withheld=None if known.get("value") is not None else str(known.get("withheld")),
        paper=paper.get((parameter, direction)),
        truth=_truth(truth, parameter, direction),
    )


def _paper() -> dict[tuple[str, str], float]:
    curves = {
        "positive": published.POSITIVE,
        "negative": published.NEGATIVE,
        "mean": published.symmetric_robot().friction.positive,
    }
    values = {("inertia", ""): published.INERTIA}
    for direction, curve in curves.items():
        values |= {(name, direction): float(getattr(curve, name)) for name in SYMBOLS}
    return values


def _truth(truth: Mapping[str, Any] | None, parameter: str, direction: str) -> float | None:
    """The virtual rig's own value; of the mean, the mean of its two directions."""
    if truth is None:
        return None
    if direction == "mean":
        sides = [_truth(truth, parameter, side) for side in ("positive", "negative")]
        known = [side for side in sides if side is not None]
        return sum(known) / 2 if len(known) == 2 else None
    robot = truth.get("robot", truth)
    holder = robot if not direction else robot.get("friction", robot).get(direction, {})
    value = holder.get(parameter)
    if isinstance(value, Mapping):
        value = value.get("value")
    return None if value is None else float(value)


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _valued(entry: Entry) -> str:
    if entry.value is None:
        return "withheld"
    return (
        f"{entry.shown_value} ({entry.shown_interval})"
        if entry.fixed
        else f"{entry.shown_value} {entry.shown_interval}"
    )


def _markdown(text: str | None) -> str:
    """Text as data: no cell border, no markup."""
    line = shown(text or "", 600)
    for mark in "\\`*_[]<>|":
        line = line.replace(mark, f"\\{mark}" if mark not in "<>" else {"<": "&lt;", ">": "&gt;"}[mark])
    return line


def _tex_value(entry: Entry) -> str:
    if entry.value is None:
        return "withheld"
    value = f"${entry.shown_value.replace('−', '-')}$"
    if entry.fixed or entry.interval95 is None:
        return f"{value} (fixed)" if entry.fixed else value
    return f"{value} ${entry.shown_interval.replace('−', '-').replace('∞', chr(92) + 'infty')}$"


def _tex_number(value: float | None) -> str:
    return "--" if value is None else f"${shown_number(value)}$".replace("−", "-")


def _tex(text: str) -> str:
    for mark, safe in (("\\", r"\textbackslash "), ("²", "$^2$")):
        text = text.replace(mark, safe)
    return "".join(f"\\{c}" if c in "&%#_{}" else c for c in text)

"""report.html: everything that a campaign gave, on one page that needs no network.

The page is made from results as they are read back from their files, and every part of it is optional: a
campaign without set-point runs has no figure 10, a withheld parameter shows its reason. Names and sentences
that came from logs are data: the template escapes them, and control characters become visible before that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from data.names import shown
from pipelines.report.answers import Answer, does_it_match, how_sure, start_name, which_gains
from pipelines.report.axis_units import AxisUnits, units_of
from pipelines.report.inline_svg import colour_properties, inline_svg
from pipelines.report.numerals import half_width, shown_interval, shown_number
from pipelines.report.tables import DIRECTIONS, SYMBOLS, WORDS, Entry, table1_entries

_GRAVEST_FIRST: Final = ("refuse", "withhold", "warn")
_LONGEST_TEXT: Final = 2000
_LONGEST_REPORT: Final = 200_000  # characters of the fit report


def report_page(
    *,
    name: str,
    rig: str = "",
    robot: Mapping[str, Any] | None = None,
    design: Mapping[str, Any] | None = None,
    diagram: Mapping[str, Any] | None = None,
    comparison: Mapping[str, Any] | None = None,
    manifest: Mapping[str, Any] | None = None,
    truth: Mapping[str, Any] | None = None,
    left_out: Mapping[str, str] | None = None,
    fit_report: str | None = None,
    figures: Mapping[str, str] | None = None,
    axis: str = "rotary",
    simulated: bool = False,
) -> str:
    """The page as HTML text.

    `robot`, `design`, `diagram`, `comparison`, `manifest` and `truth` as their JSON files hold them;
    `left_out` says of "predict" and "compare" why there is no answer; `figures` maps "figure2" ... "figure10"
    and "validation" to SVG text. Raises `PictureError` for a picture that this tool
    cannot have made.
    """
    units = units_of(axis)
    entries = table1_entries(robot, truth=truth) if robot else ()
    pictures = {key: Markup(inline_svg(key, text)) for key, text in (figures or {}).items()}  # noqa: S704  # checked
    environment = _environment()
    return environment.get_template("report.html").render(
        name=name,
        rig=rig,
        simulated=simulated or bool((robot or {}).get("simulated")),
        units=units,
        left_out=left_out or {},
        answers=_answers(robot, entries, design, comparison, units=units, left_out=left_out or {}),
        law=_by_parameter(entries),
        entries=entries,
        truth=truth,
        robot=robot or {},
        runs=_every_log(robot or {}, comparison or {}),
        notes=_by_severity((robot or {}).get("notes") or ()),
        design=design,
        certificates=_by_case((design or {}).get("certificates") or ()),
        diagram=diagram,
        comparison=comparison,
        figures=pictures,
        fit_report=_printable_lines(fit_report[:_LONGEST_REPORT]) if fit_report else None,
        manifest=list(_flat(manifest or {})),
        light=Markup(colour_properties(dark=False)),  # noqa: S704  # our own constants
        dark=Markup(colour_properties(dark=True)),  # noqa: S704  # our own constants
        directions=DIRECTIONS,
        words=WORDS,
        symbols=SYMBOLS,
    )


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("pipelines.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    filters: dict[str, Callable[..., object]] = {
        "plain": lambda text: shown(str(text), _LONGEST_TEXT),
        "symbol": _symbol,
        "unit": lambda unit: shown(str(unit), 40).replace("^2", "²"),
        "number": shown_number,
        "interval": shown_interval,
        "estimate": _estimate,
        "start": start_name,
        "outcome": _outcome,
    }
    environment.filters.update(filters)
    return environment


def _symbol(symbol: str) -> Markup:
    """F_s with its index set low."""
    letter, _, index = symbol.partition("_")
    return (
        Markup("<i>{}</i><sub>{}</sub>").format(letter, index)
        if index
        else Markup("<i>{}</i>").format(letter)
    )


def _answers(
    robot: Mapping[str, Any] | None,
    entries: Sequence[Entry],
    design: Mapping[str, Any] | None,
    comparison: Mapping[str, Any] | None,
    *,
    units: AxisUnits,
    left_out: Mapping[str, str],
) -> list[Answer]:
    sure = [how_sure(robot, entries)] if robot else []
    return [*sure, which_gains(design, units), does_it_match(comparison, units, left_out.get("compare"))]


def _by_parameter(entries: Sequence[Entry]) -> list[tuple[str, list[Entry]]]:
    names = dict.fromkeys(entry.parameter for entry in entries)
    return [(name, [entry for entry in entries if entry.parameter == name]) for name in names]


def _estimate(entry: Mapping[str, Any] | None) -> str:
    """A value with its interval, as design.json holds them, or the reason why there is none."""
    if not entry:
        return shown_number(None)
    if entry.get("value") is None:
        return shown(str(entry.get("withheld") or entry.get("reason") or "none"), _LONGEST_TEXT)
    interval = entry.get("interval95")
    value = shown_number(entry["value"], like=half_width(interval))
    return f"{value} {shown_interval(interval)}" if interval else value


def _outcome(outcome: Mapping[str, Any] | None) -> str:
    """Where a run ended, recorded or predicted: the verdict and the number that belongs to it."""
    if not outcome or not outcome.get("verdict"):
        return shown_number(None)
    verdict = str(outcome["verdict"])
    if verdict == "limit_cycle":
        amplitude = outcome.get("amplitude")
        return "cycles" if amplitude is None else f"cycles, {shown_number(amplitude)}"
    if verdict == "equilibrium":
        rest = outcome.get("position_error", outcome.get("x1_max"))
        return "rests" if rest is None else f"rests at {shown_number(rest)}"
    return shown(verdict, 60)


def _by_case(rows: Iterable[Mapping[str, Any]]) -> list[tuple[str, list[Mapping[str, Any]]]]:
    """The certificates of each robot under each compensator, under a heading that says which."""
    cases: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        robot = f"robot: {row['robot']}; " if row.get("robot") else ""
        cases.setdefault(f"{robot}compensator: {row.get('law')}", []).append(row)
    return list(cases.items())


def _by_severity(notes: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    order = {severity: rank for rank, severity in enumerate(_GRAVEST_FIRST)}
    return sorted(notes, key=lambda note: order.get(str(note.get("severity")), len(order)))


def _every_log(robot: Mapping[str, Any], comparison: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The logs of the fit and of the comparison; those that were left out come first."""
    logs: dict[str, Mapping[str, Any]] = {
        run["log"]: {"protocol": "set_point", "used": True, "log": run["log"], "why": run.get("why")}
        for run in comparison.get("runs") or ()
    }
    for use in comparison.get("excluded") or ():
        logs[use["log"]] = {"protocol": "set_point", "used": False, **use}
    for run in robot.get("runs") or ():
        logs[run["log"]] = {**logs.get(run["log"], {}), **run}
    return sorted(
        logs.values(), key=lambda run: (bool(run.get("used")), str(run.get("protocol")), str(run["log"]))
    )


def _printable_lines(text: str) -> str:
    return "\n".join(shown(line, _LONGEST_TEXT) for line in text.splitlines())


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, str]]:
    """Nested values as pairs of a dotted name and a text."""
    for key, value in values.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{name} · ")
        elif isinstance(value, list | tuple):
            yield name, ", ".join(shown(str(item), 200) for item in value)
        else:
            yield name, shown(str(value), _LONGEST_TEXT)

"""Units at the file door: degrees, rpm, counts, mN m and amperes stop here; inside everything is SI.

A unit word names a quantity and a factor to SI. Words are looked up as written (`mN m` is not `MN m`), after
the typographical variants of one unit (`N·m`, `N*m`, `Nm`; `µ` and `μ`; `°`) are brought together. A word
that is not known is an error that names the nearest known ones; a word of the wrong quantity is an error that
says so.

Two words are not units of what they stand for: a current or a voltage becomes a torque only through the
actuator's constant, so `A` and `V` need a `scale`; a count is an angle only through `encoder_counts`.
"""

from __future__ import annotations

import difflib
import math
import re
import unicodedata
from dataclasses import dataclass
from typing import Final, Literal

from data.findings import LogError
from data.recording import Axis

Kind = Literal[
    "time",
    "angle",
    "length",
    "angular velocity",
    "linear velocity",
    "torque",
    "force",
    "current",
    "voltage",
    "encoder counts",
]
Quantity = Literal["time", "position", "velocity", "torque", "reference"]


@dataclass(frozen=True)
class Unit:
    """A unit: what it measures, and its size in SI."""

    word: str
    kind: Kind
    factor: float  # [SI per unit]; 1 for counts, which have no size of their own


_TURN: Final = 2.0 * math.pi
_DEGREE: Final = math.pi / 180.0
_KILOPOND: Final = 9.80665  # [N] of 1 kg, exact
_POUND: Final = 0.45359237 * _KILOPOND  # [N] of 1 lb, exact
_TABLE: Final[tuple[tuple[Kind, float, tuple[str, ...]], ...]] = (
    ("time", 1.0, ("s", "sec", "second", "seconds")),
    ("time", 1e-3, ("ms", "msec", "millisecond", "milliseconds")),
    ("time", 1e-6, ("us", "usec", "microsecond", "microseconds")),
    ("time", 1e-9, ("ns", "nsec", "nanosecond", "nanoseconds")),
    ("time", 1e-7, ("100 ns", "100ns", "FILETIME", "filetime")),
    ("time", 60.0, ("min", "minute", "minutes")),
    ("time", 3600.0, ("h", "hr", "hour", "hours")),
    ("time", 86400.0, ("day", "days")),
    ("angle", 1.0, ("rad", "radian", "radians")),
    ("angle", 1e-3, ("mrad", "milliradian", "milliradians")),
    ("angle", 1e-6, ("urad", "microradian", "microradians")),
    ("angle", _DEGREE, ("deg", "degree", "degrees")),
    ("angle", 1e-3 * _DEGREE, ("mdeg", "millidegree", "millidegrees")),
    ("angle", _DEGREE / 60.0, ("arcmin", "arcminute", "arcminutes")),
    ("angle", _DEGREE / 3600.0, ("arcsec", "arcsecond", "arcseconds")),
    ("angle", math.pi / 200.0, ("gon", "gons", "gradian", "gradians")),
    ("angle", _TURN, ("rev", "revolution", "revolutions", "turn", "turns")),
    ("length", 1.0, ("m", "metre", "metres", "meter", "meters")),
    ("length", 1e-2, ("cm",)),
    ("length", 1e-3, ("mm", "millimetre", "millimetres", "millimeter", "millimeters")),
    ("length", 1e-6, ("um", "micron", "microns")),
    ("length", 0.0254, ("in", "inch", "inches")),
    ("angular velocity", 1.0, ("rad/s", "rad s^-1", "rad s-1", "rad/sec", "radian/s", "radians/s")),
    ("angular velocity", 1e-3, ("mrad/s",)),
    (
        "angular velocity",
        _DEGREE,
        ("deg/s", "deg s^-1", "deg s-1", "deg/sec", "dps", "degree/s", "degrees/s"),
    ),
    ("angular velocity", _TURN, ("rev/s", "rps", "turn/s", "turns/s")),
    (
        "angular velocity",
        _TURN / 60.0,
        ("rpm", "RPM", "rev/min", "1/min", "min^-1", "min-1", "U/min", "r/min"),
    ),
    ("linear velocity", 1.0, ("m/s", "m s^-1", "m s-1", "m/sec")),
    ("linear velocity", 1e-2, ("cm/s",)),
    ("linear velocity", 1e-3, ("mm/s",)),
    ("linear velocity", 1e-6, ("um/s",)),
    ("linear velocity", 1.0 / 60.0, ("m/min",)),
    ("linear velocity", 1e-3 / 60.0, ("mm/min",)),
    ("torque", 1.0, ("N m", "Nm", "newton metre", "newton metres")),
    ("torque", 1e-3, ("mN m", "mNm")),
    ("torque", 1e-6, ("uN m", "uNm")),
    ("torque", 1e3, ("kN m", "kNm")),
    ("torque", 1e-2, ("N cm", "Ncm")),
    ("torque", 1e-3, ("N mm", "Nmm")),
    ("torque", _POUND * 0.0254, ("lbf in", "lb in", "in lbf", "in lb")),
    ("torque", _POUND * 0.3048, ("lbf ft", "lb ft", "ft lbf", "ft lb")),
    ("torque", _POUND * 0.0254 / 16.0, ("ozf in", "oz in", "in oz")),
    ("torque", _KILOPOND, ("kgf m", "kp m")),
    ("torque", 1e-2 * _KILOPOND, ("kgf cm", "kp cm")),
    ("force", 1.0, ("N", "newton", "newtons")),
    ("force", 1e-3, ("mN",)),
    ("force", 1e3, ("kN",)),
    ("force", _POUND, ("lbf",)),
    ("force", _KILOPOND, ("kgf", "kp")),
    ("current", 1.0, ("A", "amp", "amps", "ampere", "amperes")),
    ("current", 1e-3, ("mA",)),
    ("voltage", 1.0, ("V", "volt", "volts")),
    ("voltage", 1e-3, ("mV",)),
    ("encoder counts", 1.0, ("count", "counts", "cnt", "ticks", "tick", "inc", "increments")),
)
_UNITS: Final = {word: Unit(words[0], kind, factor) for kind, factor, words in _TABLE for word in words}
_KINDS: Final[dict[tuple[Quantity, Axis], Kind]] = {
    ("time", "rotary"): "time",
    ("time", "linear"): "time",
    ("position", "rotary"): "angle",
    ("position", "linear"): "length",
    ("reference", "rotary"): "angle",
    ("reference", "linear"): "length",
    ("velocity", "rotary"): "angular velocity",
    ("velocity", "linear"): "linear velocity",
    ("torque", "rotary"): "torque",
    ("torque", "linear"): "force",
}
_SI: Final[dict[Kind, str]] = {
    unit.kind: unit.word for unit in reversed(_UNITS.values()) if unit.factor == 1.0
}


def si_word(quantity: Quantity, axis: Axis) -> str:
    """The SI unit's word for a quantity, `N m` for a torque."""
    return _SI[_KINDS[quantity, axis]]


def known_unit(word: str) -> Unit | None:
    """The unit that a word means, None for a word that is no unit of ours."""
    plain = unicodedata.normalize("NFKC", word).replace("μ", "u").replace("°", "deg").replace("−", "-")
    plain = re.sub(r"\s*/\s*", "/", re.sub(r"[\s·⋅*.]+", " ", plain)).strip()
    return _UNITS.get(plain) or (_UNITS.get(plain.lower()) if plain.lower() in _ANY_CASE else None)


# Long words mean the same in any case; short ones do not (`mN`, `MN`; `S`, `s`).
_ANY_CASE: Final = {
    word for word in _UNITS if word == word.lower() and (len(word) > 3 or word in {"rad", "deg", "rev"})
}


def parse_unit(word: str) -> Unit:
    """The unit that a word means.

    Raises
    ------
    LogError
        When it is unknown; the message names the nearest known words.
    """
    unit = known_unit(word)
    if unit is None:
        raise LogError(f"{word!r} is {unknown_unit(word)}")
    return unit


def unknown_unit(word: str) -> str:
    """What is to be said of a word that is no unit of ours, with the nearest that are."""
    near = difflib.get_close_matches(word.strip(), _UNITS, n=3, cutoff=0.4)
    near += [known for known in _UNITS if known.lower() == word.strip().lower() and known not in near]
    listed = ", ".join(dict.fromkeys(_UNITS[known].word for known in near)) or ", ".join(_SI.values())
    return f"not a unit known here; the nearest are {listed}"


def factor_to_si(
    word: str | None, *, quantity: Quantity, axis: Axis, encoder_counts: float | None, scaled: bool
) -> float:
    """What one logged unit of `quantity` is in SI, before the signal's own `scale`.

    Parameters
    ----------
    word
        The unit; None means SI.
    quantity, axis
        What is measured, and on which kind of axis.
    encoder_counts
        Counts in a revolution (on a linear axis, in a metre); only for the unit `counts`.
    scaled
        Whether the signal has a `scale`: an actuator constant may then turn A or V into a torque.

    Raises
    ------
    LogError
        When the word is unknown, measures something else, or lacks what it needs.
    """
    wanted = _KINDS[quantity, axis]
    if word is None:
        return 1.0
    unit = parse_unit(word)
    if unit.kind == wanted:
        return unit.factor
    if unit.kind in {"current", "voltage"} and quantity == "torque":
        if scaled:
            return unit.factor
        raise LogError(
            f"a torque in {word} needs a `scale`, the actuator's constant in {_SI[wanted]}/{unit.word}: "
            "without it every torque, and so every friction parameter, is unknown by that factor"
        )
    if unit.kind == "encoder counts" and quantity in {"position", "reference"}:
        if encoder_counts is not None:
            return (_TURN if axis == "rotary" else 1.0) / encoder_counts
        raise LogError(f"a {quantity} in {word} needs `encoder_counts` in [rig]")
    raise LogError(
        f"{word!r} measures {unit.kind}, but the {quantity} of a {axis} axis is {wanted} "
        f"({_SI[wanted]} or a multiple); correct its `unit`" + _axis_hint(unit.kind, axis)
    )


def _axis_hint(kind: Kind, axis: Axis) -> str:
    other: Axis = "linear" if axis == "rotary" else "rotary"
    fits = any(wanted == kind for (_, side), wanted in _KINDS.items() if side == other)
    return f', or set axis = "{other}" in [rig]' if fits and kind != "time" else ""


def same_unit(one: str, other: str) -> bool:
    """Whether two known unit words mean the same."""
    return parse_unit(one) == parse_unit(other)

"""What every format's door shares: what is asked of a file, and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, LogError, Severity
from data.recording import Axis
from data.signals import Signal, Signals, log_format
from data.units import Quantity, known_unit, same_unit, si_word, unknown_unit

FloatArray = NDArray[np.float64]
_LATEST: Final = 1e11  # [s] that a clock counts from a date: the year 5138; Windows counts from 1601
_YEAR: Final = 3.156e7  # [s]
_SMALLER: Final = (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
_DATES: Final = (3e8, 5e9)  # [s] since 1970, which a log may be from
_SHORTEST: Final = 1e-7  # [s] between samples


@dataclass(frozen=True)
class Logged:
    """One file's wanted signals in SI; arrays are (n,)."""

    time: FloatArray  # [s] from the first sample
    signals: Mapping[Quantity, FloatArray]
    clock: str
    metadata: Mapping[str, str]
    findings: tuple[Finding, ...]
    begun: float | None  # from 1970 [s]
    breaks: tuple[int, ...] = ()  # samples before which others are lost


@dataclass(frozen=True)
class Door:
    """What is needed to read and convert one file."""

    path: Path
    log: str
    signals: Signals
    axis: Axis
    encoder_counts: float | None  # [1/revolution], linear [1/m]
    salvage: bool

    def wanted(self) -> dict[Quantity, Signal]:
        """The signals to read, by quantity; position and torque must be named."""
        named: dict[Quantity, Signal | None] = {
            "position": self.signals.position,
            "torque": self.signals.torque,
            "velocity": self.signals.velocity,
            "reference": self.signals.reference,
        }
        for quantity in ("position", "torque"):
            if named[quantity] is None:
                file_format = log_format(self.path)
                raise LogError(
                    f"{self.log}: [signals] names no {quantity} for {file_format} logs; "
                    f'add {file_format} = "..." to {quantity}. `stribeck inspect` lists what the log holds'
                )
        return {quantity: signal for quantity, signal in named.items() if signal is not None}

    def convert(self, quantity: Quantity, signal: Signal, values: FloatArray) -> FloatArray:
        """Logged values (n,) in SI (n,); raises LogError."""
        try:
            return signal.to_si(values, quantity=quantity, axis=self.axis, encoder_counts=self.encoder_counts)
        except LogError as error:
            raise LogError(f"{self.log}: {quantity}: {error}") from error


def interval(time: Signal) -> Signal:
    """How differences of a time convert: an offset of the clock is none of theirs."""
    return replace(time, offset=0.0)


def unset(door: Door, lead: int, clock: str) -> tuple[Finding, ...]:
    """What is said of samples at the start whose stamp is 0."""
    if not lead:
        return ()
    text = (
        f"{lead} sample(s) at the start carry time 0 on the clock ({clock}), the others a date: latched "
        "before it ran, so that their instant is not known; they are left out"
    )
    return (Finding("E-CLOCK", Severity.WARN, text, door.log),)


def plain_clock(place: int, declared: str | None) -> Signal:
    """The time where the campaign names none: a column in the unit that it declares, if that is known."""
    return Signal(place, unit=declared if declared and known_unit(declared) else None)


def require_unit(quantity: Quantity, signal: Signal, declared: str | None, *, axis: Axis) -> None:
    """Refuse a file that declares another unit than the campaign does."""
    if declared is None:
        return
    if known_unit(declared) is None:
        if signal.unit is not None:
            return
        raise LogError(
            f"E-UNIT refuse: the log declares {quantity} in {declared!r}, {unknown_unit(declared)}; as SI, "
            f"every parameter drawn from it would be wrong. Say `unit` on {quantity} in [signals], and "
            "`scale` where no known unit fits"
        )
    stated = signal.unit or si_word(quantity, axis)
    if same_unit(stated, declared):
        return
    source = "the campaign says" if signal.unit else "the campaign names no unit, which means"
    raise LogError(
        f"E-UNIT refuse: the log declares {quantity} in {declared!r}, but {source} {stated!r}; every "
        f"parameter drawn from it would be wrong by their ratio. If the log is right, set "
        f'unit = "{declared}" on {quantity}'
    )


def require_sane_clock(door: Door, stamps: FloatArray) -> None:
    """Refuse times (n,) [s] that no clock of a rig tells: their unit is another."""
    known = stamps[np.isfinite(stamps)]
    if not known.size:
        return
    latest = float(np.max(np.abs(known)))
    if latest > _LATEST:
        words = [word for word, size in _SMALLER if _DATES[0] < latest * size < _DATES[1]]
        likely = f'likely in {words[0]}; set unit = "{words[0]}"' if words else "set its `unit`"
        raise LogError(
            f"{door.log}: E-UNIT refuse: the time reaches {latest:.4g} s, {latest / _YEAR:.3g} years: "
            f"{likely} on time in [signals]. (A date is no number: write it as 2024-05-31 12:00:00.001)"
        )
    step = float(np.median(np.abs(np.diff(known)))) if known.size > 2 else 1.0
    if 0.0 < step < _SHORTEST:
        raise LogError(
            f"{door.log}: E-UNIT refuse: the time steps by {step:.3g} s, {1.0 / step:.3g} Hz: no rig is "
            "sampled so fast. Set its `unit` on time in [signals]"
        )


def after_first(logged: Logged) -> Logged:
    """The run from where every signal has had its first message.

    A reference that has not been sent yet stands at its first value: nothing else is known of it.
    """
    signals = dict(logged.signals)
    if "reference" in signals:
        reference = signals["reference"]
        known = np.flatnonzero(~np.isnan(reference))
        if known.size:
            signals["reference"] = np.where(
                np.arange(reference.size) < known[0], reference[known[0]], reference
            )
    held = [signals[quantity] for quantity in ("torque", "velocity") if quantity in signals]
    late = max((int(np.argmax(~np.isnan(array))) for array in held if np.isnan(array[0])), default=0)
    if late == 0:
        return replace(logged, signals=signals)
    return replace(
        logged,
        time=logged.time[late:],
        signals={quantity: array[late:] for quantity, array in signals.items()},
        breaks=tuple(place - late for place in logged.breaks if place > late),
    )

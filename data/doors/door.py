"""What every format's door shares: what is asked of a file, and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.findings import Finding, LogError, Severity
from data.recording import Axis
from data.signals import Signal, Signals, log_format
from data.units import Quantity, known_unit, same_unit, si_word

FloatArray = NDArray[np.float64]


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


def require_unit(quantity: Quantity, signal: Signal, declared: str | None, *, axis: Axis) -> None:
    """Refuse a file that declares another unit than the campaign does."""
    if declared is None or known_unit(declared) is None:
        return
    stated = signal.unit or si_word(quantity, axis)
    if same_unit(stated, declared):
        return
    source = "the campaign says" if signal.unit else "the campaign names no unit, which means"
    raise LogError(
        f"E-UNIT refuse: the log declares {quantity} in {declared!r}, but {source} {stated!r}; every "
        f"parameter drawn from it would be wrong by their ratio. If the log is right, set "
        f'unit = "{declared}" on {quantity}'
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

"""A simulated run written as the campaign says that its rig's logs look: the door of `data`, walked through
backwards.

Names, units, scale, sign and offset are those of the campaign's signals, so that what is written reads back
as what was meant. Every log says in its metadata that it is simulated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from data.csv.log import write_csv
from data.findings import LogError
from data.mcap.writer import Encoding, write_mcap
from data.parquet.writer import write_parquet
from data.recording import Axis, FloatArray
from data.signals import CsvDialect, RigSignals, Signal, Signals, log_format
from data.units import Quantity, factor_to_si, si_word
from pipelines.settings.campaign_error import CampaignError

EPOCH: Final = 1_700_000_000_000_000_000  # [ns]: a virtual rig's clock starts on 14 November 2023, always
_ADDRESS: Final = re.compile(
    r"(?P<topic>[^:]+):(?P<field>position|velocity|effort)(\[0\]|\{(?P<joint>[^{}]+)\})?"
)
_WRITTEN: Final[dict[str, tuple[object, ...]]] = {  # what a frozen dialect may say of what is written here
    "delimiter": (None, ","),
    "decimal": (None, "."),
    "encoding": (None, "utf-8"),
    "header": (None, True),
    "units_row": (None, False),
    "comment": (None, "#"),
    "quote": (None, '"'),
    "lines_before_numbers": (None,),
}


@dataclass(frozen=True)
class Look:
    """How this rig's logs look."""

    signals: RigSignals
    axis: Axis
    encoder_counts: float | None  # as the campaign declares it: what a `count` is
    encoding: Encoding


def write_log(
    path: Path, look: Look, *, values: Mapping[Quantity, FloatArray], metadata: Mapping[str, str]
) -> None:
    """Write SI `values` (n,) by quantity as one log; raises `CampaignError` for names it cannot write to."""
    labelled = {"simulated": "true", **metadata}
    try:
        kind = log_format(path)
        signals = look.signals.of(kind)
        if kind == "csv":
            _require_written(signals.dialect or CsvDialect())
            columns, _ = _columns(look, signals, values)
            write_csv(
                path, columns={n: np.round(array, 12) for n, array in columns.items()}, metadata=labelled
            )
        elif kind == "parquet":
            columns, units = _columns(look, signals, values)
            write_parquet(path, columns=columns, units=units, metadata=labelled)
        elif kind == "mcap":
            _write_mcap(path, look, signals, values, labelled)
        else:
            raise LogError(f"the virtual rig writes csv, mcap and parquet logs, no {kind}")
    except LogError as failure:
        raise CampaignError(f"virtual rig: {path.name}: {failure}") from None


def _logged(look: Look, signal: Signal, quantity: Quantity, values: FloatArray) -> FloatArray:
    """The numbers that read back as SI `values`."""
    factor = factor_to_si(
        signal.unit,
        quantity=quantity,
        axis=look.axis,
        encoder_counts=look.encoder_counts,
        scaled=signal.scale is not None,
    )
    total = factor * (1.0 if signal.scale is None else signal.scale) * signal.sign
    return (values - signal.offset) / total


def _named(signals: Signals, quantity: Quantity) -> Signal | None:
    found: Signal | None = getattr(signals, quantity)
    if found is None and quantity in {"position", "torque"}:
        raise LogError(f"[signals] does not say where {quantity} stands in this format")
    return found


def _require_written(dialect: CsvDialect) -> None:
    strange = next((key for key, value in asdict(dialect).items() if value not in _WRITTEN[key]), None)
    if strange is not None:
        raise LogError(
            "the virtual rig writes CSV with commas, decimal points and a header, in UTF-8; leave "
            f"`{strange}` out of `dialect`"
        )


def _columns(
    look: Look, signals: Signals, values: Mapping[Quantity, FloatArray]
) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """What is logged of each quantity that has a column, and its unit, by the column's name."""
    columns: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for quantity, array in values.items():
        signal = Signal("t") if quantity == "time" and signals.time is None else _named(signals, quantity)
        if signal is None:
            continue
        if not isinstance(signal.source, str):
            raise LogError(
                f"the virtual rig writes columns by name, and {quantity} is column {signal.source}"
            )
        columns[signal.source] = _logged(look, signal, quantity, array)
        units[signal.source] = signal.unit or si_word(quantity, look.axis)
    return columns, units


def _write_mcap(
    path: Path,
    look: Look,
    signals: Signals,
    values: Mapping[Quantity, FloatArray],
    metadata: Mapping[str, str],
) -> None:
    topic, joint, states = "", "link", {}
    extra: dict[str, FloatArray] = {}
    fields: dict[Quantity, str] = {"position": "position", "torque": "effort", "velocity": "velocity"}
    for quantity, array in values.items():
        signal = _named(signals, quantity) if quantity != "time" else None
        if signal is None:
            continue
        found = _ADDRESS.fullmatch(str(signal.source))
        expected = fields.get(quantity, "position")
        if found is None or found["field"] != expected:
            raise LogError(
                f"the virtual rig writes JointState messages; {quantity} at {signal.source!r} should be "
                f'"TOPIC:{expected}[0]"'
            )
        logged = _logged(look, signal, quantity, array)
        if quantity == "reference":
            extra[found["topic"]] = logged
            continue
        if topic not in {"", found["topic"]}:
            raise LogError(
                f"{quantity} is on topic {found['topic']!r}, another one on {topic!r}: one is written"
            )
        topic, joint = found["topic"], found["joint"] or joint
        states[expected] = logged
    write_mcap(
        path,
        topic=topic,
        joint=joint,
        time=values["time"],
        position=states["position"],
        velocity=states.get("velocity"),
        effort=states["effort"],
        metadata=metadata,
        encoding=look.encoding,
        extra=extra,
        epoch=EPOCH,
    )

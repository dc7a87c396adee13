"""campaign.toml: what was recorded on a rig, and how to read it, as frozen values.

A campaign names a rig, how its logs name things, and its experiments: which protocol, which logs, which runs
to leave out and why. Set-point experiments also say how the controller was set. Logs are named by globs
relative to the file; from here on a log is called by its path relative to the campaign's folder, and nothing
else. A file that breaks a rule is refused as a whole, with the file, the key and the rule.
"""

from __future__ import annotations

import glob
import hashlib
import os
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import get_args

import numpy as np
from pydantic import ValidationError

from data.findings import LogError
from data.protocols import ProtocolName
from data.recording import Axis
from data.signals import (
    FORMATS,
    SUFFIXES,
    CsvDialect,
    Format,
    RigSignals,
    Signal,
    Signals,
    log_format,
)
from data.units import Quantity
from ident.model.friction import ModelError, StribeckCurve, StribeckFriction
from pipelines.results.folder import Owner
from pipelines.settings.campaign_error import CampaignError, explained, nearest
from pipelines.settings.campaign_schema import (
    METADATA,
    SIGNAL_NAMES,
    CampaignDocument,
    CompensatorTable,
    CurveTable,
    ExperimentTable,
    RigTable,
    SignalsTable,
    SignalTable,
)
from pipelines.settings.loop import Compensator, LoopDefaults, resolution_of
from pipelines.settings.set_point import FromMetadata, Gain, SetPointSettings, one_value
from pipelines.settings.virtual_rig import VirtualRig

_NONE: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class Rig:
    """The rig as a whole."""

    name: str
    encoder_counts: (
        float | None
    )  # counts a revolution (a metre on a linear axis); None: estimated from the log
    torque_limit: float | None  # [N m]
    axis: Axis

    @property
    def resolution(self) -> float | None:
        """One encoder count [rad]; None: unknown."""
        return None if self.encoder_counts is None else resolution_of(self.encoder_counts, self.axis)


@dataclass(frozen=True)
class Experiment:
    """One [[experiment]]: a protocol and its logs."""

    protocol: ProtocolName
    log_patterns: tuple[str, ...]
    logs: tuple[str, ...]  # relative to the campaign's folder, sorted
    signals: RigSignals
    exclude: Mapping[str, str] = field(default_factory=lambda: _NONE)  # log: reason
    window: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # log: (begin, end) [s]
    set_point: SetPointSettings | None = None


@dataclass(frozen=True)
class Campaign:
    """A whole campaign.toml."""

    path: Path
    name: str
    rig: Rig
    experiments: tuple[Experiment, ...]
    virtual_rig: VirtualRig | None
    sha256: str  # of the file

    @property
    def folder(self) -> Path:
        """Where relative names begin."""
        return self.path.parent

    @property
    def owner(self) -> Owner:
        """Whose results a result folder holds."""
        return Owner(self.name, self.rig.name)

    def loop_defaults(self) -> LoopDefaults:
        """The loop of the first set-point experiment; a gain that differs from run to run is None."""
        settings = next((e.set_point for e in self.experiments if e.set_point is not None), None)
        known = LoopDefaults(resolution=self.rig.resolution, torque_limit=self.rig.torque_limit)
        if settings is None:
            return known
        return LoopDefaults(
            proportional=one_value(settings.proportional_gain),
            derivative=one_value(settings.derivative_gain),
            observer=one_value(settings.observer_gain),
            compensation=one_value(settings.compensation_gain),
            sample_period=settings.sample_period,
            resolution=known.resolution,
            observer_update=settings.observer_update,
            delay=settings.delay,
            torque_limit=known.torque_limit,
            compensator=settings.compensator,
        )


def load_campaign(path: Path, *, logs_exist: bool = True) -> Campaign:
    """Read a campaign.toml; raises `CampaignError`.

    With `logs_exist` False the logs may still have to be recorded: patterns that match nothing, and names
    of logs that are not there yet, are accepted.
    """
    try:
        content = path.read_bytes()
    except OSError as failure:
        raise CampaignError(
            f"{path}: cannot be read ({failure.strerror}): give the path of a campaign.toml"
        ) from None
    try:
        table = tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as failure:
        raise CampaignError(f"{path}: byte {failure.start} is not UTF-8; TOML files are") from None
    except (tomllib.TOMLDecodeError, RecursionError) as failure:
        raise CampaignError(f"{path}: not TOML: {failure}") from None
    try:
        document = CampaignDocument.model_validate(table)
    except ValidationError as failure:
        raise CampaignError(explained(path, table, failure)) from None
    name = _name(path)
    reader = _Reader(path, document.signals, document.rig, logs_exist)
    return Campaign(
        path=path,
        name=name,
        rig=Rig(
            name=document.rig.name or name,
            encoder_counts=document.rig.encoder_counts,
            torque_limit=document.rig.torque_limit,
            axis=document.rig.axis,
        ),
        experiments=tuple(
            reader.experiment(n, entry) for n, entry in enumerate(document.experiment, start=1)
        ),
        virtual_rig=document.virtual_rig,
        sha256=hashlib.sha256(content).hexdigest(),
    )


def _name(path: Path) -> str:
    """The file's name, or its folder's where the file is just called campaign.toml."""
    for part in (path.stem, *(parent.name for parent in path.resolve().parents)):
        if part and part != "campaign":
            return part
    return "campaign"


@dataclass(frozen=True)
class _Reader:
    """Turns checked tables into values; `where` in a message is the experiment's number in the file."""

    path: Path
    signals: SignalsTable
    rig: RigTable
    logs_exist: bool

    def experiment(self, number: int, entry: ExperimentTable) -> Experiment:
        where = f"{self.path}: [[experiment]] {number} ({entry.protocol})"
        logs = self._logs(where, entry.logs)
        exclude = {self._named(where, "exclude", name, logs): why for name, why in entry.exclude.items()}
        window = {
            self._named(where, "window", name, logs): (begin, end)
            for name, (begin, end) in entry.window.items()
        }
        return Experiment(
            protocol=entry.protocol,
            log_patterns=tuple(entry.logs),
            logs=logs,
            signals=self._signals(where, entry, logs),
            exclude=exclude,
            window=window,
            set_point=self._set_point(where, entry, tuple(log for log in logs if log not in exclude)),
        )

    def _logs(self, where: str, patterns: Sequence[str]) -> tuple[str, ...]:
        """The logs that the patterns name, relative to the campaign's folder, sorted, each once."""
        found: set[str] = set()
        folder = self.path.resolve().parent
        for pattern in patterns:
            literal = folder / pattern
            try:
                matches = (
                    [pattern] if literal.is_file() else glob.glob(pattern, root_dir=folder, recursive=True)
                )
            except (OSError, ValueError) as failure:
                raise CampaignError(f"{where}: logs: {pattern!r} is no file pattern ({failure})") from None
            files = [name for name in matches if (folder / name).is_file()]
            for name in matches:
                if (folder / name).is_dir() and PurePath(name).suffix.lower() in SUFFIXES:
                    raise CampaignError(
                        f"{where}: logs: {pattern!r} matches {name!r}, which is a folder and no log. Rename "
                        "it, or name the logs more narrowly"
                    )
            if not files and self.logs_exist:
                raise CampaignError(
                    f"{where}: logs: {pattern!r} matches no file in {folder}. Correct the pattern, or "
                    "take the experiment out"
                )
            found.update(PurePath(os.path.relpath(folder / name, folder)).as_posix() for name in files)
        return tuple(sorted(found))

    def _named(self, where: str, key: str, name: str, logs: Iterable[str]) -> str:
        """The log that a key of a table means: its path as the campaign names it, or its file name alone."""
        path = PurePath(os.path.normpath(name)).as_posix()
        candidates = [log for log in logs if path in (log, PurePath(log).name)]
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            raise CampaignError(
                f"{where}: {key}: {name!r} is the name of {len(candidates)} logs ({candidates[0]}, "
                f"{candidates[1]}): give its path"
            )
        if not self.logs_exist:
            return path
        raise CampaignError(f"{where}: {key}: {name!r} is none of its logs{nearest(name, list(logs))}")

    def _signals(self, where: str, entry: ExperimentTable, logs: Sequence[str]) -> RigSignals:
        """The signals of the formats that are used; a key of the experiment takes the place of the rig's."""
        tables = {name: getattr(entry, name) or getattr(self.signals, name) for name in SIGNAL_NAMES}
        dialect = entry.dialect or self.signals.dialect
        try:
            named = {kind: _named_signals(tables, kind, self.rig) for kind in FORMATS}
            used = {log: log_format(Path(log)) for log in logs}
            if dialect is not None:
                named["csv"] = replace(named["csv"], dialect=CsvDialect(**dialect.model_dump()))
        except LogError as failure:
            raise CampaignError(f"{where}: {failure}") from None
        for log, log_kind in used.items():
            for name in ("position", "torque"):
                if getattr(named[log_kind], name) is None:
                    raise CampaignError(
                        f"{where}: {log} is a {log_kind} log, and [signals] does not say where {name} stands "
                        f'in those. Add {name} = {{ {log_kind} = "..." }}'
                    )
        return RigSignals(**named)

    def _set_point(self, where: str, entry: ExperimentTable, logs: Sequence[str]) -> SetPointSettings | None:
        if entry.protocol != "set_point":
            return None
        names = ("proportional_gain", "derivative_gain", "observer_gain", "compensation_gain")
        return SetPointSettings(
            **{name: self._gain(where, name, getattr(entry, name), logs) for name in names},
            sample_period=entry.sample_period,
            observer_update=entry.observer_update,
            delay=entry.delay,
            compensator=self._compensator(where, entry.compensator),
        )

    def _gain(
        self, where: str, key: str, value: float | str | Mapping[str, float], logs: Sequence[str]
    ) -> Gain:
        if isinstance(value, str):
            return FromMetadata(value.removeprefix(METADATA))
        if isinstance(value, float):
            return value
        table = {self._named(where, key, name, logs): number for name, number in value.items()}
        missing = [log for log in logs if log not in table]
        if missing and self.logs_exist:
            raise CampaignError(
                f"{where}: {key}: the table has no entry for {missing[0]!r}: add it, or exclude the log"
            )
        return table

    def _compensator(self, where: str, table: CompensatorTable | None) -> Compensator | None:
        if table is None:
            return None
        try:
            if table.positive is None or table.negative is None:
                return Compensator(StribeckFriction.symmetric(_stribeck_curve(table)), table.inertia)
            friction = StribeckFriction(_stribeck_curve(table.positive), _stribeck_curve(table.negative))
        except ModelError as broken:
            raise CampaignError(f"{where}: compensator: {broken}") from None
        return Compensator(friction, table.inertia or table.positive.inertia or table.negative.inertia)


def _named_signals(tables: Mapping[str, SignalTable | None], log_kind: Format, rig: RigTable) -> Signals:
    """What the logs of one format call things; raises `LogError` for a unit that does not fit."""
    found: dict[str, Signal] = {}
    for name, table in tables.items():
        source = None if table is None else table.source(log_kind)
        if table is not None and source is not None:
            unit = table.unit.get(log_kind)
            try:
                signal = Signal(source, unit, scale=table.scale, sign=table.sign, offset=table.offset)
                _require_kind(name, signal, rig)
                found[name] = signal
            except LogError as failure:
                raise LogError(f"{name}: {failure}") from None
    time = tables["time"]
    return Signals(
        position=found.get("position"),
        torque=found.get("torque"),
        time=found.get("time"),
        velocity=found.get("velocity"),
        reference=found.get("reference"),
        clock=None if time is None else time.clock,
    )


def _require_kind(name: str, signal: Signal, rig: RigTable) -> None:
    """Raise `LogError` for a unit that does not fit: deg of a torque, A without a scale."""
    for quantity in get_args(Quantity):
        if quantity == name and signal.unit is not None:
            signal.to_si(np.zeros(1), quantity=quantity, axis=rig.axis, encoder_counts=rig.encoder_counts)


def _stribeck_curve(table: CurveTable | CompensatorTable) -> StribeckCurve:
    names = ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping", "stribeck_shape")
    return StribeckCurve(**{name: getattr(table, name) for name in names})

"""What a campaign.toml may hold, key by key: the rules that the file is read by.

These models check form (types, signs, known keys); what needs the folder of logs is checked in
`pipelines.settings.campaign`. Each rule's message says what the key should be; file and key path are put
in front of it by `pipelines.settings.campaign_error`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from data.protocols import ProtocolName
from data.recording import Axis
from data.signals import FORMATS, Format
from pipelines.settings.loop import ObserverUpdate
from pipelines.settings.virtual_rig import VirtualRig

METADATA: Final = "metadata:"  # a gain that stands in each log
SIGNAL_NAMES: Final = ("time", "position", "torque", "velocity", "reference")
LARGEST_GAIN: Final = 1e9
SET_POINT_KEYS: Final = (
    "proportional_gain",
    "derivative_gain",
    "observer_gain",
    "compensation_gain",
    "sample_period",
    "observer_update",
    "delay",
    "compensator",
)

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]


def _gain(value: object) -> object:
    """A number >= 0, "metadata:KEY", or a table of numbers by file name."""
    if isinstance(value, str):
        if value.startswith(METADATA) and value != METADATA:
            return value
        raise ValueError(
            f'{value!r} is no gain: a number >= 0, "metadata:KEY", or a table {{ "FILE" = number }}'
        )
    if isinstance(value, Mapping):
        if not value:
            raise ValueError('the table is empty: give { "FILE" = number } for each log')
        return {str(name): _finite_gain(number, f" for {name!r}") for name, number in value.items()}
    return _finite_gain(value, "")


def _finite_gain(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{value!r}{where} is no number: a gain is a number >= 0")  # noqa: TRY004  (pydantic's way)
    if not 0 <= value <= LARGEST_GAIN:
        raise ValueError(f"{value}{where}: a gain is a number from 0 to {LARGEST_GAIN:g}")
    return float(value)


def _unit(value: object) -> object:
    """One unit for all formats, or a table with one for each."""
    if isinstance(value, str):
        return dict.fromkeys(FORMATS, value)
    if not isinstance(value, Mapping) or not all(isinstance(unit, str) for unit in value.values()):
        raise ValueError('a unit is a word such as "deg", or { csv = "deg", mcap = "rad" }')
    unknown = sorted(set(value) - set(FORMATS))
    if unknown:
        raise ValueError(f"{unknown[0]!r} is no log format: {' or '.join(FORMATS)}")
    return dict(value)


def _column(value: object) -> object:
    """The text of a column's header, or its number."""
    if isinstance(value, bool) or not isinstance(value, (int, str)) or (isinstance(value, int) and value < 0):
        raise ValueError(f"{value!r} is no column: give its header's text, or its number from 0")
    return value


def _sign(value: object) -> object:
    if isinstance(value, bool) or value not in (1, -1):
        raise ValueError(f"{value!r} is no sign: give 1 or -1")
    return value


GainEntry = Annotated[float | str | dict[str, float], BeforeValidator(_gain)]
UnitEntry = Annotated[dict[str, str], BeforeValidator(_unit)]


class _Table(BaseModel):
    """Strict, frozen, no unknown keys."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")


class RigTable(_Table):
    """[rig]."""

    name: str = ""
    encoder_counts: Positive | None = None
    torque_limit: Positive | None = None
    axis: Axis = "rotary"


class SignalTable(_Table):
    """One signal: where it stands in each format, and what one logged unit is."""

    csv: Annotated[str | int | None, BeforeValidator(_column)] = None
    mcap: str | None = None
    parquet: Annotated[str | int | None, BeforeValidator(_column)] = None
    mat: str | None = None
    bag: str | None = None
    unit: UnitEntry = Field(default_factory=dict)
    scale: Number | None = None
    sign: Annotated[Literal[1, -1], BeforeValidator(_sign)] = 1
    offset: Number = 0.0
    clock: Literal["header", "log", "publish"] | None = None

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if all(self.source(kind) is None for kind in FORMATS) and self.clock is None:
            raise ValueError(
                'no source: give csv = "COLUMN", mcap = "TOPIC:FIELD", parquet = "COLUMN", or '
                'mat = "NAME.FIELD"'
            )
        if self.scale == 0:
            raise ValueError("scale is 0: every logged value would be the same")
        return self

    def source(self, kind: Format) -> str | int | None:
        """Where it stands in logs of one format; None: it is not named there."""
        found: str | int | None = getattr(self, kind)
        return found


class DialectTable(_Table):
    """How CSV files are written, where that shall not be found out by looking; `inspect` prints it."""

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    encoding: str | None = None
    header: bool | None = None
    units_row: bool | None = None
    comment: str | None = None
    quote: str | None = None
    lines_before_numbers: Annotated[int | None, Field(ge=0)] = None


class SignalsTable(_Table):
    """[signals]; a key inside [[experiment]] takes the place of the whole key here."""

    time: SignalTable | None = None
    position: SignalTable | None = None
    torque: SignalTable | None = None
    velocity: SignalTable | None = None
    reference: SignalTable | None = None
    dialect: DialectTable | None = None

    @model_validator(mode="after")
    def _one_clock(self) -> Self:
        for name in SIGNAL_NAMES[1:]:
            signal = getattr(self, name)
            if signal is not None and signal.clock is not None:
                raise ValueError(f"`clock` belongs to `time`, not to `{name}`")
        return self


class CurveTable(_Table):
    """The friction of one direction in a controller."""

    static_torque: NotNegative
    coulomb_torque: NotNegative
    stribeck_velocity: Positive
    viscous_damping: NotNegative
    stribeck_shape: Positive = 1.0
    inertia: Positive | None = None


class CompensatorTable(_Table):
    """The friction model in a controller: one curve for both directions, or one for each."""

    static_torque: NotNegative | None = None
    coulomb_torque: NotNegative | None = None
    stribeck_velocity: Positive | None = None
    viscous_damping: NotNegative | None = None
    stribeck_shape: Positive = 1.0
    inertia: Positive | None = None
    positive: CurveTable | None = None
    negative: CurveTable | None = None

    @model_validator(mode="after")
    def _one_or_two(self) -> Self:
        single = ("static_torque", "coulomb_torque", "stribeck_velocity", "viscous_damping")
        given = [name for name in single if getattr(self, name) is not None]
        if self.positive is None and self.negative is None:
            missing = [name for name in single if name not in given]
            if missing:
                raise ValueError(f"{missing[0]} is missing: a compensator has {', '.join(single)}")
        elif self.positive is None or self.negative is None:
            raise ValueError(
                "one direction is missing: give both `positive` and `negative`, or one curve for both"
            )
        elif given:
            raise ValueError(
                f"{given[0]} stands beside `positive` and `negative`: one curve, or one for each"
            )
        elif (
            len({j for j in (self.inertia, self.positive.inertia, self.negative.inertia) if j is not None})
            > 1
        ):
            raise ValueError("the inertias differ: an observer has one")
        return self


class ExperimentTable(SignalsTable):
    """[[experiment]]."""

    protocol: ProtocolName
    logs: Annotated[list[str], Field(min_length=1)]
    exclude: dict[str, str] = Field(default_factory=dict)
    window: dict[str, Annotated[list[Number], Field(min_length=2, max_length=2)]] = Field(
        default_factory=dict
    )
    proportional_gain: GainEntry | None = None
    derivative_gain: GainEntry | None = None
    observer_gain: GainEntry | None = None
    compensation_gain: GainEntry | None = None
    sample_period: Positive | None = None
    observer_update: ObserverUpdate = "euler"
    delay: Annotated[int, Field(ge=0, le=1000)] = 0
    compensator: CompensatorTable | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for log, (begin, end) in self.window.items():
            if not 0 <= begin < end:
                raise ValueError(f"window of {log!r} is [{begin:g}, {end:g}]: 0 <= begin < end [s]")
        if self.protocol != "set_point":
            for key in SET_POINT_KEYS:
                if key in self.model_fields_set:
                    raise ValueError(
                        f"`{key}` belongs to the protocol set_point, this one is {self.protocol}"
                    )
            return self
        for key in SET_POINT_KEYS[:4]:
            if getattr(self, key) is None:
                raise ValueError(
                    f"`{key}` is missing: a set-point run cannot be predicted without it. Give a number, "
                    '"metadata:KEY", or a table by file name'
                )
        if self.proportional_gain == 0:
            raise ValueError("`proportional_gain` is 0: n1 > 0, or no position is a set point")
        return self


class CampaignDocument(_Table):
    """The whole file."""

    rig: RigTable = RigTable()
    signals: SignalsTable = SignalsTable()
    experiment: Annotated[list[ExperimentTable], Field(min_length=1)]
    virtual_rig: VirtualRig | None = None

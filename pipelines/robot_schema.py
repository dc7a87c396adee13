"""What a robot.json may hold, key by key: the rules that a file from outside is read by."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from data.findings import Severity
from data.protocols import ProtocolName
from data.recording import Axis
from pipelines.loop_settings import ObserverUpdate

Number = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0)]


class _Entry(BaseModel):
    """Strict and frozen; keys of a later schema version are passed over."""

    model_config = ConfigDict(strict=True, frozen=True, extra="ignore")


class EstimateEntry(_Entry):
    """One parameter."""

    value: Number | None
    unit: str = ""
    stderr: NotNegative | None = None
    interval95: tuple[Number | None, Number | None] | None = None
    withheld: str | None = None
    fixed: bool = False

    @model_validator(mode="after")
    def _reason(self) -> Self:
        if self.value is None and not self.withheld:
            raise ValueError("value is null: `withheld` must say why")
        return self


class CurveEntry(_Entry):
    """The five parameters of one direction."""

    static_torque: EstimateEntry
    coulomb_torque: EstimateEntry
    stribeck_velocity: EstimateEntry
    stribeck_shape: EstimateEntry
    viscous_damping: EstimateEntry


class RunEntry(_Entry):
    """Whether a log was used."""

    log: str
    sha256: str = ""
    protocol: ProtocolName
    used: bool
    why: str | None = None


class NoteEntry(_Entry):
    """A finding."""

    code: str
    severity: Severity
    text: str
    log: str | None = None


class CovarianceEntry(_Entry):
    """The joint covariance of the free parameters."""

    names: tuple[str, ...]
    matrix: tuple[tuple[Number, ...], ...]


class CurveValues(_Entry):
    """The five numbers of one direction of a compensator."""

    static_torque: Number
    coulomb_torque: Number
    stribeck_velocity: Number
    viscous_damping: Number
    stribeck_shape: Number = 1.0


class FrictionEntry(_Entry):
    """A compensator's curves."""

    positive: CurveValues
    negative: CurveValues


class CompensatorEntry(_Entry):
    """The friction model in the campaign's controller."""

    friction: FrictionEntry
    inertia: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None


class LoopEntry(_Entry):
    """The loop of the campaign's set-point runs."""

    proportional: NotNegative | None = None
    derivative: NotNegative | None = None
    observer: NotNegative | None = None
    compensation: NotNegative | None = None
    sample_period: NotNegative | None = None
    resolution: NotNegative | None = None
    observer_update: ObserverUpdate = "euler"
    delay: Annotated[int, Field(ge=0)] = 0
    torque_limit: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    compensator: CompensatorEntry | None = None


class CampaignEntry(_Entry):
    """Where the robot came from."""

    name: str
    rig: str = ""
    loop: LoopEntry = LoopEntry()


class RobotDocument(_Entry):
    """The whole file."""

    schema_tag: Literal["stribeck/robot/1"] = Field(alias="schema")
    axis: Axis = "rotary"
    simulated: bool = False
    inertia: EstimateEntry
    positive: CurveEntry
    negative: CurveEntry
    mean: CurveEntry | None = None
    torque_offset: EstimateEntry = EstimateEntry(value=None, unit="N m", withheld="not in the file")
    inertia_sources: dict[str, EstimateEntry] = Field(default_factory=dict)
    covariance: CovarianceEntry | None = None
    campaign: CampaignEntry | None = None
    runs: tuple[RunEntry, ...] = ()
    notes: tuple[NoteEntry, ...] = ()

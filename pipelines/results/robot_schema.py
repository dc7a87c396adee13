"""What a robot.json may hold, key by key: the rules that a file from outside is read by."""

from __future__ import annotations

import itertools
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from data.findings import Severity
from data.protocols import ProtocolName
from data.recording import Axis
from ident.estimate import CURVE_PARAMETERS
from pipelines.settings.loop import ObserverUpdate

SAME_MEAN: Final = 1e-6  # relative
FREE_PARAMETERS: Final = {
    "inertia",
    "torque_offset",
    *(f"{law}.{name}" for law in ("positive", "negative", "mean") for name in CURVE_PARAMETERS),
}
Number = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0)]


class _Entry(BaseModel):
    """Strict and frozen; keys of a later schema version are passed over."""

    model_config = ConfigDict(strict=True, frozen=True, extra="ignore")


class _Closed(_Entry):
    """As above, but without unknown keys: a slip in a parameter must not pass for its absence."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")


class EstimateEntry(_Closed):
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
        low, high = self.interval95 or (None, None)
        if low is not None and high is not None and low > high:
            raise ValueError(f"interval95 is [{low:g}, {high:g}]: the lower end comes first")
        return self


class CurveEntry(_Closed):
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

    @model_validator(mode="after")
    def _a_covariance(self) -> Self:
        unknown = sorted(set(self.names) - FREE_PARAMETERS)
        if unknown or len(set(self.names)) != len(self.names):
            raise ValueError(
                f"names: {unknown[0]!r} is no parameter" if unknown else "names: one stands twice"
            )
        if {len(self.names)} != {len(self.matrix), *map(len, self.matrix)} and self.names:
            raise ValueError(f"matrix: {len(self.names)} names need as many rows of as many numbers")
        matrix = np.array(self.matrix, dtype=np.float64).reshape(len(self.names), len(self.names))
        scale = np.sqrt(np.abs(np.diag(matrix)))
        scale[scale == 0] = 1.0
        correlation = matrix / np.outer(scale, scale)
        if not np.allclose(correlation, correlation.T, atol=1e-9):
            raise ValueError("matrix: a covariance is symmetric")
        if matrix.size and np.linalg.eigvalsh(correlation)[0] < -1e-6:
            raise ValueError("matrix: a covariance has no negative eigenvalue")
        return self


class ProfileEntry(_Entry):
    """Points of a profile likelihood."""

    value: tuple[Number, ...]
    rise: tuple[Number, ...]

    @model_validator(mode="after")
    def _a_profile(self) -> Self:
        if len(self.value) != len(self.rise):
            raise ValueError(f"{len(self.value)} values and {len(self.rise)} rises: a point has one of each")
        if any(one >= other for one, other in itertools.pairwise(self.value)):
            raise ValueError("value: a profile goes from low values to high, each once")
        return self


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
    profiles: dict[str, ProfileEntry] = Field(default_factory=dict)
    campaign: CampaignEntry | None = None
    runs: tuple[RunEntry, ...] = ()
    notes: tuple[NoteEntry, ...] = ()

    @model_validator(mode="after")
    def _known_profiles(self) -> Self:
        unknown = sorted(self.profiles.keys() - FREE_PARAMETERS)
        if unknown:
            raise ValueError(f"profiles: {unknown[0]!r} is no parameter")
        return self

    @model_validator(mode="after")
    def _mean_of_both(self) -> Self:
        for name in CURVE_PARAMETERS if self.mean is not None else ():
            entries = [getattr(curve, name) for curve in (self.positive, self.negative, self.mean)]
            ahead, back, mean = (entry.value for entry in entries)
            if None in (ahead, back, mean):
                continue
            if abs(mean - 0.5 * (ahead + back)) > SAME_MEAN * (abs(ahead) + abs(back)):
                raise ValueError(
                    f"mean.{name} is {mean:g}: the mean of {ahead:g} and {back:g}, or leave `mean` out"
                )
        return self

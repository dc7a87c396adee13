"""The options that several commands share, declared once: names, help and defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

_GAINS = "The loop (defaults: those of the robot's campaign)"
_OUTPUT = "Output"

CampaignFile = Annotated[Path, typer.Argument(help="The campaign.toml.", show_default=False)]
RobotSource = Annotated[str, typer.Argument(help="A robot.json, or the word `paper`.", show_default=False)]

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", help="Result folder (default: stribeck-out/<campaign name>).", rich_help_panel=_OUTPUT
    ),
]
Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Write into a folder of something else; nothing is deleted.",
        rich_help_panel=_OUTPUT,
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.", rich_help_panel=_OUTPUT)]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.", rich_help_panel=_OUTPUT)]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", min=1, max=1024, help="Processes to read logs with, threads to compute with."),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Of everything that is drawn at random.")]
Salvage = Annotated[bool, typer.Option("--salvage", help="Go on with what a damaged log still holds.")]
PredictedLogs = Annotated[
    bool,
    typer.Option(
        "--predicted-logs",
        help="Write each predicted set-point run as MCAP, and a Foxglove layout, to view them.",
        rich_help_panel=_OUTPUT,
    ),
]
Over = Annotated[
    list[str] | None,
    typer.Option("--over", help="What to sweep: r=0.8:1.2:200 or L=20:120:101.", show_default=False),
]
FreeBeta = Annotated[bool, typer.Option("--free-beta", help="Fit the Stribeck shape too, instead of 1.")]
ChooseBeta = Annotated[
    bool, typer.Option("--choose-beta", help="Fit the Stribeck shape where the data earn it (AICc), else 1.")
]
Advise = Annotated[bool, typer.Option("--advise", help="Say what to record next for v_s, F_s and L_c.")]
OneLaw = Annotated[bool, typer.Option("--one-law", help="One law for both directions, and a torque offset.")]
PerDirection = Annotated[
    bool, typer.Option("--per-direction", help="A law for each direction, and no torque offset.")
]

Law = Annotated[
    Literal["per-direction", "mean"],
    typer.Option("--law", help="How the robot moves: each direction's own law, or the mean of both."),
]
Compensator = Annotated[
    Literal["per-direction", "mean"] | None,
    typer.Option(
        "--compensator",
        help="The law in the controller (default: the campaign's, else the mean).",
        show_default=False,
    ),
]
CompensationGain = Annotated[
    float | None, typer.Option("--compensation-gain", help="r.", metavar="R", rich_help_panel=_GAINS)
]
ObserverGain = Annotated[
    float | None, typer.Option("--observer-gain", help="L, in 1/s.", metavar="L", rich_help_panel=_GAINS)
]
Proportional = Annotated[
    float | None, typer.Option("--proportional", help="n1, in N m/rad.", metavar="N1", rich_help_panel=_GAINS)
]
Derivative = Annotated[
    float | None, typer.Option("--derivative", help="n2, in N m s/rad.", metavar="N2", rich_help_panel=_GAINS)
]
SamplePeriod = Annotated[
    float | None,
    typer.Option("--sample-period", help="In s; 0: continuous.", metavar="DT", rich_help_panel=_GAINS),
]
EncoderCounts = Annotated[
    float | None,
    typer.Option("--encoder-counts", help="A revolution.", metavar="N", rich_help_panel=_GAINS),
]

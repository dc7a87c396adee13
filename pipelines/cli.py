"""The command line: one command a question, and `run` and `demo` for all of them.

The commands only translate: options into values, results into files and a few printed lines, refusals into
exit codes. This module loads nothing but typer; what a command needs is imported inside it, so that `--help`
answers at once.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.exit_status import Status
from pipelines.terminal import answers as printed
from pipelines.terminal import options as option
from pipelines.terminal.refusals import ends_well

if TYPE_CHECKING:
    from ident.fit.assumptions import Assumptions
    from pipelines.results.folder import Owner, ResultFolder
    from pipelines.settings.gains import GainOptions

app = typer.Typer(
    name="stribeck",
    help="Identify dry friction from rig logs, design its compensation, predict what the loop will do.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
OUTPUTS = Path("stribeck-out")


@app.command()
@ends_well
def demo(
    out: option.Out = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smaller campaign.")] = False,
    jobs: option.Jobs = None,
    seed: option.Seed = 0,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """Record a whole campaign on a simulated rig, then `run` on it; Table 1 is printed beside the paper's."""
    from data.files import write_atomically
    from pipelines.progress import shown_progress, told
    from pipelines.results.folder import Owner, open_results
    from pipelines.settings.campaign import load_campaign
    from pipelines.virtual.demo_campaign import demo_campaign_text
    from pipelines.virtual_rig import record as record_on
    from pipelines.whole_run import RunOptions, read_truth, run_campaign

    place, text = out or OUTPUTS / "demo", demo_campaign_text(quick)
    owner = Owner(place.resolve().name, tomllib.loads(text)["rig"]["name"])
    folder = open_results(place, owner, force=force)
    path = place / "campaign" / "campaign.toml"
    folder.claim()
    write_atomically(path, text)
    with shown_progress(quiet=quiet) as progress:
        record_on(load_campaign(path, logs_exist=False), path.parent, told(progress, "recording"))
        campaign = load_campaign(path)
        options = RunOptions(seed=seed, jobs=jobs)
        missing = run_campaign(campaign, folder, options, command="demo", progress=progress)
    return _end_of_run(folder, missing, read_truth(campaign), quiet=quiet, as_json=as_json)


@app.command()
@ends_well
def record(
    campaign: option.CampaignFile,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
) -> Status:
    """Let the virtual rig play the protocols of a campaign that has one, and write the logs it names."""
    from pipelines.progress import shown_progress, told
    from pipelines.settings.campaign import load_campaign
    from pipelines.virtual_rig import record as record_on

    loaded = load_campaign(campaign, logs_exist=False)
    with shown_progress(quiet=quiet) as progress:
        written = record_on(loaded, loaded.folder, told(progress, "recording"))
    names = [path.relative_to(loaded.folder).as_posix() for path in written]
    _answer(
        {"simulated": True, "written": names},
        [f"{len(names)} files written beside {campaign}; all are labelled simulated"],
        quiet=quiet,
        as_json=as_json,
    )
    return Status.DONE


@app.command()
@ends_well
def inspect(
    logs: Annotated[list[Path], typer.Argument(help="The logs.", show_default=False)],
    quiet: option.Quiet = False,
    as_json: option.Json = False,
) -> Status:
    """What a log holds, with no settings at all: channels, units, rate, clock, gaps, integrity."""
    from pipelines.terminal.inspection import inspect_logs

    return inspect_logs(logs, as_json=as_json, quiet=quiet)


@app.command()
@ends_well
def identify(
    campaign: option.CampaignFile,
    out: option.Out = None,
    free_beta: option.FreeBeta = False,
    choose_beta: option.ChooseBeta = False,
    one_law: option.OneLaw = False,
    per_direction: option.PerDirection = False,
    advise: option.Advise = False,
    salvage: option.Salvage = False,
    jobs: option.Jobs = None,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """Logs to the fitted robot: robot.json, the friction map, Table 1, figure 2."""
    from pipelines.progress import shown_progress
    from pipelines.results.folder import open_results
    from pipelines.settings.campaign import load_campaign
    from pipelines.whole_run import RunOptions, identify_campaign, read_truth

    loaded = load_campaign(campaign)
    folder = open_results(_place(out, loaded.owner), loaded.owner, force=force)
    assumptions = _assumptions(free_beta, choose_beta, one_law, per_direction)
    options = RunOptions(assumptions=assumptions, advised=advise, salvage=salvage, jobs=jobs)
    with shown_progress(quiet=quiet) as progress:
        missing = identify_campaign(loaded, folder, options, progress=progress)
    _answer_table(folder, missing, read_truth(loaded), quiet=quiet, as_json=as_json)
    return Status.WITHHELD if missing else Status.DONE


@app.command()
@ends_well
def design(
    robot: option.RobotSource,
    out: option.Out = None,
    law: option.Law = "per-direction",
    compensator: option.Compensator = None,
    compensation_gain: option.CompensationGain = None,
    observer_gain: option.ObserverGain = None,
    proportional: option.Proportional = None,
    derivative: option.Derivative = None,
    seed: option.Seed = 0,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """Critical observer gains, equilibrium sets, certificates, recommended gains."""
    from pipelines.design import design as designed
    from pipelines.design import write_design
    from pipelines.results.folder import open_results
    from pipelines.results.robot_file import read_robot
    from pipelines.robot_questions import conclude
    from pipelines.settings.gains import chosen_gains, with_exact

    source = read_robot(robot)
    given = _gains(compensation_gain, observer_gain, proportional, derivative)
    gains = chosen_gains(with_exact(source.loop, given), given, source=source.name)
    folder = open_results(_place(out, source.owner), source.owner, force=force)
    write_design(designed(source, gains, law=law, compensator=compensator, seed=seed), folder)
    missing = source.missing()
    conclude(folder, source, "design", {"law": law, "compensator": compensator}, seed=seed, missing=missing)
    document = _document(folder, "design.json")
    _answer(
        document,
        [*printed.design(document), *printed.withheld(missing), folder.path],
        quiet=quiet,
        as_json=as_json,
    )
    return Status.WITHHELD if missing else Status.DONE


@app.command()
@ends_well
def simulate(
    robot: option.RobotSource,
    out: option.Out = None,
    x0: Annotated[str, typer.Option("--x0", help="Start: x1,x2,x3 in rad, rad/s, rad/s.")] = "1,0,0",
    duration: Annotated[float, typer.Option("--duration", help="In s.")] = 20.0,
    encoder_counts: option.EncoderCounts = None,
    form: Annotated[str, typer.Option("--format", help="csv, mcap or parquet.")] = "csv",
    law: option.Law = "per-direction",
    compensator: option.Compensator = None,
    compensation_gain: option.CompensationGain = None,
    observer_gain: option.ObserverGain = None,
    proportional: option.Proportional = None,
    derivative: option.Derivative = None,
    sample_period: option.SamplePeriod = None,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """One closed-loop run, exact between events: trajectory.csv with columns t, x1, x2, x3, v, u."""
    from compensation.controller import Controller
    from pipelines.results.folder import open_results
    from pipelines.results.robot_file import read_robot
    from pipelines.robot_questions import axis_of, conclude, counted_resolution
    from pipelines.settings.gains import chosen_gains, chosen_sampling
    from pipelines.simulate import parse_format, parse_start, simulate_loop, write_trajectory

    start, written_as = parse_start(x0), parse_format(form)
    source = read_robot(robot)
    given = _gains(compensation_gain, observer_gain, proportional, derivative, sample_period)
    gains = chosen_gains(source.loop, given, source=source.name)
    sampling = chosen_sampling(source.loop, given, resolution=counted_resolution(source, encoder_counts))
    controller = Controller(gains, source.compensating(compensator))
    folder = open_results(_place(out, source.owner), source.owner, force=force)
    run = simulate_loop(
        source.moving(law), controller,
        start=start, duration=duration, sampling=sampling, axis=axis_of(source),
    )  # fmt: skip
    path = write_trajectory(run, folder, form=written_as, axis=axis_of(source))
    options = {"x0": list(start), "duration": duration, "law": law, "compensator": compensator}
    conclude(folder, source, "simulate", options)
    x1, x2, x3 = (float(value) for value in run.state[-1])
    _answer(
        {"loop": run.loop, "end": run.end, "t": float(run.time[-1]), "x1": x1, "x2": x2, "x3": x3},
        [
            f"{run.loop}; {run.end}",
            f"t = {run.time[-1]:g} s: x1 = {x1:.10g}, x2 = {x2:.10g}, x3 = {x3:.10g}",
            path,
        ],
        quiet=quiet,
        as_json=as_json,
    )
    return Status.DONE


@app.command()
@ends_well
def predict(
    robot: option.RobotSource,
    out: option.Out = None,
    over: option.Over = None,
    encoder_counts: option.EncoderCounts = None,
    law: option.Law = "per-direction",
    compensator: option.Compensator = None,
    compensation_gain: option.CompensationGain = None,
    observer_gain: option.ObserverGain = None,
    proportional: option.Proportional = None,
    derivative: option.Derivative = None,
    sample_period: option.SamplePeriod = None,
    jobs: option.Jobs = None,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """The bifurcation diagram over the compensation gain r or the observer gain L."""
    from pipelines.predict import one_sweep
    from pipelines.progress import shown_progress
    from pipelines.results.folder import open_results
    from pipelines.results.robot_file import read_robot
    from pipelines.robot_questions import conclude, counted_resolution, predict_robot
    from pipelines.settings.gains import chosen_sampling

    sweep = one_sweep(over or [])
    source = read_robot(robot)
    given = _gains(compensation_gain, observer_gain, proportional, derivative, sample_period)
    sampling = chosen_sampling(source.loop, given, resolution=counted_resolution(source, encoder_counts))
    source.moving(law)
    folder = open_results(_place(out, source.owner), source.owner, force=force)
    with shown_progress(quiet=quiet) as progress:
        predict_robot(
            source, given, sweep, folder,
            law=law, compensator=compensator, sampling=sampling, jobs=jobs, progress=progress,
        )  # fmt: skip
    options = {"over": list(over or []), "law": law, "compensator": compensator}
    conclude(folder, source, "predict", options)
    document = _document(folder, "diagram.json")
    _answer(document, [*printed.diagram(document), folder.path], quiet=quiet, as_json=as_json)
    return Status.DONE


@app.command()
@ends_well
def compare(
    campaign: option.CampaignFile,
    robot: Annotated[str, typer.Option("--robot", help="A robot.json, or `paper`.", show_default=False)],
    out: option.Out = None,
    law: option.Law = "per-direction",
    compensator: option.Compensator = None,
    salvage: option.Salvage = False,
    predicted_logs: option.PredictedLogs = False,
    jobs: option.Jobs = None,
    seed: option.Seed = 0,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """Recorded set-point runs classified and laid over the prediction: figure 10."""
    from pipelines.progress import shown_progress
    from pipelines.results.folder import open_results
    from pipelines.results.robot_file import read_robot
    from pipelines.settings.campaign import load_campaign
    from pipelines.whole_run import RunOptions, compare_campaign

    loaded, source = load_campaign(campaign), read_robot(robot)
    folder = open_results(_place(out, loaded.owner), loaded.owner, force=force)
    options = RunOptions(
        salvage=salvage, law=law, compensator=compensator, seed=seed, jobs=jobs,
        predicted_logs=predicted_logs,
    )  # fmt: skip
    with shown_progress(quiet=quiet) as progress:
        missing = compare_campaign(loaded, source, folder, options, progress=progress)
    document = _document(folder, "comparison.json")
    _answer(
        document,
        [*printed.comparison(document), *printed.withheld(missing), folder.path],
        quiet=quiet,
        as_json=as_json,
    )
    return Status.WITHHELD if missing else Status.DONE


@app.command()
@ends_well
def run(
    campaign: option.CampaignFile,
    out: option.Out = None,
    free_beta: option.FreeBeta = False,
    choose_beta: option.ChooseBeta = False,
    one_law: option.OneLaw = False,
    per_direction: option.PerDirection = False,
    salvage: option.Salvage = False,
    predicted_logs: option.PredictedLogs = False,
    over: option.Over = None,
    law: option.Law = "per-direction",
    compensator: option.Compensator = None,
    compensation_gain: option.CompensationGain = None,
    observer_gain: option.ObserverGain = None,
    proportional: option.Proportional = None,
    derivative: option.Derivative = None,
    sample_period: option.SamplePeriod = None,
    jobs: option.Jobs = None,
    seed: option.Seed = 0,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """All of it: identify, design, predict, compare, and report.html."""
    from pipelines.progress import shown_progress
    from pipelines.results.folder import open_results
    from pipelines.settings.campaign import load_campaign
    from pipelines.whole_run import RunOptions, read_truth, run_campaign

    loaded = load_campaign(campaign)
    folder = open_results(_place(out, loaded.owner), loaded.owner, force=force)
    options = RunOptions(
        assumptions=_assumptions(free_beta, choose_beta, one_law, per_direction),
        salvage=salvage,
        law=law,
        compensator=compensator,
        gains=_gains(compensation_gain, observer_gain, proportional, derivative, sample_period),
        over=tuple(over or ()),
        seed=seed,
        jobs=jobs,
        predicted_logs=predicted_logs,
    )
    with shown_progress(quiet=quiet) as progress:
        missing = run_campaign(loaded, folder, options, command="run", progress=progress)
    return _end_of_run(folder, missing, read_truth(loaded), quiet=quiet, as_json=as_json)


@app.command()
@ends_well
def paper(
    out: option.Out = None,
    quiet: option.Quiet = False,
    as_json: option.Json = False,
    force: option.Force = False,
) -> Status:
    """Table 1 and figures 2, 4, 6, 7, 8 and 9 of the paper, from its published parameters alone."""
    from pipelines.paper import write_paper
    from pipelines.results.folder import open_results
    from pipelines.results.robot_file import paper_robot
    from pipelines.robot_questions import conclude

    source = paper_robot()
    folder = open_results(_place(out, source.owner), source.owner, force=force)
    write_paper(folder)
    conclude(folder, source, "paper", {})
    names = sorted(folder.written)
    table = (folder.path / "table1.md").read_text(encoding="utf-8")
    _answer({"written": names}, [table, folder.path], quiet=quiet, as_json=as_json)
    return Status.DONE


def main() -> None:
    """The installed command."""
    app(prog_name="stribeck")


def _place(out: Path | None, owner: Owner) -> Path:
    """The result folder: as said, else by the campaign's name, which never leads out of the outputs."""
    name = re.sub(r"[^\w.-]+", "_", owner.campaign).strip(". ")
    return out or OUTPUTS / (name or "campaign")


def _assumptions(free_beta: bool, choose_beta: bool, one_law: bool, per_direction: bool) -> Assumptions:
    from ident.fit.assumptions import Assumptions, LawsChoice, ShapeChoice
    from pipelines.exit_status import UsageError

    if free_beta and choose_beta:
        raise UsageError("--free-beta and --choose-beta: beta is either fitted or chosen; give one of them")
    if one_law and per_direction:
        raise UsageError(
            "--one-law and --per-direction: a law for each direction and a torque offset cannot both be "
            "told from torque-driven experiments; give one of them"
        )
    shape: ShapeChoice = "free" if free_beta else "chosen" if choose_beta else "fixed"
    laws: LawsChoice = "one" if one_law else "each" if per_direction else "default"
    return Assumptions(shape=shape, laws=laws)


def _gains(
    compensation: float | None,
    observer: float | None,
    proportional: float | None,
    derivative: float | None,
    sample_period: float | None = None,
) -> GainOptions:
    from pipelines.settings.gains import GainOptions

    return GainOptions(compensation, observer, proportional, derivative, sample_period)


def _document(folder: ResultFolder, name: str) -> dict[str, Any]:
    """A result file as it was just written."""
    return dict(json.loads((folder.path / name).read_text(encoding="utf-8")))


def _answer(document: Mapping[str, object], lines: Sequence[object], *, quiet: bool, as_json: bool) -> None:
    """The answer on stdout: JSON for programs, a few lines for people, nothing where quiet."""
    if as_json:
        print(json.dumps(document, indent=2, allow_nan=False))
    elif not quiet:
        text = "\n".join(map(str, lines))
        encoding = sys.stdout.encoding or "utf-8"
        print(text.encode(encoding, "replace").decode(encoding))


def _answer_table(
    folder: ResultFolder, missing: list[str], truth: Mapping[str, Any] | None, *, quiet: bool, as_json: bool
) -> None:
    from pipelines.report.tables import table1_text

    robot = _document(folder, "robot.json")
    lines: list[object] = [*table1_text(robot, truth=truth), *printed.withheld(missing)]
    if "advice.json" in folder.written:
        lines += printed.advice(_document(folder, "advice.json"))
    _answer(robot, [*lines, folder.path], quiet=quiet, as_json=as_json)


def _end_of_run(
    folder: ResultFolder, missing: list[str], truth: Mapping[str, Any] | None, *, quiet: bool, as_json: bool
) -> Status:
    """Table 1, the onsets, what is withheld, and where the report lies."""
    from pipelines.report.tables import table1_text

    status = Status.WITHHELD if missing else Status.DONE
    names = sorted(folder.written)
    comparison = _document(folder, "comparison.json") if "comparison.json" in names else None
    robot = _document(folder, "robot.json")
    summary = {
        "simulated": robot["simulated"],
        "status": int(status),
        "withheld": missing,
        "written": names,
        "onset": None if comparison is None else comparison["onset"],
        "agreement": None if comparison is None else comparison["agreement"],
    }
    lines: list[object] = [*table1_text(robot, truth=truth)]
    lines += [] if comparison is None else printed.comparison(comparison)
    lines += [*printed.withheld(missing), f"report: {folder.path / 'report.html'}"]
    _answer(summary, lines, quiet=quiet, as_json=as_json)
    return status

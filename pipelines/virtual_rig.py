"""The virtual rig: a robot whose truth is known plays a campaign's protocols and leaves logs, as a real rig
would.

It is cut at the sensor. What the robot does, `ident.response` and `compensation.sampled_loop` say; what its
encoder and torque channel make of that, `data.instruments`; and it leaves through the same door as any rig:
log files, through the writers that anyone can use, under names that the campaign's globs find. Each log is
labelled simulated, and `truth.json` beside them says what an identification should find.
"""

from __future__ import annotations

import glob
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from data.files import write_atomically
from data.instruments import Encoder, TorqueChannel
from data.recording import FloatArray
from data.units import Quantity
from ident.response import TorqueRipple, plant_array
from pipelines.settings.campaign import Campaign, Experiment
from pipelines.settings.campaign_error import CampaignError
from pipelines.settings.loop import resolution_of
from pipelines.settings.virtual_rig import VirtualRig
from pipelines.virtual.bench import Bench
from pipelines.virtual.log import Look, write_log
from pipelines.virtual.protocols import Run, breakaways, constant_speeds, excitations, multisines, rounded
from pipelines.virtual.set_points import set_points

TRUTH = "truth.json"
COUNTS = 2.0**18  # of the encoder where neither [virtual_rig] nor [rig] has any
Tell = Callable[[str, int, int], None]  # what is being recorded, how many logs are done, of how many


def _silent(label: str, done: int, total: int) -> None:
    """Nobody asked."""


@dataclass(frozen=True)
class _Take:
    """One log to record: the run, its file, the sample period, and how the file looks."""

    run: Run
    log: str
    period: float
    look: Look


def record(campaign: Campaign, into: Path, progress: Tell = _silent) -> list[Path]:
    """Play every experiment of a campaign that has a [virtual_rig], and write its logs and truth.json.

    Parameters
    ----------
    campaign
        Its log patterns, relative to `into`, name the logs: the `*` of each is filled in.
    into
        The folder that the patterns are relative to, as a rule the campaign's own.
    progress
        Called before each log with what it is, how many are done, and of how many.

    Returns
    -------
    The logs and truth.json, in the order of their recording.

    Raises `CampaignError` without a [virtual_rig], for names that cannot be written to, and where logs are
    in the way that no virtual rig has written, or that these would be taken for.
    """
    rig = campaign.virtual_rig
    if rig is None:
        raise CampaignError(f"{campaign.path}: no [virtual_rig] table: there is nothing to record from")
    takes = [take for experiment in campaign.experiments for take in _takes(campaign, rig, experiment)]
    _make_room(campaign, into, takes)
    encoder = Encoder(_resolution(campaign, rig))
    channel = _torque_channel(rig)
    generators = np.random.default_rng(rig.seed).spawn(len(takes))
    truth = into / TRUTH
    write_atomically(truth, json.dumps(_truth(campaign, rig, takes), indent=2) + "\n")
    written = []
    for done, (take, generator) in enumerate(zip(takes, generators, strict=True)):
        progress(take.log, done, len(takes))
        motion = take.run.play(generator)
        values: dict[Quantity, FloatArray] = {
            "time": take.period * np.arange(motion.position.size, dtype=np.float64),
            "position": encoder.measure(motion.position),
            "torque": channel.measure(motion.torque, generator),
            "velocity": motion.velocity,
            "reference": motion.reference,
        }
        write_log(into / take.log, take.look, values=values, metadata=take.run.metadata)
        written.append(into / take.log)
    progress(TRUTH, len(takes), len(takes))
    return [*written, truth]


def _takes(campaign: Campaign, rig: VirtualRig, experiment: Experiment) -> Iterator[_Take]:
    ripple = _ripple(campaign, rig)
    settings = experiment.set_point
    period = (settings.sample_period if settings is not None else None) or rig.sample_period
    bench = Bench(
        plant=plant_array(rig.true_robot(), ripple),
        period=period,
        resolution=_resolution(campaign, rig),
        torque_limit=campaign.rig.torque_limit or math.inf,
    )
    look = Look(
        signals=experiment.signals,
        axis=campaign.rig.axis,
        encoder_counts=campaign.rig.encoder_counts,
        encoding="json" if experiment.protocol in rig.json_protocols else "cdr",
    )
    if settings is not None:
        runs = list(set_points(rig, settings, bench, ripple))
    else:
        plays = {
            "breakaway": breakaways,
            "constant_velocity": constant_speeds,
            "frequency_response": multisines,
            "excitation": excitations,
        }
        runs = list(plays[experiment.protocol](rig, bench))
    for run, log in zip(runs, _names(campaign, experiment.log_patterns, runs), strict=True):
        yield _Take(run, log, period, look)


def _names(campaign: Campaign, patterns: Sequence[str], runs: Sequence[Run]) -> Iterator[str]:
    """A log's name for each run: the pattern with its `*` filled in; several patterns take turns."""
    for number, run in enumerate(runs):
        pattern = patterns[number % len(patterns)]
        name = PurePosixPath(pattern).name
        folder = PurePosixPath(pattern).parent
        if run.log is not None:
            yield run.log
        elif name.count("*") == 1 and not any(mark in str(folder) + name for mark in ("**", "?", "[")):
            yield str(folder / name.replace("*", run.label))
        else:
            raise CampaignError(
                f"{campaign.path}: logs: the virtual rig fills in the `*` of a pattern such as "
                f'"velocity/*.csv", one in the file\'s name; {pattern!r} leaves it {len(runs)} runs to name'
            )


def _make_room(campaign: Campaign, into: Path, takes: Sequence[_Take]) -> None:
    """Remove what an earlier recording left; refuse to touch, or to record beside, what it did not write."""
    names = [take.log for take in takes]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise CampaignError(
            f"{campaign.path}: logs: two runs would both be {twice}: give each experiment names of its own"
        )
    earlier = _logs_of_earlier_recording(into / TRUTH)
    foreign = sorted(name for name in names if name not in earlier and (into / name).exists())
    if foreign:
        raise CampaignError(
            f"{into / foreign[0]}: is there already, and {TRUTH} does not name it: it may be a real "
            "rig's log and is not written over. Record into another folder, or remove it"
        )
    matching = {
        PurePath(path).as_posix()
        for experiment in campaign.experiments
        for pattern in experiment.log_patterns
        for path in glob.glob(pattern, root_dir=into, recursive=True)
    }
    others = sorted(matching - set(names) - earlier)
    if others:
        raise CampaignError(
            f"{into / others[0]}: matches a pattern of {campaign.path.name} and is not recorded now: an "
            f"identification would mix it with the simulated logs. Remove it ({len(others)} in all)"
        )
    for name in (matching & earlier) - set(names):
        (into / name).unlink()


def _logs_of_earlier_recording(truth: Path) -> set[str]:
    """The logs that a truth.json names; none where there is no such file, or none of ours."""
    try:
        logs = json.loads(truth.read_text(encoding="utf-8"))["logs"]
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    return {log for log in logs if isinstance(log, str)} if isinstance(logs, list) else set()


def _resolution(campaign: Campaign, rig: VirtualRig) -> float:
    counts = rig.encoder_counts or campaign.rig.encoder_counts or COUNTS
    return resolution_of(counts, campaign.rig.axis)


def _torque_noise(rig: VirtualRig) -> float:
    static = rig.true_robot().mean().friction.positive.static_torque
    return rounded(0.02 * static) if rig.torque_noise is None else rig.torque_noise


def _torque_channel(rig: VirtualRig) -> TorqueChannel:
    """Noise, and a converter whose step, a power of two, drowns in it; logs then compress as a rig's do."""
    noise = _torque_noise(rig)
    return TorqueChannel(
        noise=noise, resolution=2.0 ** math.floor(math.log2(noise / 16)) if noise > 0 else 0.0
    )


def _ripple(campaign: Campaign, rig: VirtualRig) -> TorqueRipple:
    if rig.ripple is None:
        return TorqueRipple()
    turn = 1.0 if campaign.rig.axis == "rotary" else 2.0 * math.pi
    coulomb = rig.true_robot().mean().friction.positive.coulomb_torque
    return TorqueRipple(rig.ripple.amplitude * coulomb, rig.ripple.harmonic * turn, rig.ripple.phase)


def _truth(campaign: Campaign, rig: VirtualRig, takes: Sequence[_Take]) -> dict[str, object]:
    """What truth.json says: the robot in SI, and how it was measured."""
    robot = rig.true_robot()
    return {
        "schema": "stribeck/truth/1",
        "simulated": True,
        "campaign": campaign.name,
        "axis": campaign.rig.axis,
        "inertia": robot.inertia,
        "positive": asdict(robot.friction.positive),
        "negative": asdict(robot.friction.negative),
        "mean": asdict(robot.mean().friction.positive),
        "encoder_counts": rig.encoder_counts or campaign.rig.encoder_counts or COUNTS,
        "sample_period": rig.sample_period,
        "torque_noise": _torque_noise(rig),
        "ripple": asdict(_ripple(campaign, rig)),
        "seed": rig.seed,
        "logs": [take.log for take in takes],
    }

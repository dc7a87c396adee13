"""What goes wrong with a measurement before anyone estimates from it: refuse, mend or warn, and say why.

Each detector here sees one run in SI and answers with findings, with mended signals, or with a refusal
(`LogError`) that names the sample, the time, the parameter harmed and the remedy. Nothing that could be good
data is altered: only a wrap whose other side fits, and single samples that leave the path and come back.

    E-CLOCK  time does not advance                    late samples sorted in, wrong stamps left out, the run
                                                      taken apart where the clock was set back; refused where
                                                      too little is left, or time leaps years
    E-WRAP   the encoder wraps                        unwrapped where unambiguous, else refused
    E-SPIKE  single wrong positions                   dropped and counted; refused above 1 %
    E-GAP    lost samples, jitter                     warned; no derivative is taken across a gap
    E-SAT    the torque sits at its limit             warned
    E-UNIT   logged velocity is not dq/dt             refused, with the factor and the unit it looks like
    E-SIGN   the torque takes work out of the link    refused
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.clocks import Advancing, advancing
from data.findings import Finding, LogError, Severity
from data.protocols import IDENTIFIES, ProtocolName

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]
# Protocols of which each part of a split run says something by itself.
TAKEN_APART: Final = frozenset({"breakaway", "constant_velocity", "excitation"})
SMALLEST: Final = 1e-12  # largest torque [N m] or position [rad] of a log, below and above which its scale is
LARGEST: Final = 1e12  # wrong
FEWEST_SAMPLES: Final = 10
AT_LIMIT: Final = 0.999  # of a declared torque limit
FLAT_SAMPLES: Final = 5  # at the largest torque
BANDS: Final = (
    0.005,
    0.2,
    12,
)  # least and most of a torque's range that noise may cover, and how many are tried
FLAT_SHARE: Final = 0.03  # of a run; a tenth of it where exactly one number comes back
LEVELS: Final = 10  # other sizes that a torque takes, or it is a square wave
PILED_UP: Final = 4.0  # times as often at the largest torque as right below it
SIGN_BLOCKS: Final = 8  # of a run, by whose scatter its mean work is judged
FAR_BEYOND: Final = 3.0  # times the torque limit
GAP: Final = 3.0  # median steps
_YEARS: Final = 1e8  # [s] between two samples of no run
_SPIKE_WINDOW: Final = 25  # samples on either side for the local spread
_LOOKS_LIKE: Final = (
    (180.0 / math.pi, "the velocity looks like deg/s", "deg/s"),
    (30.0 / math.pi, "the velocity looks like rpm", "rpm"),
    (0.5 / math.pi, "the velocity looks like rev/s", "rev/s"),
    (1000.0, "the velocity looks like thousandths (mrad/s or mm/s)", "mrad/s"),
    (math.pi / 180.0, "the position looks like degrees", "deg"),
    (2.0 * math.pi, "the position looks like revolutions", "rev"),
    (1e-3, "the position looks like thousandths (mrad or mm)", "mrad"),
    (6.0, "the position looks like degrees and the velocity like rpm, or the other way round", "deg/s"),
)
_COUNT_LOOKS_LIKE: Final = (
    (180.0 / math.pi, "it looks like degrees"),
    (0.5 / math.pi, "it looks like revolutions"),
    (1000.0, "it looks like thousandths (mrad or mm)"),
    (1e-3, "it looks like thousands"),
)


@dataclass(frozen=True)
class Signals:
    """One run in SI as it is screened; arrays are (n,)."""

    log: str
    protocol: ProtocolName
    time: FloatArray  # [s]
    position: FloatArray  # [rad]
    torque: FloatArray  # [N m]
    velocity: FloatArray | None  # [rad/s]
    reference: FloatArray | None  # [rad]
    breaks: tuple[int, ...] = ()  # samples at which another part of the run begins: nothing joins them

    def named(self) -> dict[str, FloatArray]:
        """The signals that are there, by name."""
        pairs = {
            "position": self.position,
            "torque": self.torque,
            "velocity": self.velocity,
            "reference": self.reference,
        }
        return {name: array for name, array in pairs.items() if array is not None}

    def keep(self, samples: BoolArray) -> Signals:
        """The same run with some samples only."""
        before = np.concatenate(([0], np.cumsum(samples)))
        breaks = tuple(int(before[k]) for k in self.breaks)
        return replace(self.taken(np.flatnonzero(samples)), breaks=breaks)

    def taken(self, samples: IndexArray) -> Signals:
        """Samples by number, in their order, as one part."""
        return replace(
            self,
            time=self.time[samples],
            position=self.position[samples],
            torque=self.torque[samples],
            velocity=None if self.velocity is None else self.velocity[samples],
            reference=None if self.reference is None else self.reference[samples],
            breaks=(),
        )


@dataclass(frozen=True)
class Screened:
    """A run that may be used, and what was seen."""

    signals: Signals
    findings: tuple[Finding, ...]
    torque_limit: float | None  # as declared, or where the torque is flat [N m]


def screen(run: Signals, *, clock: str, resolution: float | None, torque_limit: float | None) -> Screened:
    """Screen one run.

    Parameters
    ----------
    run
        In SI.
    clock
        What its time is, for messages: "header stamps", "column 't'".
    resolution
        One encoder count [rad]; None: unknown.
    torque_limit
        Of the actuator [N m]; None: unknown.

    Raises
    ------
    LogError
        When a detector refuses the run.
    """
    require_finite(run)
    require_sizes(run)
    require_samples(run)
    run, clocks = advance(run, clock)
    run, wraps = unwrap(run, resolution)
    run, spikes = drop_spikes(run, resolution)
    require_velocity_unit(run, resolution)
    require_torque_size(run, torque_limit)
    require_torque_sign(run, resolution)
    limit = flat_top(run) if torque_limit is None else torque_limit
    saturated = saturation(run, limit, declared=torque_limit is not None)
    return Screened(run, (*clocks, *wraps, *spikes, *gaps(run, clock), *saturated), limit)


def require_finite(run: Signals) -> None:
    """Refuse times and signals that are no finite numbers."""
    for name, array in {"time": run.time, **run.named()}.items():
        bad = np.flatnonzero(~np.isfinite(array))
        if not bad.size:
            continue
        k = int(bad[0])
        when = f", t = {run.time[k]:.6g} s" if np.isfinite(run.time[k]) else ""
        raise LogError(
            f"{run.log}: {name} is {array[k]} at sample {k}{when}"
            + (f" (and {bad.size - 1} more)" if bad.size > 1 else "")
            + f"; it would spoil {IDENTIFIES[run.protocol]}. Cut it off with `window`, or exclude the log"
        )


def require_sizes(run: Signals) -> None:
    """Refuse a torque or position of a size that no rig has: a wrong scale."""
    for name, values in (("torque", run.torque), ("position", run.position)):
        peak = float(np.max(np.abs(values), initial=0.0))
        if not (peak == 0.0 or SMALLEST <= peak <= LARGEST):
            raise LogError(
                f"{run.log}: the {name} reaches {peak:g} in SI, which no rig does (from {SMALLEST:g} to "
                f"{LARGEST:g}): nothing can be fitted to it. Correct its `unit`, `scale` or `offset` in "
                "campaign.toml"
            )


def require_samples(run: Signals) -> None:
    """Refuse a run that is empty or too short."""
    if run.time.size < FEWEST_SAMPLES:
        raise LogError(
            f"{run.log}: {run.time.size} samples; a run needs at least {FEWEST_SAMPLES} to say anything "
            f"about {IDENTIFIES[run.protocol]}. Record it again or exclude it"
        )


def advance(run: Signals, clock: str) -> tuple[Signals, tuple[Finding, ...]]:
    """E-CLOCK: a run whose clock stands still, jumps back or is out of order, put right or taken apart."""
    found = advancing(run.time, fewest=FEWEST_SAMPLES)
    if found.first is None:
        _require_one_epoch(run, np.diff(run.time), clock)
        return run, ()
    k, step = found.first
    back = f"jumps back by {-step:.6g} s" if step < -1e-12 else "stands still"
    places = int(np.count_nonzero(np.diff(run.time) <= 0.0))
    seen = f"the clock ({clock}) {back} at sample {k}, t = {run.time[k - 1]:.6f} s" + (
        f", and at {places - 1} more places" if places > 1 else ""
    )
    if not found.kept.size:
        raise LogError(
            f"{run.log}: E-CLOCK refuse: {seen}; no part of the run in which it advances has "
            f"{FEWEST_SAMPLES} samples, so that no speed can be told, and nothing of "
            f"{IDENTIFIES[run.protocol]}. Choose another `clock` or time signal, or record it again"
        )
    mended = replace(run.taken(found.kept), time=found.time, breaks=found.breaks)
    done = [*_said(found)]
    if found.breaks and run.protocol not in TAKEN_APART:
        edges = np.array([0, *found.breaks, found.kept.size])
        longest = int(np.argmax(np.diff(edges)))
        mended = mended.taken(np.arange(edges[longest], edges[longest + 1]))
        done.append(f"of its parts only the longest is used, from t = {mended.time[0]:.6g} s")
    _require_one_epoch(mended, np.diff(mended.time), clock)
    return mended, (_warn("E-CLOCK", f"{seen}; {'; '.join(done)}", run),)


def _said(found: Advancing) -> list[str]:
    """What was done about a clock that does not advance."""
    done = []
    if found.late:
        done.append(f"{found.late} samples that came late were sorted in by their stamps")
    if found.wrong:
        done.append(f"{found.wrong} samples with a wrong stamp between two right ones were left out")
    if found.breaks:
        done.append(
            f"the run was split into {len(found.breaks) + 1} parts: how long the motion between them took is "
            "not known, no speed is taken across, and the time is counted on from part to part"
        )
    if found.short:
        done.append(f"{found.short} samples in parts of under {FEWEST_SAMPLES} were left out")
    return done


def _require_one_epoch(run: Signals, step: FloatArray, clock: str) -> None:
    k = int(np.argmax(step))
    if step[k] < _YEARS:
        return
    raise LogError(
        f"{run.log}: E-CLOCK refuse: the clock ({clock}) jumps ahead by {step[k]:.6g} s, over three years, "
        f"at sample {k + 1}, t = {run.time[k]:.6g} s: some of its stamps were never set, or count from "
        "another date; the motion across it cannot be told. Choose another `clock` or time signal, or keep "
        "one side with `window`"
    )


def unwrap(run: Signals, resolution: float | None) -> tuple[Signals, tuple[Finding, ...]]:
    """E-WRAP: undo jumps by a turn, or by a power of two counts."""
    steps = np.diff(run.position)
    typical = float(np.median(np.abs(steps)))
    largest = float(np.max(np.abs(steps)))
    for modulus in _moduli(resolution, largest):
        sizes = np.abs(steps)
        alone = np.maximum(np.roll(sizes, 1), np.roll(sizes, -1)) < 0.5 * modulus  # or it is a fast motion
        jumps = np.flatnonzero((np.abs(sizes - modulus) < 0.02 * modulus) & alone)
        if not jumps.size or typical > 0.05 * modulus or jumps.size > 0.02 * steps.size + 4:
            continue
        mended = steps.copy()
        mended[jumps] -= np.sign(steps[jumps]) * modulus
        around = np.abs(np.stack((np.roll(mended, 1), np.roll(mended, -1))))
        fits = np.abs(mended) <= 3.0 * around.max(axis=0) + 4.0 * (resolution or 0.0) + 1e-9 * modulus
        if not np.all(fits[jumps]):
            k = int(jumps[~fits[jumps]][0])
            raise LogError(
                f"{run.log}: E-WRAP refuse: the position jumps by {steps[k]:.6g} at t = {run.time[k]:.6g} s, "
                f"near a turn of {modulus:.6g}, but the speeds on both sides do not fit; every speed across "
                "it would be wrong. Cut the run there with `window`"
            )
        position = run.position[0] + np.concatenate(([0.0], np.cumsum(mended)))
        position = run.position + np.rint((position - run.position) / modulus) * modulus
        text = (
            f"the position wraps {jumps.size} times by {modulus:.6g}, first at t = "
            f"{run.time[jumps[0]]:.6g} s; it was unwrapped, which leaves every speed as it was"
        )
        return replace(run, position=position), (_warn("E-WRAP", text, run),)
    return run, ()


def _moduli(resolution: float | None, largest: float) -> list[float]:
    """Sizes of a wrap that the largest step may be: a turn, or 2^n counts from 8 bits on."""
    sizes = [2.0 * math.pi]
    if resolution is not None and largest > 200.0 * resolution:
        sizes.append(resolution * 2.0 ** round(math.log2(largest / resolution)))
    return sizes


def drop_spikes(run: Signals, resolution: float | None) -> tuple[Signals, tuple[Finding, ...]]:
    """E-SPIKE: drop single samples that leave the path and come back.

    A sample is wrong when it lies off the mean of its neighbours by more than six counts and eight times the
    local spread of that distance, and each neighbour lies half as far off on the other side: the mark that a
    single sample leaves, and that neither an impact nor an onset of motion does.
    """
    q = run.position
    off = q[1:-1] - 0.5 * (q[:-2] + q[2:])
    distance = np.abs(off)
    floor = 6.0 * (resolution or _smallest_step(q)) + 1e-9 * float(np.ptp(q))
    beside = np.stack((np.roll(off, 1), np.roll(off, -1)))
    alone = np.all(np.abs(beside + 0.5 * off) < 0.2 * distance, axis=0)
    suspects = np.flatnonzero(alone & (distance > floor) & (distance > 8.0 * float(np.median(distance))))
    wrong: list[int] = []
    for k in suspects.tolist():
        window = distance[max(0, k - _SPIKE_WINDOW) : k + _SPIKE_WINDOW + 1]
        quiet = np.sort(window)[: int(0.75 * window.size)]
        spread = 1.4826 * float(np.median(window))
        if distance[k] > max(8.0 * spread, 4.0 * float(quiet[-1])):
            wrong.append(k + 1)
    if not wrong:
        return run, ()
    share = len(wrong) / q.size
    seen = (
        f"{len(wrong)} single positions of {q.size} lie off the path of their neighbours, the first by "
        f"{off[wrong[0] - 1]:.3g} at t = {run.time[wrong[0]]:.6g} s"
    )
    if share > 0.01 and len(wrong) > 2:
        raise LogError(
            f"{run.log}: E-SPIKE refuse: {seen}; with so many wrong samples no speed can be trusted. "
            "Mend the encoder's cable and record the run again"
        )
    keep = np.ones(q.size, np.bool_)
    keep[wrong] = False
    return run.keep(keep), (_warn("E-SPIKE", f"{seen}; they were dropped", run),)


def _smallest_step(position: FloatArray) -> float:
    """The smallest step of positions (n,) [rad]: a count, where they have too few values to show one."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-12 * float(np.max(np.abs(position), initial=0.0))]
    return float(steps.min()) if steps.size else 0.0


def gaps(run: Signals, clock: str) -> tuple[Finding, ...]:
    """E-GAP: steps of over three medians."""
    step = np.diff(run.time)
    median = float(np.median(step))
    step[np.array(run.breaks, np.intp) - 1] = median
    wide = np.flatnonzero(step > GAP * median)
    if not wide.size:
        return ()
    k = int(wide[np.argmax(step[wide])])
    text = (
        f"{wide.size} steps of the clock ({clock}) exceed {GAP:g} times the median of {median:.6g} s, the "
        f"longest {step[k]:.6g} s at t = {run.time[k]:.6g} s; no derivative is taken across them"
    )
    return (_warn("E-GAP", text, run),)


def saturation(run: Signals, limit: float | None, *, declared: bool) -> tuple[Finding, ...]:
    """E-SAT: torque at its limit [N m], as declared or as `flat_top` found it."""
    if limit is None:
        return ()
    size = np.abs(run.torque)
    at_limit = size >= AT_LIMIT * limit if declared else size >= (1.0 - 1e-12) * limit
    if not at_limit.any():
        return ()
    what = f"at the limit of {limit:g}" if declared else f"flat at its top, about {limit:.6g}"
    k = int(np.argmax(at_limit))
    text = (
        f"the torque is {what} in {np.count_nonzero(at_limit)} of {size.size} samples, first at "
        f"t = {run.time[k]:.6g} s; a saturated torque is not the one commanded, and a breakaway there is "
        "only a lower bound of F_s. Those samples are not to be used"
    )
    return (_warn("E-SAT", text, run),)


def flat_top(run: Signals) -> float | None:
    """The torque [N m] at which an actuator without a declared limit saturates; None where it does not.

    A torque that is cut off piles up at its largest size: at exactly one number where the log is cut off, in
    a band as wide as the noise where the actuator is. It gets there gradually; a square wave jumps. The top
    of a smooth wave is at most 2.4 times as wide as what lies right below it, and noise is rarest at its
    largest. A constant speed is meant to show a plateau, and a loop at rest to hold its torque: there only a
    number that comes back again and again tells, or nothing.
    """
    size = np.abs(run.torque)
    top, reach = float(size.max()), float(np.ptp(size))
    if run.protocol == "set_point" or top == 0.0:
        return None
    others = size[size < top]
    levels = np.unique(others).size
    fine = levels > 0.5 * others.size
    steady = run.protocol == "constant_velocity"
    if levels < LEVELS or (steady and not fine):
        return None
    bands = [] if steady else list(np.geomspace(*BANDS) * reach)
    for width in [0.0] * fine + bands:
        flat = size >= top - width
        often = int(np.count_nonzero(flat))
        below = int(np.count_nonzero(size >= top - 2.0 * width)) - often
        begins = np.flatnonzero(np.diff(flat.astype(np.int8)) == 1)
        share = FLAT_SHARE if width else FLAT_SHARE / 10.0
        if often < max(FLAT_SAMPLES, share * size.size, PILED_UP * below):
            continue
        if begins.size < (FLAT_SAMPLES if steady else 1):
            continue
        if float(np.median(top - size[begins])) <= 0.1 * reach + width:
            return float(np.median(size[flat]))
    return None


def require_torque_size(run: Signals, torque_limit: float | None) -> None:
    """E-UNIT: refuse a torque that is far beyond what the actuator can give."""
    if torque_limit is None:
        return
    size = float(np.percentile(np.abs(run.torque), 99.0))
    if size <= FAR_BEYOND * torque_limit:
        return
    raise LogError(
        f"{run.log}: E-UNIT refuse: the torque reaches {size:.4g}, {size / torque_limit:.4g} times the "
        f"torque limit of {torque_limit:g} that [rig] declares: it looks like mN m, or a current without its "
        "torque constant; every torque and the inertia would be off by such a factor. Correct `unit` or "
        "`scale` of the torque in [signals], or the limit"
    )


def require_count(run: Signals, *, found: float, declared: float) -> None:
    """E-UNIT: refuse positions whose smallest step is the declared count [rad] in another unit."""
    factor = found / declared
    looks = next((text for size, text in _COUNT_LOOKS_LIKE if abs(factor / size - 1.0) < 0.01), None)
    if looks is None:
        return
    raise LogError(
        f"{run.log}: E-UNIT refuse: the position moves in steps of {found:.6g}, {factor:#.4g} times the "
        f"count of {declared:.6g} that `encoder_counts` declares: {looks}; the inertia, b and v_s would be "
        "off by such a factor. Correct `unit` of the position in [signals], or `encoder_counts`"
    )


def require_velocity_unit(run: Signals, resolution: float | None) -> None:
    """E-UNIT: refuse a logged velocity that is not the position's slope."""
    if run.velocity is None:
        return
    step = np.diff(run.time)
    way = np.cumsum(0.5 * (run.velocity[1:] + run.velocity[:-1]) * step)
    marks = np.unique(np.linspace(0, step.size - 1, min(200, max(2, step.size // 5))).astype(int))
    logged = np.diff(way[marks])
    measured = np.diff(run.position[1:][marks])
    moved = float(np.sum(measured**2))
    if math.sqrt(moved) < 50.0 * (resolution or 0.0) + 1e-12 or float(np.sum(logged**2)) == 0.0:
        return
    factor = float(np.sum(logged * measured)) / moved
    likeness = factor * math.sqrt(moved / float(np.sum(logged**2)))  # the correlation through the origin
    if 0.8 < factor < 1.25 or abs(likeness) < 0.8:
        return
    looks = next((text for size, text, _ in _LOOKS_LIKE if abs(abs(factor) / size - 1.0) < 0.05), "")
    if factor < 0.0:
        looks = "it has the opposite sign" + (f", and {looks}" if looks else "")
    if not looks and 0.5 < factor < 2.0:
        return  # a filtered or lagging velocity; it is never used over the position
    raise LogError(
        f"{run.log}: E-UNIT refuse: velocity is {factor:#.4g} times dq/dt"
        + (f": {looks}" if looks else "")
        + "; every friction parameter would be off by such a factor. Correct `unit`, `scale` or `sign` of "
        "position or velocity in [signals], or drop the velocity signal"
    )


def require_torque_sign(run: Signals, resolution: float | None) -> None:
    """E-SIGN: refuse a torque that takes work out of the link over the whole run, which friction forbids.

    What inertia takes it gives back; where it is large, and the link moves one way, the mean work tells.
    """
    way = np.diff(run.position)
    far = float(np.sum(np.abs(way)))
    if far < 200.0 * (resolution or 0.0) + 1e-12:
        return
    power = run.torque[:-1] * way  # a sample is held until the next: a loop that chatters shows it
    size = float(np.sum(np.abs(power)))
    share = float(np.sum(power)) / size if size > 0.0 else 0.0
    blocks = np.array([piece.sum() for piece in np.array_split(power, SIGN_BLOCKS)])
    scatter = float(np.std(blocks)) / math.sqrt(SIGN_BLOCKS)
    one_way = abs(float(np.sum(way))) > 0.9 * far
    if share > -0.6 and not (one_way and share < -0.05 and float(blocks.mean()) < -5.0 * scatter):
        return
    raise LogError(
        f"{run.log}: E-SIGN refuse: the torque opposes the motion (its work over the run is negative, "
        f"{100 * share:.0f} % of its size), as if friction drove the link; every friction torque would "
        "change sign. Set `sign = -1` on torque or position in [signals]"
    )


def _warn(code: str, text: str, run: Signals) -> Finding:
    return Finding(code, Severity.WARN, text, run.log)

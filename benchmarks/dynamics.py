"""The closed loop beside its peers: `python -m benchmarks.dynamics [--json] [--quick]`.

20 s at r = 1.1, L = 73.5 from (1, 0, 0), 401 output points, as one trajectory and as 1000 from random
starts on all cores; a bifurcation diagram over r; a random campaign; and the time of the first call. Errors
are the largest in x1 over the output points against this project's solution at 1e-15, which the best of the
peers (DOP853 with events) confirms independently. Of many trajectories the median over them is given.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Final

import numpy as np

from benchmarks.loop_peers import (
    LOOP,
    FloatArray,
    Peer,
    R,
    events_dop853,
    modes_cvode,
    smoothed_diffrax,
    smoothed_lsoda,
)
from benchmarks.random_campaign import Findings, run_campaign
from benchmarks.rows import Row, against, figure, in_turns, seconds, show, without_peer
from compensation.bifurcation import diagram
from compensation.closed_loop import simulate
from compensation.loop_tables import gain_row
from compensation.many_trajectories import simulate_many

DURATION: Final = 20.0
TIMES: Final = np.linspace(0.0, DURATION, 401)
START: Final = np.array([1.0, 0.0, 0.0])
ACCURACIES: Final = (("1e-7", 1e-7, 5e-10), ("1e-12", 2e-13, 1e-11))  # name, our tolerance, numbalsoda's
SEED: Final = 20
CORES: Final = os.cpu_count() or 1
SLOW_PEERS: Final[tuple[tuple[str, Callable[[FloatArray], Peer]], ...]] = (
    ("scipy LSODA, tanh 1e-7", smoothed_lsoda),
    ("scipy DOP853, events", events_dop853),
    ("scikit-sundae CVODE, modes by hand", modes_cvode),
    ("diffrax Kvaerno5, tanh 1e-5", smoothed_diffrax),
)
FASTEST: Final = "numbalsoda, tanh 1e-9"


def main() -> None:
    """Run everything and print it."""
    parser = argparse.ArgumentParser(description="The closed loop beside its peers.")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="fewer rounds and trajectories")
    asked = parser.parse_args()
    rows = [*_one_trajectory(asked.quick), *_many(asked.quick), *_diagrams(asked.quick)]
    rows += [*_first_call(), *_campaign(2_000 if asked.quick else 100_000)]
    show(rows, as_json=asked.json)


def _ours(tolerance: float) -> FloatArray:
    found: FloatArray = simulate(LOOP, START, duration=DURATION, times=TIMES, tolerance=tolerance).state[:, 0]
    return found


def _one_trajectory(quick: bool) -> list[Row]:
    truth = _ours(1e-15)
    rows = []
    for name, tolerance, peers in ACCURACIES:
        case = f"one trajectory {name}"
        try:
            from benchmarks.numbalsoda_peer import single  # noqa: PLC0415  # a peer that may be missing
        except ImportError as missing:
            rows.append(without_peer(case, FASTEST, str(missing)))
        else:
            rows.append(_beside(case, FASTEST, single(TIMES, tolerance=peers), tolerance, truth, 30, 50))
        for peer_name, make in SLOW_PEERS:
            try:
                peer = make(TIMES)
            except ImportError as missing:
                rows.append(without_peer(case, peer_name, str(missing)))
            else:
                rows.append(_beside(case, peer_name, peer, tolerance, truth, 1 if quick else 3, 1))
    return rows


def _beside(
    case: str, name: str, peer: Peer, tolerance: float, truth: FloatArray, rounds: int, repeats: int
) -> Row:
    ours, theirs = in_turns(
        [partial(_ours, tolerance), partial(peer, START, R)], rounds=rounds, repeats=(50, repeats)
    )
    return against(
        case,
        name,
        1e3 * ours,
        1e3 * theirs,
        error_ours=float(np.max(np.abs(_ours(tolerance) - truth))),
        error_peer=float(np.max(np.abs(peer(START, R) - truth))),
        unit="ms",
    )


def _many(quick: bool) -> list[Row]:
    count = 100 if quick else 1000
    case = f"1000 trajectories, {CORES} cores" + (" (100 of them)" if quick else "")
    starts = np.zeros((count, 3))
    starts[:, 0] = np.random.default_rng(SEED).uniform(0.2, 1.2, count)
    gains = np.tile(gain_row(LOOP.controller), (count, 1))
    with ThreadPoolExecutor(CORES) as threads:

        def ours(tolerance: float = 1e-8) -> FloatArray:
            found: FloatArray = simulate_many(
                LOOP, starts, duration=DURATION, times=TIMES, gains=gains, tolerance=tolerance,
                map_parts=threads.map, parts=CORES,
            ).state[:, :, 0]  # fmt: skip
            return found

        try:
            from benchmarks.numbalsoda_peer import batch  # noqa: PLC0415  # a peer that may be missing
        except ImportError as missing:
            return [without_peer(case, FASTEST, str(missing))]
        out, run_part = batch(TIMES, starts, np.full(count, R), tolerance=5e-10)

        def theirs() -> FloatArray:
            list(threads.map(run_part, range(CORES), [CORES] * CORES))
            return out

        spent = in_turns([ours, theirs], rounds=5, repeats=(3, 1))
        truth = ours(1e-14)
        errors = [float(np.median(np.max(np.abs(run() - truth), axis=1))) for run in (ours, theirs)]
    return [
        against(
            case, FASTEST, 1e3 * spent[0], 1e3 * spent[1], error_ours=errors[0], error_peer=errors[1],
            unit="ms",
        )
    ]  # fmt: skip


def _diagrams(quick: bool) -> list[Row]:
    """Two sizes in turns, and one run of the fastest peer, by which other machines can be compared."""

    def draw(points: int) -> None:
        diagram(LOOP, "r", np.linspace(0.8, 1.2, points))

    runs: list[Callable[[], object]] = [partial(draw, 200), partial(draw, 5000)]
    repeats = [5, 1]
    try:
        from benchmarks.numbalsoda_peer import single  # noqa: PLC0415  # a peer that may be missing
    except ImportError as missing:
        peer_rows = [without_peer("200-point diagram", FASTEST, str(missing))]
    else:
        runs.append(partial(single(TIMES, tolerance=ACCURACIES[0][2]), START, R))
        repeats.append(20)
        peer_rows = []
    small, large, *peer = in_turns(runs, rounds=3 if quick else 9, repeats=repeats)
    case = "200-point diagram"
    return [
        figure(case, 1e3 * small, 15.0, "ms"),
        *(figure(f"{case}, single runs of {FASTEST}", small / one, None, "-") for one in peer),
        *peer_rows,
        figure(f"{case}, a point", 1e6 * small / 200.0, None, "us"),
        figure("5000-point diagram, a point", 1e6 * large / 5000.0, None, "us"),
        figure("5000-point diagram, cost of a point beside 200's", large / small / 25.0, 1.2, "-"),
    ]


def _first_call() -> list[Row]:
    with tempfile.TemporaryDirectory() as empty:
        environment = {**os.environ, "NUMBA_CACHE_DIR": empty}
        command = [sys.executable, "-m", "benchmarks.first_call"]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)  # noqa: S603
    one, all_kernels = map(float, run.stdout.split())
    return [
        figure("first call: one trajectory", one, 15.0, "s"),
        figure("first call: every kernel", all_kernels, 15.0, "s"),
    ]


def _campaign(count: int) -> list[Row]:
    generator = np.random.default_rng(SEED)
    run_campaign(20, generator)  # compiles
    found: list[Findings] = []
    taken = seconds(lambda: found.append(run_campaign(count, generator)))
    case, counts = f"random campaign of {count}", dict(vars(found[0]))
    failed = vars(counts.pop("failures"))
    rows = [figure(f"{case}: {name}", number, 0, "trajectories") for name, number in failed.items()]
    rows += [figure(f"{case}: {name}", number, None, "trajectories") for name, number in counts.items()]
    return [*rows, figure(f"{case}: time", taken, 600.0, "s")]


if __name__ == "__main__":
    main()

"""What every benchmark prints: rows of ours beside a peer's, the machine and the versions.

A ratio above 1 means that ours is that many times better. A peer that is missing is a row without a ratio
that says why; a figure without a peer has a value and the target that it is held against.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]
PACKAGES = ("numpy", "scipy", "numba", "numbalsoda", "scikit-sundae", "diffrax", "jax")


def seconds(run: Callable[[], object], *, repeats: int = 1) -> float:
    """Wall time [s] of one run, of `repeats` in a row."""
    begun = time.perf_counter()
    for _ in range(repeats):
        run()
    return (time.perf_counter() - begun) / repeats


def in_turns(runs: Sequence[Callable[[], object]], *, rounds: int, repeats: Sequence[int]) -> list[float]:
    """Median wall time [s] of each of several runs, taken in turns so that a busy machine harms all alike."""
    for run in runs:
        run()  # compiles
    taken = [
        [seconds(run, repeats=often) for run, often in zip(runs, repeats, strict=True)] for _ in range(rounds)
    ]
    return [float(value) for value in np.median(taken, axis=0)]


def against(
    case: str, peer_name: str, ours: float, peer: float, *, error_ours: float, error_peer: float, unit: str
) -> Row:
    """Ours beside a peer, both costs in `unit`: less is better."""
    return {
        "case": case,
        "ours": ours,
        "peer": peer,
        "peer_name": peer_name,
        "ratio": peer / ours,
        "error_ours": error_ours,
        "error_peer": error_peer,
        "unit": unit,
    }


def without_peer(case: str, peer_name: str, reason: str) -> Row:
    """A peer that could not be run."""
    return {
        "case": case,
        "ours": None,
        "peer": None,
        "peer_name": peer_name,
        "ratio": None,
        "error_ours": None,
        "error_peer": None,
        "unit": "ms",
        "reason": reason,
    }


def figure(case: str, value: float, target: float | None, unit: str) -> Row:
    """A figure held against a target, where it has one."""
    return {"case": case, "value": value, "target": target, "unit": unit}


def show(rows: Sequence[Row], *, as_json: bool) -> None:
    """Print the rows with the machine and the versions."""
    machine = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
    machine["system"] = f"{platform.system()} {platform.release()}"
    versions = {"python": platform.python_version(), **_installed()}
    if as_json:
        print(json.dumps({"rows": list(rows), "machine": machine, "versions": versions}, indent=1))
        return
    for row in rows:
        print(_line(row))
    print(f"{machine}\n{versions}")


def _line(row: Row) -> str:
    if "value" in row:
        target = "" if row["target"] is None else f"   target {row['target']:g}"
        return f"{row['case']:58s} {row['value']:10.4g} {row['unit']}{target}"
    if row["ratio"] is None:
        return f"{row['case']:38s} {row['peer_name']:34s} not run: {row['reason']}"
    ours = f"ours {row['ours']:9.4g} {row['unit']} ({row['error_ours']:.1e})"
    peer = f"peer {row['peer']:9.4g} {row['unit']} ({row['error_peer']:.1e})"
    return f"{row['case']:38s} {row['peer_name']:34s} {ours}   {peer}   x {row['ratio']:.1f}"


def _installed() -> dict[str, str]:
    found = {}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found

"""What every benchmark prints: rows, as a table for people or as JSON.

A row that was run beside a peer has `ours`, `peer` and `ratio`, above 1 where ours is that many times better;
a row without a peer has `value` and `target`. A peer that is missing has `ratio` null and the reason in
`peer_name`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from rich.console import Console
from rich.table import Table

Row = dict[str, Any]
PEERED = ("case", "ours", "peer", "peer_name", "ratio", "error_ours", "error_peer", "unit")
PLAIN = ("case", "value", "target", "unit")
PACKAGES = ("stribeck", "numpy", "scipy", "numba", "lmfit", "filterpy", "mcap", "pandas")


def main(name: str, rows: Callable[[bool], Sequence[Row]]) -> None:
    """Run a benchmark as a command: `--quick` for less of it, `--json` for programs."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="a smaller run")
    asked = parser.parse_args()
    found = list(rows(asked.quick))
    if asked.json:
        print(json.dumps({"rows": found, "machine": _machine(), "versions": _versions()}, indent=1))
        return
    console = Console()
    for columns in (PEERED, PLAIN):
        part = [row for row in found if ("ratio" in row) == (columns is PEERED)]
        if part:
            console.print(_table(columns, part))


def _table(columns: Sequence[str], rows: Sequence[Row]) -> Table:
    table = Table(*columns)
    for row in rows:
        table.add_row(*(_shown(row.get(column)) for column in columns))
    return table


def _shown(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _machine() -> dict[str, object]:
    return {"system": platform.system(), "processor": platform.machine(), "cores": os.cpu_count()}


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found

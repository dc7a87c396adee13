"""Everything that identification promises, held against its targets.

    python -m benchmarks.calibration [--quick] [--json] [--only NAME ...]

Each part is a module with `rows(quick)`; `--only` runs some of them.
"""

from __future__ import annotations

import argparse
import importlib
from typing import Final

from benchmarks.rows import Row, show

PARTS: Final = ("bias", "coverage", "faults", "real_rigs", "smoother", "speed")


def main() -> None:
    """As a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="a small copy of each part")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="some parts alone")
    asked = parser.parse_args()
    found: list[Row] = []
    for part in asked.only:
        found += importlib.import_module(f"benchmarks.calibration.{part}").rows(asked.quick)
    show(found, as_json=asked.json)


if __name__ == "__main__":
    main()

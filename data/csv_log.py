"""A rig log as CSV: comment lines with metadata, one header, numbers.

    # simulated: true
    t,q_deg,i
    0.0,12.5,0.31

Written with the shortest decimals that read back as the same number, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from data.files import write_atomically
from data.findings import LogError

FloatArray = NDArray[np.float64]


def write_csv(
    path: Path, *, columns: Mapping[str, FloatArray], metadata: Mapping[str, str] | None = None
) -> None:
    """Write one run, whole or not at all.

    Parameters
    ----------
    path
        The file; folders on the way are made.
    columns
        Arrays (n,) by header, in order. A unit may stand in the header: `q [deg]`.
    metadata
        Text by key, as lines `# KEY: value` before the header.

    Raises
    ------
    LogError
        When the arrays differ in length, or a header or metadata text holds a control character.
    """
    lengths = {header: array.shape for header, array in columns.items()}
    if len(set(lengths.values())) > 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise LogError(f"{path.name}: the columns to write differ in shape: {lengths}")
    for text in (*columns, *(metadata or {}).keys(), *(metadata or {}).values()):
        if not text.isprintable():
            raise LogError(f"{path.name}: {text!r} holds a control character and cannot stand in a CSV log")
    head = "".join(f"# {key}: {value}\n" for key, value in (metadata or {}).items())
    table = pd.DataFrame(dict(columns)).to_csv(index=False, lineterminator="\n")
    write_atomically(path, head + table)

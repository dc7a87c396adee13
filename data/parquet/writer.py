"""A rig log as Parquet, written: float64 columns with their units, checksums on every page."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from data.columns import require_one_length
from data.files import write_atomically

FloatArray = NDArray[np.float64]


def write_parquet(
    path: Path,
    *,
    columns: Mapping[str, FloatArray],
    units: Mapping[str, str] | None = None,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write one run, whole or not at all; every number reads back bit for bit.

    Parameters
    ----------
    path
        The file; folders on the way are made.
    columns
        Arrays (n,) by name, in order.
    units
        The unit of those columns that have one, in the metadata of their fields.
    metadata
        Text by key, in the footer (`simulated = true` marks a virtual rig's log).

    Raises
    ------
    LogError
        When the arrays differ in length.
    """
    require_one_length(path, columns)
    said = units or {}
    schema = pa.schema(
        [
            pa.field(name, pa.float64(), metadata={"unit": said[name]} if name in said else None)
            for name in columns
        ],
        metadata=dict(metadata or {}),
    )
    table = pa.table([pa.array(array) for array in columns.values()], schema=schema)
    sink = BytesIO()
    pq.write_table(table, sink, compression="zstd", use_dictionary=False, write_page_checksum=True)
    write_atomically(path, sink.getvalue())

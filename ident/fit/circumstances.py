"""When and where each steady run and each breakaway was recorded: what a residual may depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data.recording import FloatArray, Recording
from ident.evidence.gathering import Evidence

PLACES = 500  # of a run over which sine and cosine are averaged


@dataclass(frozen=True)
class Circumstances:
    """Of the runs and then of the breakaways (n + m,). Times of different groups cannot be compared."""

    time: FloatArray  # (n + m,) of the middle [s]
    group: NDArray[np.int64]  # (n + m,) one group where the logs say when they began, else one a log
    sine: FloatArray  # (n + m,) mean of sin q over a run, q in rad [-]
    cosine: FloatArray  # (n + m,) mean of cos q [-]


def circumstances(recordings: Sequence[Recording], evidence: Evidence) -> Circumstances:
    """When and where everything that the fit took was recorded."""
    by_name = {recording.log: recording for recording in recordings}
    spans = [(run.log, run.start_time, run.end_time) for run in evidence.used_runs]
    spans += [(start.log, start.onset_time, start.onset_time) for start in evidence.used_starts]
    logs = list(dict.fromkeys(log for log, _, _ in spans))
    dated = all(by_name[log].begun is not None for log in logs)
    time, group, sine, cosine = [], [], [], []
    for log, first, last in spans:
        recording = by_name[log]
        time.append(0.5 * (first + last) + ((recording.begun or 0.0) if dated else 0.0))
        group.append(0 if dated else logs.index(log))
        start, past = np.searchsorted(recording.time, [first, last])
        place = recording.position[start : past + 1 : max(1, (past - start) // PLACES)]
        sine.append(float(np.mean(np.sin(place))))
        cosine.append(float(np.mean(np.cos(place))))
    return Circumstances(np.array(time), np.array(group, dtype=np.int64), np.array(sine), np.array(cosine))

r"""An unbalanced link under gravity, seen from run to run.

Its torque a cos q + b sin q is a wave over one turn. Runs that cover a turn and more show it within
themselves (`ident.evidence.position_ripple`). Shorter runs show it only among each other, each at its own
place: there it is found as two columns added to the law, taken out like any wave, and the law is fitted anew.
As the law changes the wave does, a little; a few rounds settle both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from data.recording import FloatArray, Recording
from ident.evidence.gathering import Evidence
from ident.evidence.position_ripple import Wave
from ident.evidence.ripple_correction import (
    corrected_motions,
    corrected_runs,
    corrected_starts,
    is_turn,
    without_wave_scatter,
)
from ident.fit.added_columns import CHANCE, Added, added
from ident.fit.circumstances import Circumstances, circumstances
from ident.fit.one_stage import Explained
from ident.fit.predictions import directions

ROUNDS = 4
SETTLED = 0.1  # standard errors by which a round may still move the wave


def without_gravity(
    recordings: Sequence[Recording], evidence: Evidence, explain: Callable[[Evidence], Explained]
) -> tuple[Evidence, Explained]:
    """The evidence less gravity, where its runs show any, and its explanation; for a rotary axis."""
    explained = explain(evidence)
    if any(is_turn(wave) for wave in evidence.waves):
        return evidence, explained
    coefficients = np.zeros(2)
    corrected = evidence
    for number in range(ROUNDS):
        found = _seen(explained, circumstances(recordings, explained.evidence))
        if found is None or (number == 0 and found.chance >= CHANCE):
            break
        coefficients = coefficients + found.coefficients
        corrected = _less(recordings, evidence, _wave(coefficients, found.covariance))
        explained = explain(corrected)
        moved = found.coefficients @ np.linalg.pinv(found.covariance) @ found.coefficients
        if moved < SETTLED**2:
            break
    return corrected, explained


def _seen(explained: Explained, seen: Circumstances) -> Added | None:
    sign = directions(explained.weighted.data)[:, None]
    columns = np.column_stack([seen.cosine, seen.sine]) * sign
    return added(explained.weighted, columns, least_scatter=1.0)


def _wave(coefficients: FloatArray, covariance: FloatArray) -> Wave:
    return Wave(
        wavenumber=1.0,
        wavenumber_stderr=0.0,
        centre=0.0,
        coefficients={1: coefficients, -1: coefficients},
        covariance={1: covariance, -1: covariance},
        amplitude=float(np.hypot(*coefficients)),
        coherent=True,
    )


def _less(recordings: Sequence[Recording], evidence: Evidence, wave: Wave) -> Evidence:
    waves = (*evidence.waves, wave)
    return replace(
        evidence,
        runs=corrected_runs(recordings, without_wave_scatter(recordings, evidence.runs, waves), [wave]),
        starts=corrected_starts(evidence.starts, [wave]),
        momenta=corrected_motions(evidence.momenta, [wave]),
        waves=waves,
    )
